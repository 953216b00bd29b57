#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_turns.hpp>
#include <pendula/chain/end_mobility.hpp>
#include <pendula/chain/held_end.hpp>
#include <pendula/chain/held_rods.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/number_text.hpp>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace pendula {

/// The stages of a chain whose last bob may be held. For one that is, a sweep eliminates multipliers from the pivot to
/// the last bob, where the push of the hook is found, and goes back; that of a free chain (ChainIteration) goes the
/// other way. Both do the same work a link.
template <class Space, int S, int N, class Real>
class HeldStages : public ChainTurns<Space, S, N, Real> {
  using Base = ChainTurns<Space, S, N, Real>;

 public:
  using Base::D, Base::links;
  using typename Base::L, typename Base::Numbers;
  using Vector = std::array<L, D>;

  using Base::Base;

  /// How far the last accepted step ended from where the end is held, and its rate  [m, m/s].
  std::pair<double, double> constraint_errors() const { return errors_; }

 protected:
  using Base::columns_, Base::constants_, Base::rods_, Base::stages_;

  /// Whether a chain of these numbers can be held at all; whether it is.
  static constexpr bool may_be_held = std::is_same_v<Real, double> && N == Eigen::Dynamic;
  bool is_held() const {
    if constexpr (may_be_held) return end_.has_value();
    return false;
  }

  void hold([[maybe_unused]] const ChainEnd& end, Family family) {
    if constexpr (may_be_held) {
      if (family != Family::gauss) throw std::invalid_argument("method: expected gauss for a chain whose end is held");
      end_.emplace(end);
      room_ = rods_.place();
      for (int i = 0; i < links(); ++i) fall_squared_ += constants_[i].inverse_square;
      fall_squared_ *= this->gravity_ * this->gravity_;
    } else {
      throw std::invalid_argument("chain.end: expected numbers of double precision, and links counted at run time");
    }
  }

  // What ChainStages calls: the same as of a free chain, where the end is not held.
  void close_end(double time) {
    if constexpr (may_be_held) {
      if (is_held()) close_held(time);
    }
  }
  void prepare_end(double time) {
    if constexpr (may_be_held) {
      if (is_held()) prepare_held(time);
    }
  }
  template <class Visit>
  Real iterate(Visit& visit) {
    if constexpr (may_be_held) {
      if (is_held()) return iterate_held(visit);
    }
    return Base::iterate(Everyone{}, visit);
  }
  void move_on() {
    if constexpr (may_be_held) {
      if (is_held()) return move_held();
    }
    Base::move(Everyone{});
  }
  void note_end() {
    if constexpr (may_be_held) {
      if (is_held()) note_held();
    }
  }
  /// After lengths were restored: a gap of rounding would have to close within the next step, however short that is.
  void return_end() {
    if constexpr (may_be_held) {
      if (is_held()) close_gap();
    }
  }
  /// What a hook that moves brings in the finished step  [J]. The impulse at its end is found there.
  Real brought_by_end() {
    if constexpr (may_be_held) {
      if (is_held() && end_->end().moves()) return brought_by_held();
    }
    return Real(0);
  }
  void tempo(Real& pace, Real& quickening) const {
    if constexpr (may_be_held) {
      if (is_held()) return tempo_held(pace, quickening);
    }
    Base::tempo(pace, quickening);
  }

  template <class MemberNumbers>
  void member(MemberNumbers& numbers) {
    numbers(start_time_);
  }

 private:
  using Ends = HeldRods<typename Base::Rods>;

  static constexpr double nearly_closed = 1e-9;  // of the length of the chain
  static constexpr double stretched = 1e-9;      // how far it gives way along the last rod, relative to across

  // Brings a state that keeps the end to the rounding of its angles to where it keeps it to that of rods.
  void close_held(double time) {
    start_time_ = time;
    Real length(0);
    for (int i = 0; i < links(); ++i) length += constants_[i].length;
    const Numbers gap = Ends::gap(rods_, end_place(time));
    if (const Real off = std::sqrt(dot(gap, gap)); !(off <= Real(nearly_closed) * length)) {
      throw std::invalid_argument("chain.end: expected a start with the last bob where it is held, got one " +
                                  shortest(off) + " m beside");
    }
    const auto tip = Ends::find_tip(rods_, constants_, [](int) { return Real(0); });
    if (!(tip.mobility.along() > Real(stretched))) {
      throw std::invalid_argument(
          "chain.end: expected a start in which the chain can move, got one stretched straight between its ends");
    }
    for (int correction = 0; correction < 3; ++correction) close_gap();
    Ends::push_to_rate(rods_, constants_, end_rate(time));
  }

