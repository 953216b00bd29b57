#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_forces.hpp>
#include <pendula/chain/chain_iteration.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/rod_state.hpp>
#include <pendula/gauss/stage_prediction.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/written_out.hpp>
#include <type_traits>
#include <utility>

namespace pendula {

/// A chain that moves by Gauss steps, of one motion (StagesInLanes) or of several members (MembersInLanes): prediction
/// and iteration of the stages, and the end of the step, all in rods, without angles.
///
/// The field on rods ξ and free rates z (rod_state.hpp) is
///   ξ̇_i = z_i + e_i − e_{i−1},           e_i = (τ_i ξ_i − τ_{i+1} ξ_{i+1})/m_i,      e_0 = 0,
///   ż_i = d_i − d_{i−1} − δ_{i1} g up,    d_i = −(τ_i ξ̇_i − τ_{i+1} ξ̇_{i+1})/m_i,    d_0 = 0,
/// and what ChainForces adds. Every Gauss method conserves |ξ_i|² and the vertical angular momentum, which are
/// quadratic, and is symplectic: there is no pole and no drift (docs/explanation/method.md).
///
/// Stages are held as increments U = h b (ξ̇ − z) and W = h b (ż + δ_{i1} g up), so that the large terms are exact:
///   X = ξ + h c z + m U,  Z = z − δ_{i1} h c g up + m W,  m_ij = a_ij/b_j.
template <class SpaceType, class LayoutType, int N = Eigen::Dynamic>
class ChainMotion : public ChainForces<SpaceType, LayoutType, N> {
  using Base = ChainForces<SpaceType, LayoutType, N>;

 public:
  using Space = SpaceType;
  using Layout = LayoutType;
  using Mask = MaskOf<typename Layout::Num>;
  using Base::D, Base::links;
  using typename Base::C, typename Base::Cell, typename Base::Columns, typename Base::Num, typename Base::Point,
      typename Base::Rods, typename Base::Row;
  static constexpr int stages = Layout::stages, links_known = N;

  explicit ChainMotion(int count, Family family = Family::gauss)
      : Base(count, family),
        pasts_(count),
        moved_(count),
        total_pull_(count),
        kept_(is_short && is_batch<Num> ? 1 : count),
        pulled_(places_on_the_way ? 1 : count) {}

  /// Squared size of the step: Σ (h b ω)² over stages and links, and that of the tangent with its weight (add_square).
  const C& scale() const { return scale_; }

  /// A close upper bound of the largest turn of a link in the finished step, squared  [rad²].
  C turn_squared() const { return C(double(stages)) * turn_; }

  /// One fixed-point iteration of those that are `active`. Returns the square of what changed; compare with `scale`.
  /// Calls visit(i, squared change of link i).
  template <class Who, class Visit>
  PENDULA_IN_REGISTERS [[gnu::noinline]] C iterate(const Who& active, Visit visit) {
    return ChainIteration<ChainMotion>(*this).iterate(active, visit);
  }

  /// T + U  [J].
  C energy() const {
    C energy(0.0);
    Point bob = zero();
    rods_.for_each_rate(constants_, [&](int i, const Point& rate, const Num&) {
      bob = sum(bob, rate);
      const auto& values = detail::values_of(bob);
      energy = fma(C(0.5) * constants_[i].mass, dot(values, values), energy);
      energy = fma(constants_[i].weight, detail::value_of(rods_.along(i)[D - 1]), energy);
    });
    return energy;
  }

  /// R of the state, and d ln R/dt: R² = κ + (Σ ω_i⁸)^(1/4), where rod i turns with ω_i, and √κ is the pace of a long
  /// chain that gravity alone moves. d ln R/dt leaves loads out: only symmetric steps use it.
  PENDULA_IN_REGISTERS void tempo(C& pace, C& quickening) const {
    C sum(0.0), growth(0.0);
    rods_.for_each_acceleration(constants_, gravity_, [&](int i, const Point& rates, const Point& accelerations) {
      add_to_tempo(i, rates, accelerations, sum, growth);
    });
    tempo_of(sum, growth, pace, quickening);
  }

