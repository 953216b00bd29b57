#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain.hpp>
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

/// Rods and stages of a chain that moves by Gauss steps, of one motion (StagesInLanes) or of several members
/// (MembersInLanes): what both share, which is all but angles and what one motion alone can do.
///
/// The field on rods ξ and free rates z (rod_state.hpp) is
///   ξ̇_i = z_i + e_i − e_{i−1},           e_i = (τ_i ξ_i − τ_{i+1} ξ_{i+1})/m_i,      e_0 = 0,
///   ż_i = d_i − d_{i−1} − δ_{i1} g up,    d_i = −(τ_i ξ̇_i − τ_{i+1} ξ̇_{i+1})/m_i,    d_0 = 0,
/// where damping and torque join τ_i ξ̇_i as (λ_i ξ̇_i − torque_i × ξ_i)/l_i². Every Gauss method keeps |ξ_i|² and the
/// vertical angular momentum, which are quadratic, and is symplectic: there is no pole and no drift (docs/method.md).
///
/// Stages are held as increments U = h b (ξ̇ − z) and W = h b (ż + δ_{i1} g up), so that what is large enters exactly:
///   X = ξ + h c z + m U,  Z = z − δ_{i1} h c g up + m W,  m_ij = a_ij/b_j.
///
/// Multipliers grow through a step as tension does, and where they grow too far the stage equations fold: with two
/// stages at h ω = √12, ω what the chain swings with. Of a step so long, M |g|/l ξ joins τ ξ̇: that is of H the term
/// Σ M |g|/l (|ξ|² − l²)/2, which is zero on the motion, and of a chain at rest nothing is left for τ. Then any
/// swinging goes through any step, as it does in angles.
template <class SpaceType, class LayoutType, int N = Eigen::Dynamic>
class ChainMotion {
 public:
  using Space = SpaceType;
  using Layout = LayoutType;
  using Num = typename Layout::Num;
  using C = ConstantOf<Num>;
  using Mask = MaskOf<Num>;
  using Columns = typename Layout::Columns;
  using Cell = typename Layout::Cell;
  using Row = typename Layout::Row;
  using Rods = RodState<Space, N, Num>;
  static constexpr std::size_t D = Space::dimension;
  static constexpr int stages = Layout::stages, links_known = N;
  using Point = std::array<Num, D>;

  explicit ChainMotion(int links, Family family = Family::gauss)
      : links_(links),
        columns_(family),
        rods_(links),
        constants_(links),
        stages_(links),
        pasts_(links),
        moved_(links),
        total_pull_(links),
        torques_(0),
        kept_(is_short && is_batch<Num> ? 1 : links),
        pulled_(places_on_the_way ? 1 : links) {}

  int links() const {
    if constexpr (N == Eigen::Dynamic) return links_;
    return N;
  }
  const Columns& columns() const { return columns_; }
  const Rods& rods() const { return rods_; }
  const LinkConstants<C>& constants(int i) const { return constants_[i]; }
  C h() const { return columns_.h(); }

  /// Size of the step, squared: Σ over stages and links of (h b ω)², with a share of the tangent's.
  const C& scale() const { return scale_; }

  /// The most that a link turns in the step that is finished, squared; never less, hardly more  [rad²].
  C turn_squared() const { return C(double(stages)) * turn_; }

  /// One fixed-point iteration of those that are `active`, the stages of the others stay; what changed, squared, to be
  /// compared with `scale`. visit(i, change of link i).
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

  /// Of the state: R² = κ + (Σ ω_i⁸)^(1/4), ω_i what rod i turns with and κ what gravity moves a long chain by; and
  /// d ln R/dt. Loads have no part in how R grows: only steps that are symmetric ask for that.
  PENDULA_IN_REGISTERS void tempo(C& pace, C& quickening) const {
    C sum(0.0), growth(0.0);
    rods_.for_each_acceleration(constants_, gravity_, [&](int i, const Point& rates, const Point& accelerations) {
      const auto &rate = detail::values_of(rates), &acceleration = detail::values_of(accelerations);
      const C& inverse_square = constants_[i].inverse_square;
      const C squared = dot(rate, rate) * inverse_square;
      const C sixth = squared * squared * squared;
      sum = fma(sixth, squared, sum);
      growth = fma(sixth, dot(rate, acceleration) * inverse_square, growth);
    });
    const C root = sqrt(sqrt(sum)), squared = slowest_pace_ + root;
    pace = sqrt(squared);
    quickening = select(sum > C(0.0), growth / (root * root * root * squared), C(0.0));
  }

 protected:
  struct Stage {
    std::array<Row, D> U{};  // h b (ξ̇ − z)
    Row tau{};
    std::array<Row, D> rod{};  // X, as the last iteration placed it
  };
  // What steps are predicted from.
  struct Past {
    std::array<Row, D> advance{};  // h ξ̇
    Row tau{};
  };
  struct Pulled {
    std::array<Row, D> pull;  // what the pull of the rod adds up to
    Row known;                // X·z
  };
  // What a sweep keeps on its way in for its way out, of one link at some cells.
  template <int Count>
  struct Kept {
    std::array<std::array<typename Layout::Slot, D>, static_cast<std::size_t>(Count)> freed;  // Z − z
    std::array<typename Layout::Slot, static_cast<std::size_t>(Count)> offset, coupling;      // MultiplierRow
  };
  static constexpr auto pasts = static_cast<std::size_t>(Columns::most_depth);
  using Torques = std::array<Row, static_cast<std::size_t>(Space::torque_components)>;

