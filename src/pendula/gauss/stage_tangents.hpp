#pragma once

#include <array>
#include <cstddef>
#include <pendula/gauss/member_columns.hpp>
#include <pendula/gauss/stage_prediction.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/system_tangents.hpp>
#include <vector>

namespace pendula {

/// Tangents of the motions of several systems, one in each lane, along Gauss steps. They follow the variational
/// equations of coordinates and rates, (δq)˙ = δq̇, (δq̇)˙ = δq̈. The stages of these are solved after those of the
/// motion, by a fixed point of their own. Motion and tangent are one system of equations for the Gauss method, so that
/// tangents have its order. They are not the derivatives of the steps themselves, which are taken in momenta.
template <int S, class L>
class StageTangents {
 public:
  using Mask = typename L::Mask;
  using Columns = MemberColumns<S, L>;
  using Stages = typename Columns::Stages;

  /// Both must outlive it.
  StageTangents(MemberSystems<L>& dynamics, const Columns& columns)
      : dynamics_(dynamics),
        columns_(columns),
        measure_(dynamics),
        parts_(static_cast<std::size_t>(dynamics.coordinates())),
        calls_(kinds * parts_.size()) {}
  StageTangents(const StageTangents&) = delete;
  StageTangents& operator=(const StageTangents&) = delete;

  /// SystemTangents::start.
  void start(int lane, double time, const double* q, const double* v) {
    const auto tangent = measure_.start(lane, time, q, v);
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      parts_[k].place.set(lane, tangent.place[k]);
      parts_[k].rate.set(lane, tangent.rate[k]);
    }
  }