 protected:
  // What a link adds to the sums of tempo(), and what follows from them.
  [[gnu::always_inline]] void add_to_tempo(int i, const Point& rates, const Point& accelerations, C& sum,
                                           C& growth) const {
    const auto &rate = detail::values_of(rates), &acceleration = detail::values_of(accelerations);
    const C& inverse_square = constants_[i].inverse_square;
    const C squared = dot(rate, rate) * inverse_square;
    const C sixth = squared * squared * squared;
    sum = fma(sixth, squared, sum);
    growth = fma(sixth, dot(rate, acceleration) * inverse_square, growth);
  }
  void tempo_of(const C& sum, const C& growth, C& pace, C& quickening) const {
    const C root = sqrt(sqrt(sum)), squared = slowest_pace_ + root;
    pace = sqrt(squared);
    quickening = select(sum > C(0.0), growth / (root * root * root * squared), C(0.0));
  }

  using typename Base::Stage;
  // Stage values of a step, for predictions of later steps.
  struct Past {
    std::array<Row, D> advance{};  // h ξ̇
    Row tau{};
  };
  struct Pulled {
    std::array<Row, D> pull;  // integral of the pull of the rod up to each stage
    Row known;                // X·z
  };
  // Numbers of one link at some cells that the sweep inward keeps for the sweep outward.
  template <int Count>
  struct Elimination {
    std::array<std::array<typename Layout::Slot, D>, static_cast<std::size_t>(Count)> freed;  // Z − z
    std::array<typename Layout::Slot, static_cast<std::size_t>(Count)> offset, coupling;      // MultiplierRow
  };
  static constexpr auto pasts = static_cast<std::size_t>(Columns::most_depth);
  /// Predicts the stages of a step of `h`, `ratio` times as long as the one that they are predicted from. Torques have
  /// to be set before.
  void predict(const C& h, const C& ratio, const StagePrediction<C>& kind) {
    columns_.prepare(h);
    const C hung = hangs_;
    hangs_ = select(resolves(h), C(0.0), C(1.0));
    const Mask hangs = hangs_ > C(0.0), differs = !(hangs_ == hung), cold = kind.cold | differs;
    pulls_more_ = has_loads() || any(hangs);
    if (is_batch<Num> || !all(cold)) {  // members never skip it: their bits must not depend on other lanes
      columns_.predict_at(select(kind.again, C(0.0), C(1.0)), ratio, kind.depth);
      known_ = pasts - 1;
      if constexpr (!is_batch<Num>) known_ = std::min(known_, static_cast<std::size_t>(kind.known));
      predict(kind.follows & !differs);
    }
    scale_ = scale_ * (ratio * ratio);
    if (any(cold)) start_cold(cold);
    newest_ = (newest_ + pasts - 1) % pasts;
  }

  /// Predicts constant rates from those at the start of the step.
  void start_cold(const Mask& cold) {
    C scale(0.0);
    const auto& columns = columns_.at_hand();
    if constexpr (is_batch<Num>) {
      for (int i = 0; i < links(); ++i) forget(pasts_[i], cold);
    }
    rods_.for_each_rate(constants_, [&](int i, const Point& rate, const Num& tau) {
      Stage& stage = stages_[i];
      C squared(0.0);
      for (std::size_t k = 0; k < D; ++k) {
        const Num beside = rate[k] - rods_.free(i)[k];
        each_cell([&](auto j) { set(stage.U[k], j, cold, Cell(columns.hb(j) * spread(beside))); });
        squared = add_square(rate[k], squared);
      }
      each_cell([&](auto j) { set(stage.tau, j, cold, Cell(spread(tau))); });
      scale = fma(squared, constants_[i].inverse_square, scale);
    });
    rods_.find_products(cold);
    scale_ = select(cold, scale * (columns_.h() * columns_.h()), scale_);
  }