  static Point zero() {
    return components<D>([](std::size_t) { return Num(0.0); });
  }

  /// Whether a step of h resolves how fast a chain can swing, at rest ω² by Gershgorin: up to (h ω)² = 4.
  auto resolves(const C& h) const { return h * h * fastest_swing_ <= C(4.0); }

  /// Predicts the stages of a step of `h`, `ratio` times as long as the one that they are known from. Torques are set.
  void predict(const C& h, const C& ratio, const StagePrediction<C>& kind) {
    columns_.prepare(h);
    const C hung = hangs_;
    hangs_ = select(resolves(h), C(0.0), C(1.0));
    const Mask hangs = hangs_ > C(0.0), differs = !(hangs_ == hung), cold = kind.cold | differs;
    pulls_more_ = has_loads() || any(hangs);
    if (is_batch<Num> || !all(cold)) {  // to the last bit, a member's step does not depend on its neighbours
      columns_.predict_at(select(kind.again, C(0.0), C(1.0)), ratio, kind.depth);
      known_ = pasts - 1;
      if constexpr (!is_batch<Num>) known_ = std::min(known_, static_cast<std::size_t>(kind.known));
      predict(kind.follows & !differs);
    }
    scale_ = scale_ * (ratio * ratio);
    if (any(cold)) start_cold(cold);
    newest_ = (newest_ + pasts - 1) % pasts;
  }