  void close_gap() { Ends::move_end(rods_, constants_, scaled(Real(-1), Ends::gap(rods_, end_place(start_time_)))); }

  // Of a step from `time`, whose other stages are predicted.
  [[gnu::noinline]] void prepare_held(double time) {
    start_time_ = time;
    const auto [rate, low] = Ends::sum_of_free(rods_);
    alignas(pack_alignment) Real inverse[Base::Z] = {};
    for (std::size_t j = 0; j < S; ++j) inverse[j] = columns_.h() == 0 ? Real(0) : Real(1 / columns_.hb(j));
    wanted_ = end_->wanted(time, columns_.h(), Ends::gap(rods_, end_place(time)), rate, L::load(inverse));
    for (std::size_t k = 0; k < D; ++k) wanted_[k] = wanted_[k] - L(low[k]);
    wanted_[D - 1] = fma(columns_.hc(), L(this->gravity_), wanted_[D - 1]);
    // Where weight and tension balance, corrections are the rounding of these, however little moves; unless the step
    // is too long for the fastest swing, by which small ones grow.
    constexpr Real share = 1e-4;  // the square of what, times last bits, is their rounding for 1,000 links
    const Real h_squared = columns_.h() * columns_.h();
    if (h_squared * this->fastest_swing_ <= 1) {
      this->scale_ = std::max(this->scale_, share * fall_squared_ * h_squared * h_squared);
    }
  }

  // ChainMotion::iterate.
  template <class Visit>
  PENDULA_IN_REGISTERS [[gnu::noinline]] Real iterate_held(Visit visit) {
    return sweep_inward(sweep_outward(), visit);
  }

  // Moves the state to the end of the step that was finished.
  void move_held() {
    Base::move(Everyone{});
    Ends::push(rods_, end_->together(push_));
    const auto [push, left] = Ends::push_to_rate(rods_, constants_, end_rate(end_time()));
    last_push_ = push;
    left_rate_ = left;
  }

  // After the last.
  void note_held() {
    start_time_ = end_time();
    errors_ = {largest(Ends::gap(rods_, end_place(start_time_))), largest(left_rate_)};
  }

  double brought_by_held() {
    double work = end_->work(push_, start_time_, columns_.h());
    room_ = rods_.place();
    move_held();
    rods_.place() = room_;
    const Numbers rate = end_rate(end_time());
    return (work + dot(last_push_, rate)) * constants_[links() - 1].mass;
  }

  // ChainMotion::tempo.
  void tempo_held(Real& pace, Real& quickening) const {
    Real sum(0), growth(0);
    const auto fallen = [&](int i) {
      Numbers weight{};
      if (i == 0) weight[D - 1] = -this->gravity_;
      return weight;
    };
    const Numbers wanted = components<D>([&](std::size_t k) { return Real(end_->end().acceleration(k, start_time_)); });
    Ends::accelerations(rods_, constants_, fallen, wanted,
                        [&](int i, const Numbers& rate, const Numbers& acceleration) {
                          this->add_to_tempo(i, rate, acceleration, sum, growth);
                        });
    this->tempo_of(sum, growth, pace, quickening);
  }

  struct Placed {
    Vector rod, pull;  // X, and the integral of the pull up to each stage
    L known;           // X·z
  };

  [[gnu::always_inline]] Placed placed(int i) {
    auto& stage = stages_[i];
    Placed placed;
    placed.known = L(rods_.product(i));
    Vector advance;
    for (std::size_t k = 0; k < D; ++k) {
      const L z(rods_.free(i)[k]);
      const L moved = columns_.integral(stage.U[k].numbers(), L(rods_.along_low(i)[k]));
      const L far = fma(columns_.hc(), z, fma(columns_.hc_low(), z, moved));
      placed.rod[k] = L(rods_.along(i)[k]) + far;
      placed.known = fma(far, z, placed.known);
      stage.rod[k].set(0, placed.rod[k]);
      advance[k] = fma(columns_.hb(), z, stage.U[k][0]);
      placed.pull[k] = stage.tau[0] * advance[k];
    }
    if (this->pulls_more_) {
      placed.pull = sum(placed.pull, this->more_pull(i, 0, columns_.hb(), placed.rod, advance));
    }
    for (std::size_t k = 0; k < D; ++k) placed.pull[k] = columns_.integral(placed.pull[k]);
    return placed;
  }