  /// Computes what the stages add to the state, which does not change yet.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void finish() {
    const auto& columns = columns_.at_hand();
    typename Layout::Sum turn(C(0.0)), scale(C(0.0));
    C quartic(0.0);
    for (int i = 0; i < links(); ++i) {
      const Stage& stage = stages_[i];
      Past& past = pasts_[i][newest_];
      typename Layout::Sum squares(C(0.0)), weighed(C(0.0));
      detail::unrolled<static_cast<int>(D)>([&](auto component) PENDULA_WRITTEN_OUT {
        constexpr std::size_t k = component;
        Row pull;
        each_cell([&](auto j) PENDULA_WRITTEN_OUT {
          const Cell advance = fma(columns.hb(j), spread(rods_.free(i)[k]), stage.U[k][j]);
          past.advance[k].set(j, columns_.inverse_weight(j) * advance);
          pull.set(j, stage.tau[j] * advance);
          squares = fma(detail::value_of(advance), detail::value_of(advance), squares);
          if constexpr (has_tangent) weighed = add_square(advance, weighed);
        });
        moved_[i][k] = Columns::total(stage.U[k]);
        total_pull_[i][k] = Columns::total(pull);
      });
      past.tau = stage.tau;
      const auto& inverse_square = spread(constants_[i].inverse_square);
      squares = squares * inverse_square;
      turn = max(turn, squares);
      scale = scale + (has_tangent ? weighed * inverse_square : squares);
      if constexpr (is_batch<Num>) quartic = quartic + pace_to_the_eighth(i);
    }
    turn_ = Layout::total(turn);
    scale_ = Layout::total(scale);
    quartic_ = quartic;
    if (pulls_more_) add_more_to_totals();
  }

  /// Moves those that are `accepted` to the end of the step that was finished.
  template <class Who>
  PENDULA_IN_REGISTERS [[gnu::noinline]] void move(const Who& accepted) {
    static constexpr std::size_t size = Rods::block_size;
    alignas(pack_alignment) Num bond[size + D], pushed[size];
    std::fill_n(bond + size, D, Num(0.0));
    rods_.for_blocks([&](int begin) PENDULA_WRITTEN_OUT {
      std::copy_n(bond + size, D, bond);
      push(rods_.inverse_mass(begin), total_pull_[begin], bond, pushed);
      rods_.advance(begin, columns_.h(), accepted, moved_[begin], pushed);
    });
    rods_.fall(columns_.h(), gravity_, accepted);
  }

  using Base::columns_, Base::constants_, Base::each_cell, Base::fastest_swing_, Base::hangs_, Base::has_loads,
      Base::more_pull, Base::resolves, Base::rods_, Base::spread, Base::stages_, Base::zero;

  C gravity_{0.0}, slowest_pace_{1.0};  // the square of the slowest R
  C scale_{0.0}, turn_{0.0}, quartic_{0.0};
  bool pulls_more_ = false;
  std::size_t newest_ = 0;  // index of the last step in the pasts
  std::size_t known_ = 0;   // number of pasts that the step after this one may be predicted from, besides this one
  detail::PerLink<std::array<Past, pasts>, N> pasts_;
  typename Rods::template Numbers<Num> moved_, total_pull_;  // over the step
  static constexpr bool is_short = detail::is_short_chain<N>;
  detail::PerLink<Elimination<Layout::together>, is_short && is_batch<Num> ? 1 : N> kept_;

 private:
  friend class ChainIteration<ChainMotion>;

  static constexpr bool has_tangent = !std::is_same_v<Num, C>;
  // A cell is the whole row: a rod is placed where the sweep comes to it, and stays in registers.
  static constexpr bool places_on_the_way = Layout::cells == 1;

  // Writes a cell where `which` is true.
  static void set(Row& row, int j, const Mask& which, const Cell& value) {
    if constexpr (is_batch<Num>) {
      row.set(j, select(which, value, Cell(row[j])));
    } else if (which) {
      row.set(j, value);
    }
  }

  // Clears the past of members that start cold. Its weights are zero, but zero times a number that is not finite is not
  // zero.
  static void forget(std::array<Past, pasts>& past, const Mask& cold) {
    for (Past& step : past) {
      each_cell([&](auto j) {
        for (Row& row : step.advance) set(row, j, cold, Cell(C(0.0)));
        set(step.tau, j, cold, Cell(C(0.0)));
      });
    }
  }

  // --- Prediction ---