  /// Stages of a motion that goes on as at the start of the step.
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
    scale_ = select(cold, scale * (h() * h()), scale_);
  }

  /// Sums up what the stages add to the state, which stays.
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
      rods_.advance(begin, h(), accepted, moved_[begin], pushed);
    });
    rods_.fall(h(), gravity_, accepted);
  }

  /// What pulls a rod at a cell beside its multiplier, h b times: damping and torques, and in a step that does not
  /// resolve how fast a chain can swing the tension of one that hangs at rest.
  template <class Weight>
  [[gnu::always_inline]] std::array<Cell, D> more_pull(int i, int j, const Weight& hb, const std::array<Cell, D>& rod,
                                                       const std::array<Cell, D>& advance) const {
    const auto tension = hb * spread(hangs_ * constants_[i].hanging);
    std::array<Cell, D> pull;
    if (has_loads()) {
      pull = load_pull(i, j, rod, advance);
      for (std::size_t k = 0; k < D; ++k) pull[k] = fma(tension, rod[k], pull[k]);
    } else {
      for (std::size_t k = 0; k < D; ++k) pull[k] = tension * rod[k];
    }
    return pull;
  }

  /// Energy that loads bring in the step that was solved  [J].
  C work() const {
    typename Layout::Sum work(C(0.0));
    const auto inverse_h = spread(select(h() == C(0.0), C(0.0), C(1.0) / h()));
    for (int i = 0; i < links(); ++i) {
      each_cell([&](auto j) {
        const std::array<Cell, D> moved = advance(i, j), pull = load_pull(i, j, rod(i, j), moved);
        for (std::size_t k = 0; k < D; ++k) {
          work = fma(-(inverse_h * columns_.inverse_weight(j)) * detail::value_of(pull[k]), detail::value_of(moved[k]),
                     work);
        }
      });
    }
    return Layout::total(work);
  }

  bool has_loads() const { return has_loads_; }
  /// Makes room for torques.
  void expect_loads() {
    if (std::exchange(has_loads_, true)) return;
    torques_ = detail::PerLink<Torques, N>(links());
  }

  /// h b ξ̇ of a link at a cell, and X.
  std::array<Cell, D> advance(int i, int j) const {
    return components<D>([&](std::size_t k) {
      return Cell(fma(columns_.at_hand().hb(j), spread(rods_.free(i)[k]), stages_[i].U[k][j]));
    });
  }
  std::array<Cell, D> rod(int i, int j) const {
    return components<D>([&](std::size_t k) { return Cell(stages_[i].rod[k][j]); });
  }

  template <class T>
  static decltype(auto) spread(const T& x) {
    return Layout::spread(x);
  }
  template <class Body>
  [[gnu::always_inline]] static void each_cell(Body body) {
    detail::unrolled<Layout::cells>(body);
  }

  int links_;
  Columns columns_;
  C gravity_{0.0}, slowest_pace_{1.0};  // the square of the slowest R
  C fastest_swing_{0.0}, hangs_{0.0};   // ω² at rest; 1 where the step does not resolve it
  C scale_{0.0}, turn_{0.0}, quartic_{0.0};
  bool pulls_more_ = false, has_loads_ = false;
  std::size_t newest_ = 0;  // of the pasts: the last step's
  std::size_t known_ = 0;   // of the pasts: what the next step may be predicted from, beside this one
  Rods rods_;
  detail::PerLink<LinkConstants<C>, N> constants_;
  detail::PerLink<Stage, N> stages_;
  detail::PerLink<std::array<Past, pasts>, N> pasts_;
  typename Rods::template Numbers<Num> moved_, total_pull_;  // over the step
  detail::PerLink<Torques, N> torques_;                      // h b times these, over l²
  static constexpr bool is_short = detail::is_short_chain<N>;
  detail::PerLink<Kept<Layout::together>, is_short && is_batch<Num> ? 1 : N> kept_;

 private:
  friend class ChainIteration<ChainMotion>;

  static constexpr bool has_tangent = !std::is_same_v<Num, C>;
  // A cell is the whole row: a rod is placed where the sweep comes to it, and stays in registers.
  static constexpr bool places_on_the_way = Layout::cells == 1;

  // Members keep what they have where they are not asked for.
  static void set(Row& row, int j, const Mask& which, const Cell& value) {
    if constexpr (is_batch<Num>) {
      row.set(j, select(which, value, Cell(row[j])));
    } else if (which) {
      row.set(j, value);
    }
  }

  // What a motion was predicted from is not weighed any more; but zero times what is not finite would not be zero.
  static void forget(std::array<Past, pasts>& past, const Mask& cold) {
    for (Past& step : past) {
      each_cell([&](auto j) {
        for (Row& row : step.advance) set(row, j, cold, Cell(C(0.0)));
        set(step.tau, j, cold, Cell(C(0.0)));
      });
    }
  }

  // --- Prediction ---

  // Mean multipliers go into the free rates: what is left of them at the stages is as often positive as negative, and
  // so is what it is rounded by.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void predict(const Mask& follows) {
    rods_.shift_gauge([&](int i) { return predict_multipliers(i, follows); }, [&](int i) { predict_increments(i); });
  }

  template <class Of>
  typename Columns::History history(int i, Of of) const {
    typename Columns::History history;
    for (std::size_t d = 0; d < pasts; ++d) history[d] = of(pasts_[i][(newest_ + d) % pasts]);
    return history;
  }

  // Those of the stages, less their mean, which is given.
  [[gnu::always_inline]] Num predict_multipliers(int i, const Mask& follows) {
    Row& tau = stages_[i].tau;
    columns_.extrapolate(history(i, [](const Past& past) { return &past.tau; }), tau, false);
    const Num lambda = select(follows, columns_.mean(tau), Num(0.0));
    const auto shift = [&](Row& row) PENDULA_WRITTEN_OUT {
      each_cell([&](auto j) PENDULA_WRITTEN_OUT { row.set(j, row[j] - spread(lambda)); });
    };
    shift(tau);
    for (std::size_t d = 0; d < known_; ++d) shift(pasts_[i][(newest_ + d) % pasts].tau);  // the next step's, too
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

  [[gnu::always_inline]] std::array<Cell, D> load_pull(int i, int j, const std::array<Cell, D>& rod,
                                                       const std::array<Cell, D>& advance) const {
    typename Space::Link::template Torque<Cell> torque;
    for (std::size_t k = 0; k < torque.size(); ++k) torque[k] = torques_[i][k][j];
    std::array<Cell, D> turning;
    Space::Link::torque_load(torque, rod, turning);
    const auto& drag = spread(constants_[i].drag);
    return components<D>([&](std::size_t k) { return Cell(drag * advance[k] - turning[k]); });
  }

  std::array<Row, D> more_pull(int i) const {
    std::array<Row, D> pull;
    each_cell([&](auto j) PENDULA_WRITTEN_OUT {
      const std::array<Cell, D> at_cell = more_pull(i, j, columns_.at_hand().hb(j), rod(i, j), advance(i, j));
      for (std::size_t k = 0; k < D; ++k) pull[k].set(j, at_cell[k]);
    });
    return pull;
  }

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

  // At each member's own stages, however long those of others took.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void add_more_to_totals() {
    ChainIteration<ChainMotion> iteration(*this);
    for (int i = 0; i < links(); ++i) {
      iteration.place(i);
      const std::array<Row, D> more = more_pull(i);
      for (std::size_t k = 0; k < D; ++k) total_pull_[i][k] = total_pull_[i][k] + Columns::total(more[k]);
    }
  }

  // --- The end of a step ---

  // What the rates of a block of bobs gain by what their rods pull; GCC heeds __restrict of parameters only.
  static void push(const C* __restrict inverse_mass, const Num* __restrict pulled, Num* __restrict bond,
                   Num* __restrict pushed) {
    Rods::for_numbers([&](auto k) PENDULA_WRITTEN_OUT { bond[k + D] = inverse_mass[k] * (pulled[k + D] - pulled[k]); });
    Rods::for_numbers([&](auto k) PENDULA_WRITTEN_OUT { pushed[k] = bond[k + D] - bond[k]; });
  }

  // (h ω)⁸ of a link in the middle of the step.
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