  // From the pivot to the last bob: finds Z − z of every link, and eliminates multipliers; then the push of the hook,
  // by which the rates of all rods sum up to what is wanted. Returns the last multiplier.
  [[gnu::always_inline]] L sweep_outward() {
    const int last = links() - 1;
    Placed here = placed(0);
    Vector bond_before, rod_before;
    bond_before.fill(L(0.0));
    L inverse(0.0), right(0.0);
    for (int i = 0;; ++i) {
      const L inverse_mass(constants_[i].inverse_mass.value);
      Placed next = here;
      Vector bond = scaled(-inverse_mass, here.pull);
      if (i < last) {
        next = placed(i + 1);
        for (std::size_t k = 0; k < D; ++k) bond[k] = inverse_mass * (next.pull[k] - here.pull[k]);
      }
      Vector freed =
          components<D>([&](std::size_t k) { return L(L(rods_.free_low(i)[k]) + (bond[k] - bond_before[k])); });
      L square = L(constants_[i].inverse_masses) * dot(here.rod, here.rod);
      if (i == 0) {
        freed[D - 1] = fma(-columns_.hc(), L(this->gravity_), freed[D - 1]);
        right = -(here.known + dot(here.rod, freed));
      } else {
        const L beyond = L(-constants_[i - 1].inverse_mass.value) * dot(rod_before, here.rod);
        const L coupling = beyond * inverse;
        this->kept_[i - 1].coupling[0].set(0, coupling);
        square = fma(-beyond, coupling, square);
        right = fma(-coupling, right, -(here.known + dot(here.rod, freed)));
      }
      inverse = L(1.0) / square;
      L offset = right * inverse;
      if (i == last) {
        const detail::EndMobility<L, D> mobility{here.rod, inverse_mass * inverse};
        push_ = mobility.inverse(components<D>(
            [&](std::size_t k) { return L(wanted_[k] - inverse_mass * fma(offset, here.rod[k], -here.pull[k])); }));
        freed = sum(freed, push_);
        offset = fma(-inverse, dot(here.rod, push_), offset);
      }
      for (std::size_t k = 0; k < D; ++k) this->kept_[i].freed[0][k].set(0, freed[k]);
      this->kept_[i].offset[0].set(0, offset);
      if (i == last) return offset;
      bond_before = bond;
      rod_before = here.rod;
      here = next;
    }
  }

  // From the last bob to the pivot: finds the multipliers, and the increments that follow from them.
  template <class Visit>
  [[gnu::always_inline]] Real sweep_inward(L tau, Visit& visit) {
    L change(0.0);
    const int last = links() - 1;
    Vector rod = this->rod(last, 0);
    Vector bond = scaled(L(constants_[last].inverse_mass.value) * tau, rod);
    for (int i = last; i >= 0; --i) {
      auto& stage = stages_[i];
      stage.tau.set(0, tau);
      Vector bond_before;
      bond_before.fill(L(0.0));
      if (i > 0) {
        const L tau_before = fma(-this->kept_[i - 1].coupling[0][0], tau, this->kept_[i - 1].offset[0][0]);
        const L inverse_mass(constants_[i - 1].inverse_mass.value);
        const Vector rod_before = this->rod(i - 1, 0);
        for (std::size_t k = 0; k < D; ++k) {
          bond_before[k] = inverse_mass * fma(tau_before, rod_before[k], -(tau * rod[k]));
        }
        tau = tau_before;
        rod = rod_before;
      }
      L changed(0.0);
      for (std::size_t k = 0; k < D; ++k) {
        const L U = columns_.hb() * (this->kept_[i].freed[0][k][0] + (bond[k] - bond_before[k]));
        const L differs = U - stage.U[k][0];
        changed = fma(differs, differs, changed);
        stage.U[k].set(0, U);
      }
      visit(i, changed);
      change = fma(changed, L(constants_[i].inverse_square), change);
      bond = bond_before;
    }
    return Base::Layout::total(change);
  }

  double end_time() const { return start_time_ + columns_.h(); }
  Numbers end_place(double time) const {
    return components<D>([&](std::size_t k) { return Real(end_->end().place(k, time)); });
  }
  Numbers end_rate(double time) const {
    return components<D>([&](std::size_t k) { return Real(end_->end().rate(k, time)); });
  }
  static double largest(const Numbers& x) {
    double most = 0;
    for (const Real& each : x) most = std::fmax(most, std::abs(static_cast<double>(each)));
    return most;
  }

  struct Nothing {};
  std::conditional_t<may_be_held, std::optional<HeldEnd<D, S>>, Nothing> end_;
  double start_time_ = 0;  // of the step
  Real fall_squared_{};    // Σ (g/l)²  [1/s^4]
  Vector wanted_{},
      push_{};  // at the stages: what increments over h b sum up to besides gravity; what the hook adds to z
  Numbers last_push_{}, left_rate_{};
  std::pair<double, double> errors_;
  typename Base::Rods::FullState room_;
};

}  // namespace pendula