  // Changes the gauge by the mean multipliers. Those left at the stages have mean zero, so that rounding errors due to
  // them do not add up.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void predict(const Mask& follows) {
    rods_.shift_gauge([&](int i) { return predict_multipliers(i, follows); }, [&](int i) { predict_increments(i); });
  }

  template <class Of>
  typename Columns::History history(int i, Of of) const {
    typename Columns::History history;
    for (std::size_t d = 0; d < pasts; ++d) history[d] = of(pasts_[i][(newest_ + d) % pasts]);
    return history;
  }

  // Predicts the multipliers of a link, and subtracts their mean. Returns the mean.
  [[gnu::always_inline]] Num predict_multipliers(int i, const Mask& follows) {
    Row& tau = stages_[i].tau;
    columns_.extrapolate(history(i, [](const Past& past) { return &past.tau; }), tau, false);
    const Num lambda = select(follows, columns_.mean(tau), Num(0.0));
    const auto shift = [&](Row& row) PENDULA_WRITTEN_OUT {
      each_cell([&](auto j) PENDULA_WRITTEN_OUT { row.set(j, row[j] - spread(lambda)); });
    };
    shift(tau);
    for (std::size_t d = 0; d < known_; ++d) shift(pasts_[i][(newest_ + d) % pasts].tau);  // for later predictions
    return lambda;
  }

  [[gnu::always_inline]] void predict_increments(int i) {
    const auto& columns = columns_.at_hand();
    detail::unrolled<static_cast<int>(D)>([&](auto component) PENDULA_WRITTEN_OUT {
      constexpr std::size_t k = component;
      Row advance;
      columns_.extrapolate(history(i, [](const Past& past) { return &past.advance[k]; }), advance, true);
      each_cell([&](auto j) PENDULA_WRITTEN_OUT {
        stages_[i].U[k].set(j, fma(-columns.hb(j), spread(rods_.free(i)[k]), columns_.weight(j) * advance[j]));
      });
    });
  }

  // --- Loads ---

  PENDULA_IN_REGISTERS [[gnu::noinline]] void pull_more() {
    for (int i = 0; i < links(); ++i) {
      const std::array<Row, D> more = more_pull(i);
      for (std::size_t k = 0; k < D; ++k) {
        Row integral;
        columns_.at_hand().integrate(more[k], Num(0.0), integral);
        each_cell([&](auto j) PENDULA_WRITTEN_OUT { pulled_[i].pull[k].set(j, pulled_[i].pull[k][j] + integral[j]); });
      }
    }
  }

  // Adds the forces of loads to total_pull_. Rods are placed again first, at the last increments of each member.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void add_more_to_totals() {
    ChainIteration<ChainMotion> iteration(*this);
    for (int i = 0; i < links(); ++i) {
      iteration.place(i);
      const std::array<Row, D> more = more_pull(i);
      for (std::size_t k = 0; k < D; ++k) total_pull_[i][k] = total_pull_[i][k] + Columns::total(more[k]);
    }
  }

  // --- The end of a step ---

  // Computes what all pulls over the step add to the free rates of a block of rods. A function of its own, because GCC
  // heeds __restrict of parameters only.
  static void push(const C* __restrict inverse_mass, const Num* __restrict pulled, Num* __restrict bond,
                   Num* __restrict pushed) {
    Rods::for_numbers([&](auto k) PENDULA_WRITTEN_OUT { bond[k + D] = inverse_mass[k] * (pulled[k + D] - pulled[k]); });
    Rods::for_numbers([&](auto k) PENDULA_WRITTEN_OUT { pushed[k] = bond[k + D] - bond[k]; });
  }

  // (h ω)⁸ of a link in the middle of the step that was finished.
  C pace_to_the_eighth(int i) const {
    C squared(0.0);
    for (const Row& advance : pasts_[i][newest_].advance) {
      const C& half_way = detail::value_of(advance[stages / 2]);
      squared = fma(half_way, half_way, squared);
    }
    squared = squared * constants_[i].inverse_square;
    return (squared * squared) * (squared * squared);
  }

  detail::PerLink<Pulled, places_on_the_way ? 1 : N> pulled_;
};

}  // namespace pendula