  /// Predicts the stages of the step that `columns` are prepared for; those that start cold, from (q, q̇) at `time`.
  void prepare(const StagePrediction<L>& from, const L& time, const double* q, const double* v) {
    for (CoordinateTangent& part : parts_) {
      typename Columns::History history;
      for (std::size_t d = 0; d < pasts; ++d) history[d] = &part.past[(newest_ + d) % pasts].sped;
      Stages advance;
      columns_.extrapolate(history, advance, true);
      detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { part.sped[j] = L(columns_.b(j)) * advance[j]; });
    }
    if (xsimd::any(from.cold)) start_cold(from.cold, time, q, v);
    find_scale();
  }

  /// One iteration for the members that are `active`. Returns the square of what changed. stage(j, 0), stage(j, 1) and
  /// stage(j, 2) are times, q and q̇ of stage j.
  template <class Stage>
  L iterate(const Mask& active, Stage stage) {
    for (CoordinateTangent& part : parts_) {
      find_rates(part);
      columns_.integrate(part.moved, part.place, part.places);
    }
    L change(0.0);
    for (int j = 0; j < S; ++j) {
      const auto at_stage = static_cast<std::size_t>(j);
      for (int k = 0; k < count(); ++k) {
        at(k).places[at_stage].store(numbers(0, k));
        at(k).rates[at_stage].store(numbers(1, k));
      }
      dynamics_.call(stage(j, 0), &SystemFunctions::acceleration_along, stage(j, 1), stage(j, 2), numbers(0, 0),
                     numbers(1, 0), numbers(2, 0), numbers(3, 0));
      for (int k = 0; k < count(); ++k) {
        L& held = at(k).sped[at_stage];
        const L found = columns_.hb(j) * L::load(numbers(3, k));
        const L difference = measure_.inverse_size(k) * (found - held);
        change = fma(difference, difference, change);
        held = select(active, found, held);
      }
    }
    return change;
  }
  const L& scale() const { return scale_; }  ///< what changes are compared with, squared

  /// Computes what the stages add to the tangents, which do not change yet. Call before `decay` and `accept`.
  void finish() {
    newest_ = (newest_ + pasts - 1) % pasts;
    for (CoordinateTangent& part : parts_) {
      find_rates(part);  // from its own last iteration, however long those of other members went on
      Past& past = part.past[newest_];
      detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT {
        past.moved[j] = L(columns_.inverse_b(j)) * part.moved[j];
        past.sped[j] = L(columns_.inverse_b(j)) * part.sped[j];
      });
    }
  }

  /// The coefficient of the Legendre polynomial P_n in δq̇, times h, squared.
  L decay(int n) const {
    L squared(0.0);
    for (int k = 0; k < count(); ++k) {
      const L a = measure_.inverse_size(k) * columns_.legendre(n, at(k).past[newest_].moved);
      squared = fma(a, a, squared);
    }
    return squared;
  }

  void accept(const Mask& which) {
    for (CoordinateTangent& part : parts_) {
      part.place = select(which, part.place + Columns::total(part.moved), part.place);
      part.rate = select(which, part.rate + Columns::total(part.sped), part.rate);
    }
  }

  /// save() keeps all tangents. restore(which) puts those of these members back.
  void save() {
    for (CoordinateTangent& part : parts_) part.saved = {part.place, part.rate};
  }
  void restore(const Mask& which) {
    for (CoordinateTangent& part : parts_) {
      part.place = select(which, part.saved[0], part.place);
      part.rate = select(which, part.saved[1], part.rate);
    }
  }

  /// The logarithm of the growth of these members' tangents since their length was 1. Scales them to the length 1
  /// again.
  L take_growth(const Mask& which) {
    const L length_squared = squared();
    const L factor = select(which, L(1.0) / sqrt(length_squared), L(1.0));
    for (CoordinateTangent& part : parts_) {
      part.place = factor * part.place;
      part.rate = factor * part.rate;
      for (Past& past : part.past) {
        for (L& x : past.moved) x = factor * x;
        for (L& x : past.sped) x = factor * x;
      }
    }
    return 0.5 * log(length_squared);
  }

 private:
  static constexpr std::size_t pasts = static_cast<std::size_t>(Columns::most_depth);
  static constexpr std::size_t kinds = 4;  // δq, δq̇, q̈, δq̈

  // Stage values for predictions of later steps: h δq̇ and h δq̈.
  struct Past {
    Stages moved{}, sped{};
  };
  struct CoordinateTangent {
    L place{0.0}, rate{0.0};  // δq, δq̇
    std::array<L, 2> saved{};
    Stages moved{}, sped{};          // h b δq̇, h b δq̈
    Stages places{}, rates{};        // δq, δq̇ of the stages
    std::array<Past, pasts> past{};  // newest_ is the last step's
  };

  int count() const { return static_cast<int>(parts_.size()); }
  CoordinateTangent& at(int k) { return parts_[static_cast<std::size_t>(k)]; }
  const CoordinateTangent& at(int k) const { return parts_[static_cast<std::size_t>(k)]; }
  double* numbers(int which, int k) { return calls_[which * count() + k]; }

  L squared() const {
    return measure_.squared([&](int k) -> const L& { return at(k).place; },
                            [&](int k) -> const L& { return at(k).rate; });
  }

  void find_rates(CoordinateTangent& part) {
    columns_.integrate(part.sped, part.rate, part.rates);
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { part.moved[j] = columns_.hb(j) * part.rates[j]; });
  }

  // The scale of changes, squared: the change of tangents in a step at their pace, and h b δq̈ of the last step.
  void find_scale() {
    scale_ = (columns_.h() * columns_.h()) * squared() / measure_.inverse_pace_squared();
    for (int k = 0; k < count(); ++k) {
      for (const L& sped : at(k).sped) {
        const L size = measure_.inverse_size(k) * sped;
        scale_ = fma(size, size, scale_);
      }
    }
  }

  void start_cold(const Mask& cold, const L& time, const double* q, const double* v) {
    for (int k = 0; k < count(); ++k) {
      at(k).place.store(numbers(0, k));
      at(k).rate.store(numbers(1, k));
    }
    dynamics_.here(time, &SystemFunctions::acceleration_along, q, v, numbers(0, 0), numbers(1, 0), numbers(2, 0),
                   numbers(3, 0));
    for (int k = 0; k < count(); ++k) {
      CoordinateTangent& part = at(k);
      const L push = L::load(numbers(3, k));
      for (std::size_t j = 0; j < static_cast<std::size_t>(S); ++j) {
        part.sped[j] = select(cold, columns_.hb(static_cast<int>(j)) * push, part.sped[j]);
      }
      for (Past& past : part.past) {
        for (L& x : past.sped) x = select(cold, L(0.0), x);
      }
    }
  }

  MemberSystems<L>& dynamics_;
  const Columns& columns_;
  SystemTangents<L> measure_;
  std::vector<CoordinateTangent> parts_;
  PackRows<L::width> calls_;
  std::size_t newest_ = 0;
  L scale_{0.0};
};

}  // namespace pendula
