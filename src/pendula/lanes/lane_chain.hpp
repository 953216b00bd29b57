#pragma once

#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/lanes/lane_chain_tangent.hpp>
#include <pendula/lanes/lane_columns.hpp>
#include <pendula/lanes/lane_links.hpp>
#include <pendula/lanes/lane_pack.hpp>
#include <pendula/lanes/lane_prediction.hpp>
#include <pendula/lanes/lane_stage_loads.hpp>
#include <pendula/lanes/lane_stop.hpp>
#include <pendula/lanes/lane_tangent.hpp>
#include <type_traits>

namespace pendula {

/// The rods of several members of an ensemble of chains, one member in each lane, and the stages of a Gauss step of
/// theirs: equations, gauge and rounding are those of ChainStages and RodState (docs/method.md), the layout is not. All
/// stages of one number are S packs.
///
/// N may be Eigen::Dynamic. With a tangent, every number has its derivative along one tangent
/// of each member's motion: that of the step itself, which is solved with it.
template <class Space, int S, int N = Eigen::Dynamic, class Register = MemberRegister, bool with_tangent = false>
class LaneChain {
 public:
  using L = LanePack<Register>;
  using Mask = typename L::Mask;
  using SpaceType = Space;
  using Subject = int;
  using Stop = LaneStop<L>;
  using Number = std::conditional_t<with_tangent, Dual<L>, L>;
  static constexpr int stages = S, links_known = N;
  static constexpr bool has_tangent = with_tangent;
  static constexpr std::size_t D = Space::dimension;
  using Vector = std::array<L, D>;
  using Columns = LaneColumns<S, L>;

  explicit LaneChain(int links)
      : links_(links), constants_(links), rods_(links), stages_(links), rates_(links), kept_(links), loads_(links) {
    rest();
  }

  int links() const {
    if constexpr (N == Eigen::Dynamic) return links_;
    return N;
  }

  // --- One member ---

  /// A member comes into a lane, with its chain, at q and v  [rad, rad/s]; its next step starts cold.
  void start(int lane, double /*time*/, const Chain<Space, N>& given, const ChainLinks<Space, N, double>& chain,
             const double* q, const double* v) {
    const double gravity = given.gravity();
    gravity_.set(lane, gravity);
    loads_.take(lane, given, chain);
    double length = 0;
    for (int i = 0; i < links(); ++i) {
      constants_[i].set(lane, chain[i]);
      length += chain[i].length;
      std::array<Wide, Space::dof> angles, rates;
      for (std::size_t a = 0; a < angles.size(); ++a) {
        angles[a] = Wide(q[entry(i, a)]);
        rates[a] = Wide(v[entry(i, a)]);
      }
      place(lane, i, chain[i].length, Heading<Space, Wide>(angles, rates));
    }
    slowest_pace_.set(lane, 0.15 * links() * links() * std::abs(gravity) / length);
    fastest_swing_.set(lane, chain.fastest_swing_squared());
    restoring_.set(lane, 0);
    if constexpr (has_tangent) start_tangent(lane);
  }

  /// Direction of a member's link and its rate; `find_rates` was called since the last step.
  auto heading(int lane, int i) const {
    Heading<Space, Wide> heading;
    Wide squared(0);
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] = Wide(value(rods_[i].along[k])[lane]) + Wide(value(rods_[i].along_low[k])[lane]);
      squared += heading.u[k] * heading.u[k];
    }
    const Wide inverse = 1 / std::sqrt(squared);
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] *= inverse;
      heading.u_dot[k] = Wide(value(rates_[i][k])[lane]) * inverse;
    }
    return heading;
  }

  // --- All members ---

  decltype(auto) along(int i) const { return detail::values_of(rods_[i].along); }  ///< ξ_i  [m]
  const L& length(int i) const { return constants_[i].length; }
  const L& inverse_square(int i) const { return constants_[i].inverse_square; }

  /// Rates of all rods where they are; visit(i, ξ̇_i, τ_i).
  template <class Visit>
  void for_each_rate(Visit visit) {
    for_each_motion(
        [&](int i, const Point& rate, const Number& tau) { visit(i, detail::values_of(rate), value(tau)); });
  }

  void find_rates() {
    for_each_motion([&](int i, const Point& rate, const Number&) { rates_[i] = rate; });
  }

  /// T + U  [J].
  L energy() {
    L energy(0.0);
    Vector bob = detail::values_of(zero());
    for_each_rate([&](int i, const Vector& rate, const L&) {
      bob = sum(bob, rate);
      energy = fma(0.5 * constants_[i].mass, dot(bob, bob), energy);
      energy = fma(constants_[i].weight, along(i)[D - 1], energy);
    });
    return energy;
  }

  /// Who has damping, torques or drives.
  Mask loaded() const { return loads_.loaded(); }
  /// Whose fixed points may ask for shorter steps than errors do, by damping.
  Mask may_be_stiff() const { return loaded(); }
  L longest_step(double tolerance) const { return loads_.longest_step(tolerance); }

  /// What the energy at the end of the step that was solved is to be, by what loads bring  [J].
  L energy_due() {
    const L energy = this->energy();
    brought_ = loads_.any() ? work() : L(0.0);
    return energy + brought_;
  }

  /// What an energy that ought to be `due` is compared to: Σ M |g| l, what there is, and what loads brought.
  L energy_scale(const L& due) const {
    L scale(0.0);
    for (int i = 0; i < links(); ++i) scale = fma(abs(constants_[i].weight), constants_[i].length, scale);
    return scale + abs(due) + abs(brought_);
  }

  /// R and d ln R/dt, as ChainStages::tempo.
  PENDULA_IN_REGISTERS void tempo(L& pace, L& quickening) {
    find_rates();
    const auto fallen = [&](int i) { return i == 0 ? -gravity_ : L(0.0); };
    eliminate([&](int i) { return -(dot(rates_[i], rates_[i]) + rods_[i].along[D - 1] * fallen(i)); });
    L sum(0.0), growth(0.0);
    for_each_bond([&](int i, const Point& by_bonds, const Number&) {
      Vector change = detail::values_of(by_bonds);
      change[D - 1] = change[D - 1] + fallen(i);
      const Vector& rate = detail::values_of(rates_[i]);
      const L& inverse_square = constants_[i].inverse_square;
      const L squared = dot(rate, rate) * inverse_square;
      const L sixth = squared * squared * squared;
      sum = fma(sixth, squared, sum);
      growth = fma(sixth, dot(rate, change) * inverse_square, growth);
    });
    const L root = sqrt(sqrt(sum)), squared = slowest_pace_ + root;
    pace = sqrt(squared);
    quickening = select(sum > L(0.0), growth / (root * root * root * squared), L(0.0));
  }

  /// Predicts the stages of a step of `h`, `ratio` times as long as the one that they are known from.
  void prepare(const L& time, const L& h, const L& ratio, const LanePrediction<L>& kind) {
    columns_.prepare(h);
    if (loads_.any()) loads_.prepare(time, columns_, [this](int i) -> const LaneLink<L>& { return constants_[i]; });
    const L hung = hangs_;
    hangs_ = select(h * h * fastest_swing_ > L(4.0), L(1.0), L(0.0));
    pulls_more_ = loads_.any() || xsimd::any(hangs_ > L(0.0));
    const Mask differs = !(hangs_ == hung), cold = kind.cold | differs;
    columns_.predict_at(select(kind.again, L(0.0), L(1.0)), ratio, kind.depth);
    predict(kind.follows & !differs);
    scale_ = scale_ * (ratio * ratio);
    if (xsimd::any(cold)) start_cold(cold);
  }

  /// One fixed-point iteration for the members that are `active`, those of the others stay; what changed, squared,
  /// relative to the size of the step.
  PENDULA_IN_REGISTERS [[gnu::noinline]] L iterate(const Mask& active) {
    for_links([&](auto i) PENDULA_WRITTEN_OUT { place_stages(i); });
    if (pulls_more_) pull_more();
    L change(0.0);
    if constexpr (S > 1) {
      detail::unrolled<S / 2>([&](auto pair) PENDULA_WRITTEN_OUT { change = sweep<2 * pair, 2>(active, change); });
    }
    if constexpr (S % 2 == 1) change = sweep<S - 1, 1>(active, change);
    return change;
  }
  /// Size of the step, squared: Σ over stages and links of (h b ω)², with as much of the tangent's as `iterate` weighs.
  const L& scale() const { return scale_; }

  /// Sums up what the stages add to the state, which stays; after it `turn`, `pace`, `decay` and `accept`.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void finish() {
    turn_ = scale_ = quartic_ = L(0.0);
    newest_ = (newest_ + pasts - 1) % pasts;
    for (int i = 0; i < links(); ++i) {
      Work& work = stages_[i];
      Past& past = work.past[newest_];
      const Rod& rod = rods_[i];
      L squares(0.0), slopes(0.0), middle(0.0);
      detail::unrolled<static_cast<int>(D)>([&](auto k) PENDULA_WRITTEN_OUT {
        Stages pull;
        detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT {
          const Number advance = fma(columns_.hb(j), rod.free[k], work.U[k][j]);
          past.advance[k][j] = L(columns_.inverse_b(j)) * advance;
          pull[j] = work.tau[j] * advance;
          squares = fma(value(advance), value(advance), squares);
          if constexpr (has_tangent) slopes = fma(advance.slope, advance.slope, slopes);
        });
        const L& half_way = value(past.advance[k][S / 2]);
        middle = fma(half_way, half_way, middle);
        work.moved[k] = Columns::total(work.U[k]);
        work.pulled[k] = Columns::total(pull);
      });
      past.tau = work.tau;
      const L& inverse_square = constants_[i].inverse_square;
      squares = squares * inverse_square;
      middle = middle * inverse_square;
      turn_ = max(turn_, squares);
      if constexpr (has_tangent) squares = fma(solved_share * inverse_square, slopes, squares);
      scale_ = scale_ + squares;
      quartic_ = fma(middle * middle, middle * middle, quartic_);
    }
    if (pulls_more_) add_more_to_totals();
  }

  /// A rod at stage j of the step.
  Vector along(int i, int j) const {
    return components<D>([&](std::size_t k) { return value(stages_[i].rod[k][static_cast<std::size_t>(j)]); });
  }

  /// Rods of the members whose step was accepted, and their rates, when `share` of it was done, by the polynomial
  /// through its stages; visit(i, ξ, ξ̇).
  template <class Visit>
  void for_each_glance(double share, Visit visit) {
    const typename Columns::Shares& weights = columns_.shares(share);
    const L inverse_h = L(1.0) / columns_.h();
    for (int i = 0; i < links(); ++i) {
      Vector rod = along(i), rate = detail::values_of(zero());
      for (std::size_t k = 0; k < D; ++k) {
        const Stages& advance = stages_[i].past[newest_].advance[k];
        for (std::size_t j = 0; j < static_cast<std::size_t>(S); ++j) {
          rod[k] = fma(L(-weights.ahead[j]), value(advance[j]), rod[k]);
          rate[k] = fma(L(weights.values[j]), value(advance[j]), rate[k]);
        }
        rate[k] = rate[k] * inverse_h;
      }
      visit(i, rod, rate);
    }
  }

  /// Keeps where the rods are, and goes back there.
  void save() { saved_ = rods_; }
  void restore(const Mask& which) {
    for (int i = 0; i < links(); ++i) {
      Rod& rod = rods_[i];
      const Rod& was = saved_[i];
      for (auto part : {&Rod::along, &Rod::along_low, &Rod::free, &Rod::free_low}) {
        for (std::size_t k = 0; k < D; ++k) (rod.*part)[k] = select(which, (was.*part)[k], (rod.*part)[k]);
      }
    }
  }

  /// The most that a link turns in the step, squared; never less, hardly more  [rad²].
  L turn() const { return double(S) * turn_; }
  /// From where on stages are no motion  [rad].
  static constexpr double largest_turn(bool /*chosen*/) { return 3; }

  /// R in the middle of the step, squared, times h².
  L pace_squared() const { return fma(slowest_pace_, columns_.h() * columns_.h(), sqrt(sqrt(quartic_))); }

  /// The coefficient of the Legendre polynomial P_k in the rates, times h, relative to the length of the rod, squared;
  /// with a share of the tangent's: where the motion stands still, nothing else tells which steps are too long.
  PENDULA_IN_REGISTERS L decay(int k) const {
    L largest(0.0);
    for (int i = 0; i < links(); ++i) {
      L squared(0.0);
      for (std::size_t d = 0; d < D; ++d) {
        const Stages& advance = stages_[i].past[newest_].advance[d];
        const L a = columns_.legendre(k, detail::values_of(advance));
        squared = fma(a, a, squared);
        if constexpr (has_tangent) {
          const L slope = columns_.legendre(k, detail::slopes_of(advance));
          squared = fma(L(tangent_share * tangent_share) * slope, slope, squared);
        }
      }
      largest = max(largest, squared * constants_[i].inverse_square);
    }
    return largest;
  }

  /// Moves the members that are `accepted` to the end of the step; the others stay where they are.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void accept(const Mask& accepted) {
    const L h = columns_.h();
    Point before = zero();
    for (int i = 0; i < links(); ++i) {
      Point pull = stages_[i].pulled;
      if (i + 1 < links()) pull = difference(pull, stages_[i + 1].pulled);
      const Point bond = scaled(-constants_[i].inverse_mass.value, pull);
      Rod& rod = rods_[i];
      for (std::size_t k = 0; k < D; ++k) {
        move(h, stages_[i].moved[k], accepted, rod, k);
        push(bond[k] - before[k], i == 0 && k == D - 1, accepted, rod, k);
      }
      before = bond;
    }
    restoring_ = restoring_ + select(accepted, L(1.0), L(0.0));
    const Mask due = restoring_ == L(16.0);
    if (xsimd::any(due)) restore_lengths(due);
  }

  /// The logarithm of how long the tangents of these members have grown since they had the length 1, which they have
  /// again after this.
  L take_growth(const Mask& which) requires with_tangent {
    find_rates();
    L squared(0.0);
    for (int i = 0; i < links(); ++i) {
      const L along = slopes_squared(rods_[i].along), rate = slopes_squared(rates_[i]);
      squared = fma(constants_[i].inverse_square, fma(inverse_pace_squared_, rate, along), squared);
    }
    const L factor = select(which, L(1.0) / sqrt(squared), L(1.0));
    for (int i = 0; i < links(); ++i) scale_tangent(factor, i);
    return 0.5 * log(squared);
  }

 private:
  using Wide = long double;
  using Point = std::array<Number, D>;
  using Stages = typename Columns::template StagesOf<Number>;
  using History = typename Columns::template HistoryOf<Number>;

  struct Rod {
    Point along, along_low, free, free_low;  // ξ, z
    Number product;                          // ξ·z without their low parts
  };

  // Of a tangent's corrections, squared, beside those of the motion, which is solved to as many more digits.
  static constexpr double solved_share = 1e-12;

  static constexpr int depth = Columns::most_depth;
  static constexpr std::size_t pasts = static_cast<std::size_t>(depth);

  // What steps are predicted from.
  struct Past {
    std::array<Stages, D> advance;  // h ξ̇
    Stages tau;
  };

  struct Work {
    std::array<Stages, D> U;  // h b (ξ̇ − z)
    Stages tau;
    std::array<Past, pasts> past;  // newest_ is the last step's
    std::array<Stages, D> rod;     // X
    std::array<Stages, D> pull;    // what the pull of the rod adds up to
    Stages known;                  // X·z
    MultiplierRow<Number> row;     // where the rods are
    Point moved, pulled;           // over the step
  };

  static Point zero() {
    Point point;
    point.fill(Number(0.0));
    return point;
  }
  static const L& value(const Number& number) { return detail::value_of(number); }

  Eigen::Index entry(int i, std::size_t a) const { return static_cast<Eigen::Index>(a) * links() + i; }

  // Members that are not there hang at rest.
  void rest() {
    for (int i = 0; i < links(); ++i) {
      Rod& rod = rods_[i];
      for (auto* part : {&rod.along, &rod.along_low, &rod.free, &rod.free_low}) *part = zero();
      rod.along[D - 1] = Number(-1.0);
      rod.product = Number(0.0);
      Work& work = stages_[i];
      work.tau.fill(Number(0.0));
      for (auto& component : work.U) component.fill(Number(0.0));
      for (Past& past : work.past) {
        past.tau = work.tau;
        past.advance = work.U;
      }
      work.moved = work.pulled = rates_[i] = zero();
    }
  }

  void place(int lane, int i, double length, const Heading<Space, Wide>& heading) {
    Rod& rod = rods_[i];
    const auto set = [&](const Wide& x, Number& value, Number& low) {
      const auto rounded = static_cast<double>(x);
      detail::set_value(lane, rounded, value);
      detail::set_value(lane, static_cast<double>(x - Wide(rounded)), low);
    };
    for (std::size_t k = 0; k < D; ++k) {
      set(Wide(length) * heading.u[k], rod.along[k], rod.along_low[k]);
      set(Wide(length) * heading.u_dot[k], rod.free[k], rod.free_low[k]);
    }
  }

  // --- Tangents ---

  void start_tangent(int lane) {
    const auto numbers = [&](const Point& point) {
      return components<D>([&](std::size_t k) { return value(point[k])[lane]; });
    };
    const auto rod_of = [&](int i) {
      return MovingRod<D>{numbers(rods_[i].along), numbers(rods_[i].free), constants_[i].inverse_square[lane]};
    };
    const LaneChainTangent<Space> tangent(links(), slowest_pace_[lane], rod_of);
    inverse_pace_squared_.set(lane, tangent.inverse_pace_squared());
    for (int i = 0; i < links(); ++i) {
      for (std::size_t k = 0; k < D; ++k) {
        rods_[i].along[k].slope.set(lane, tangent.place(i)[k]);
        rods_[i].free[k].slope.set(lane, tangent.rate(i)[k]);
      }
    }
  }

  static L slopes_squared(const Point& point) {
    L squared(0.0);
    for (const Number& x : point) squared = fma(x.slope, x.slope, squared);
    return squared;
  }

  // Of the state, and of what the next step is predicted from.
  void scale_tangent(const L& factor, int i) {
    const auto scale = [&](auto& numbers) {
      for (Number& x : numbers) x.slope = factor * x.slope;
    };
    for (auto part : {&Rod::along, &Rod::along_low, &Rod::free, &Rod::free_low}) scale(rods_[i].*part);
    for (Past& past : stages_[i].past) {
      for (Stages& component : past.advance) scale(component);
      scale(past.tau);
    }
  }

  // --- The field ---

  static Number exact_dot(const Rod& rod) {
    return exact_dot_of_values(rod) + (dot(rod.along, rod.free_low) + dot(rod.along_low, rod.free));
  }
  static Number exact_dot_of_values(const Rod& rod) {
    const Twofold<Number> first = exact_product(rod.along[0], rod.free[0]);
    const Twofold<Number> next = exact_product(rod.along[1], rod.free[1]);
    Twofold<Number> total = exact_sum(first.value, next.value);
    total.low = total.low + (first.low + next.low);
    if constexpr (D == 3) {
      const Twofold<Number> last = exact_product(rod.along[2], rod.free[2]);
      const Twofold<Number> all = exact_sum(total.value, last.value);
      total = {all.value, total.low + (all.low + last.low)};
    }
    return total.value + total.low;
  }

  // Rows of the multipliers where the rods are, in the places of the first stage.
  template <class Right>
  void eliminate(Right right) {
    MultiplierRow<Number> row;
    Number beyond(0.0);
    for (int i = links(); i-- > 0;) {
      const Point& rod = rods_[i].along;
      const Number before = i == 0 ? Number(0.0) : -constants_[i - 1].inverse_mass.value * dot(rods_[i - 1].along, rod);
      row = row.next(constants_[i].inverse_masses * dot(rod, rod), beyond, before, right(i));
      stages_[i].row = row;
      beyond = before;
    }
  }

  // visit(i, ξ̇_i, τ_i), with their derivatives.
  template <class Visit>
  void for_each_motion(Visit visit) {
    eliminate([&](int i) { return -exact_dot(rods_[i]); });
    for_each_bond([&](int i, const Point& change, const Number& tau) { visit(i, sum(rods_[i].free, change), tau); });
  }

  // What multipliers move the rods by, from the pivot out.
  template <class Visit>
  void for_each_bond(Visit visit) {
    Number tau = stages_[0].row.offset;
    Point before = zero();
    for (int i = 0; i < links(); ++i) {
      const bool last = i + 1 == links();
      const Number next = last ? Number(0.0) : stages_[i + 1].row.offset - stages_[i + 1].row.coupling * tau;
      Point pull = scaled(tau, rods_[i].along);
      if (!last) pull = difference(pull, scaled(next, rods_[i + 1].along));
      const Point bond = scaled(constants_[i].inverse_mass.value, pull);
      visit(i, difference(bond, before), tau);
      before = bond;
      tau = next;
    }
  }

  // --- Prediction ---

  // Mean multipliers go into the free rates: what is left of them at the stages is as often positive as negative, and
  // so is what it is rounded by (ChainStages::predict).
  PENDULA_IN_REGISTERS [[gnu::noinline]] void predict(const Mask& follows) {
    Number lambda = predict_multipliers(0, follows);
    std::array<Twofold<Number>, D> before{};
    for (int i = 0; i < links(); ++i) {
      Rod& rod = rods_[i];
      const bool last = i + 1 == links();
      const Number next = last ? Number(0.0) : predict_multipliers(i + 1, follows);
      const Twofold<Number> own = over_mass(lambda, constants_[i].inverse_mass);
      const Twofold<Number> others = over_mass(next, constants_[i].inverse_mass);
      for (std::size_t k = 0; k < D; ++k) {
        Twofold<Number> bond = product(own, rod.along[k], rod.along_low[k]);
        if (!last) {
          const Rod& beyond = rods_[i + 1];
          const Twofold<Number> pull = product(others, beyond.along[k], beyond.along_low[k]);
          const Twofold<Number> both = exact_sum(bond.value, -pull.value);
          bond = {both.value, both.low + (bond.low - pull.low)};
        }
        Twofold<Number> shift = bond;
        if (i > 0) {
          const Twofold<Number> both = exact_sum(bond.value, -before[k].value);
          shift = {both.value, both.low + (bond.low - before[k].low)};
        }
        before[k] = bond;
        shift_free(rod, k, shift);
        predict_increments(i, k);
      }
      rod.product = exact_dot_of_values(rod);
      lambda = next;
    }
  }

  template <class Of>
  History history(Of of) const {
    History history;
    for (std::size_t d = 0; d < pasts; ++d) history[d] = of((newest_ + d) % pasts);
    return history;
  }

  // Those of the stages, less their mean, which is given.
  Number predict_multipliers(int i, const Mask& follows) {
    Work& work = stages_[i];
    columns_.extrapolate(history([&](std::size_t d) { return &work.past[d].tau; }), work.tau, false);
    const Number lambda = select(follows, columns_.mean(work.tau), Number(0.0));
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { work.tau[j] = work.tau[j] - lambda; });
    detail::unrolled<depth - 1>([&](auto d) PENDULA_WRITTEN_OUT {  // that the next step looks at, too
      Stages& tau = work.past[(newest_ + d) % pasts].tau;
      detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { tau[j] = tau[j] - lambda; });
    });
    return lambda;
  }

  void predict_increments(int i, std::size_t k) {
    Work& work = stages_[i];
    Stages advance;
    columns_.extrapolate(history([&](std::size_t d) { return &work.past[d].advance[k]; }), advance, true);
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT {
      work.U[k][j] = fma(-columns_.hb(j), rods_[i].free[k], L(columns_.b(j)) * advance[j]);
    });
  }

  static Twofold<Number> over_mass(const Number& lambda, const Twofold<L>& inverse_mass) {
    const Twofold<Number> quotient = exact_product(lambda, inverse_mass.value);
    return {quotient.value, fma(lambda, inverse_mass.low, quotient.low)};
  }
  static Twofold<Number> product(const Twofold<Number>& a, const Number& x, const Number& x_low) {
    const Twofold<Number> whole = exact_product(a.value, x);
    return {whole.value, fma(a.low, x, fma(a.value, x_low, whole.low))};
  }

  static void shift_free(Rod& rod, std::size_t k, const Twofold<Number>& shift) {
    const Twofold<Number> raw = exact_sum(rod.free[k], shift.value);
    const Twofold<Number> z = ordered_sum(raw.value, raw.low + (rod.free_low[k] + shift.low));
    rod.free[k] = z.value;
    rod.free_low[k] = z.low;
  }

  // Motion that goes on as at the start of the step.
  void start_cold(const Mask& cold) {
    L scale(0.0);
    const L h = columns_.h();
    for (int i = 0; i < links(); ++i) forget(stages_[i], cold);
    for_each_motion([&](int i, const Point& rate, const Number& tau) {
      for (int j = 0; j < S; ++j) {
        const auto stage = static_cast<std::size_t>(j);
        for (std::size_t k = 0; k < D; ++k) {
          Number& U = stages_[i].U[k][stage];
          U = select(cold, columns_.hb(j) * (rate[k] - rods_[i].free[k]), U);
        }
        stages_[i].tau[stage] = select(cold, tau, stages_[i].tau[stage]);
      }
      const Vector& values = detail::values_of(rate);
      L squared = dot(values, values);
      if constexpr (has_tangent) squared = fma(L(solved_share), slopes_squared(rate), squared);
      scale = fma(squared, constants_[i].inverse_square, scale);
    });
    scale_ = select(cold, scale * (h * h), scale_);
  }

  // What a member was predicted from is not weighed any more; but zero times what is not finite would not be zero.
  static void forget(Work& work, const Mask& cold) {
    for (Past& past : work.past) {
      for (Stages& component : past.advance) {
        for (Number& x : component) x = select(cold, Number(0.0), x);
      }
      for (Number& x : past.tau) x = select(cold, Number(0.0), x);
    }
  }

  // --- Iteration ---

  // X of a link and what its pull adds up to, at all stages.
  [[gnu::always_inline]] void place_stages(int i) {
    const Rod& rod = rods_[i];
    Work& work = stages_[i];
    detail::unrolled<static_cast<int>(D)>([&](auto k) PENDULA_WRITTEN_OUT {
      const Stages& U = work.U[k];
      const Number& z = rod.free[k];
      Stages moved, pull;
      columns_.integrate(U, rod.along_low[k], moved);
      detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT {
        moved[j] = fma(columns_.hc(j), z, fma(columns_.hc_low(j), z, moved[j]));
        work.rod[k][j] = rod.along[k] + moved[j];
        work.known[j] = fma(moved[j], z, k == 0 ? rod.product : work.known[j]);
        pull[j] = work.tau[j] * fma(columns_.hb(j), z, U[j]);
      });
      columns_.integrate(pull, Number(0.0), work.pull[k]);
    });
  }

  // h b ξ̇ at the stages of the step.
  std::array<Stages, D> advance(int i) const {
    std::array<Stages, D> advance;
    for (std::size_t k = 0; k < D; ++k) {
      for (int j = 0; j < S; ++j) {
        const auto stage = static_cast<std::size_t>(j);
        advance[k][stage] = fma(columns_.hb(j), rods_[i].free[k], stages_[i].U[k][stage]);
      }
    }
    return advance;
  }
  std::array<Stages, D> pull_of_loads(int i) const { return loads_.pull(i, stages_[i].rod, advance(i)); }

  // h b times what pulls a rod besides its multiplier: loads, and in a step that does not resolve how fast a chain can
  // swing the tension of one that hangs at rest (ChainStages).
  std::array<Stages, D> more_pull(int i) const {
    std::array<Stages, D> pull;
    if (loads_.any()) {
      pull = pull_of_loads(i);
    } else {
      for (Stages& component : pull) component.fill(Number(0.0));
    }
    const L tension = hangs_ * constants_[i].hanging;
    for (std::size_t k = 0; k < D; ++k) {
      for (int j = 0; j < S; ++j) {
        const auto stage = static_cast<std::size_t>(j);
        pull[k][stage] = fma(columns_.hb(j) * tension, stages_[i].rod[k][stage], pull[k][stage]);
      }
    }
    return pull;
  }

  PENDULA_IN_REGISTERS [[gnu::noinline]] void pull_more() {
    for (int i = 0; i < links(); ++i) {
      const std::array<Stages, D> pull = more_pull(i);
      for (std::size_t k = 0; k < D; ++k) {
        Stages integral;
        columns_.integrate(pull[k], Number(0.0), integral);
        for (std::size_t j = 0; j < integral.size(); ++j) stages_[i].pull[k][j] = stages_[i].pull[k][j] + integral[j];
      }
    }
  }
  // At each member's own stages, however long those of others took.
  PENDULA_IN_REGISTERS [[gnu::noinline]] void add_more_to_totals() {
    for (int i = 0; i < links(); ++i) {
      place_stages(i);
      const std::array<Stages, D> pull = more_pull(i);
      for (std::size_t k = 0; k < D; ++k) stages_[i].pulled[k] = stages_[i].pulled[k] + Columns::total(pull[k]);
    }
  }

  // Energy that loads bring in the step that was solved  [J].
  L work() const {
    L work(0.0);
    const L inverse_h = L(1.0) / columns_.h();
    for (int i = 0; i < links(); ++i) {
      const std::array<Stages, D> pull = pull_of_loads(i), advanced = advance(i);
      for (int j = 0; j < S; ++j) {
        const L inverse_hb = inverse_h * L(columns_.inverse_b(j));
        for (std::size_t k = 0; k < D; ++k) {
          const auto stage = static_cast<std::size_t>(j);
          work = fma(-inverse_hb * value(pull[k][stage]), value(advanced[k][stage]), work);
        }
      }
    }
    return select(loaded(), work, L(0.0));
  }

  // What a sweep keeps on its way in for its way out, of one link at a few stages.
  template <std::size_t Count>
  struct Kept {
    std::array<Point, Count> freed;  // Z − z
    std::array<MultiplierRow<Number>, Count> row;
  };
  static constexpr std::size_t swept = S == 1 ? 1 : 2;  // stages at a time, so that one does not wait for itself

  // Multipliers and increments at `Count` stages from `First` on: from the tip to the pivot and back.
  template <int First, std::size_t Count>
  [[gnu::always_inline]] L sweep(const Mask& active, L change) {
    if constexpr (is_short) {
      std::array<Kept<swept>, static_cast<std::size_t>(N)> kept;
      sweep_inward<First, Count>(kept);
      return sweep_outward<First, Count>(kept, active, change);
    } else {
      sweep_inward<First, Count>(kept_);
      return sweep_outward<First, Count>(kept_, active, change);
    }
  }

  template <int First, std::size_t Count, class KeptLinks>
  [[gnu::always_inline]] L sweep_outward(const KeptLinks& kept, const Mask& active, L change) {
    std::array<Point, Count> bond_before;
    std::array<Number, Count> tau;
    detail::unrolled<static_cast<int>(Count)>([&](auto c) PENDULA_WRITTEN_OUT {
      bond_before[c] = zero();
      tau[c] = at(kept, 0).row[c].offset;
    });
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      Work& work = stages_[i];
      const L inverse_mass = constants_[i].inverse_mass.value;
      L changed(0.0);
      detail::unrolled<static_cast<int>(Count)>([&](auto c) PENDULA_WRITTEN_OUT {
        constexpr std::size_t j = First + c;
        work.tau[j] = select(active, tau[c], work.tau[j]);
        Point pull = components<D>([&](std::size_t k) { return tau[c] * work.rod[k][j]; });
        if (i + 1 < links()) {
          const MultiplierRow<Number>& next = at(kept, i + 1).row[c];
          tau[c] = N == 2 ? next.offset : fma(-next.coupling, tau[c], next.offset);
          for (std::size_t k = 0; k < D; ++k) pull[k] = fma(-tau[c], stages_[i + 1].rod[k][j], pull[k]);
        }
        for (std::size_t k = 0; k < D; ++k) {
          const Number bond = inverse_mass * pull[k];
          const Number U = columns_.hb(static_cast<int>(j)) * (at(kept, i).freed[c][k] + (bond - bond_before[c][k]));
          const Number difference = U - work.U[k][j];
          changed = fma(value(difference), value(difference), changed);
          if constexpr (has_tangent) changed = fma(L(solved_share) * difference.slope, difference.slope, changed);
          work.U[k][j] = select(active, U, work.U[k][j]);
          bond_before[c][k] = bond;
        }
      });
      change = fma(changed, constants_[i].inverse_square, change);
    });
    return change;
  }

  template <int First, std::size_t Count, class KeptLinks>
  [[gnu::always_inline]] void sweep_inward(KeptLinks& kept) {
    struct Carried {
      Point bond;
      MultiplierRow<Number> row;
      Number beyond{0.0};
    };
    std::array<Carried, Count> carried;
    const int tip = links() - 1;
    detail::unrolled<static_cast<int>(Count)>([&](auto c) PENDULA_WRITTEN_OUT {
      const L inverse_mass = -constants_[tip].inverse_mass.value;
      carried[c].bond = components<D>([&](std::size_t k) { return inverse_mass * stages_[tip].pull[k][First + c]; });
    });
    for_links_inward([&](auto i) PENDULA_WRITTEN_OUT {
      detail::unrolled<static_cast<int>(Count)>([&](auto c) PENDULA_WRITTEN_OUT {
        constexpr std::size_t j = First + c;
        const Work& work = stages_[i];
        Carried& carry = carried[c];
        Number product = work.known[j], before(0.0), square(0.0);
        for (std::size_t k = 0; k < D; ++k) {
          const Number rod = work.rod[k][j];
          Number freed = carry.bond[k];
          if (i > 0) {
            const Work& next = stages_[i - 1];
            carry.bond[k] = constants_[i - 1].inverse_mass.value * (work.pull[k][j] - next.pull[k][j]);
            freed = freed - carry.bond[k];
            before = fma(rod, next.rod[k][j], before);
          } else if (k == D - 1) {
            freed = fma(-columns_.hc(static_cast<int>(j)), gravity_, freed);
          }
          freed = rods_[i].free_low[k] + freed;
          product = fma(rod, freed, product);
          square = fma(rod, rod, square);
          at(kept, i).freed[c][k] = freed;
        }
        if (i > 0) before = -constants_[i - 1].inverse_mass.value * before;
        square = constants_[i].inverse_masses * square;
        if constexpr (N == 2) {
          if (i == 1) {
            carry.row = {-product, square};
            carry.beyond = before;
          } else {
            solve_two(square, carry.beyond, -product, carry.row, at(kept, 0).row[c], at(kept, 1).row[c]);
          }
        } else {
          carry.row = next_row(carry.row, carry.beyond, square, before, -product);
          carry.beyond = before;
          at(kept, i).row[c] = carry.row;
        }
      });
    });
  }

  // Both multipliers by one division, as rows that take nothing from each other. tip: what the tip's equation has on
  // the right, and its square.
  static void solve_two(const Number& square, const Number& beyond, const Number& right,
                        const MultiplierRow<Number>& tip, MultiplierRow<Number>& first, MultiplierRow<Number>& second) {
    const Number inverse = Number(1.0) / fma(-beyond, beyond, square * tip.coupling);
    first = {fma(-beyond, tip.offset, right * tip.coupling) * inverse, Number(0.0)};
    second = {fma(-beyond, right, square * tip.offset) * inverse, Number(0.0)};
  }

  static MultiplierRow<Number> next_row(const MultiplierRow<Number>& row, const Number& beyond, const Number& square,
                                        const Number& before, const Number& right) {
    const Number inverse = Number(1.0) / fma(-beyond, row.coupling, square);
    return {fma(-beyond, row.offset, right) * inverse, before * inverse};
  }

  static constexpr bool is_short = detail::is_short_chain<N>;

  template <class Links>
  static auto& at(Links& of, int link) {
    if constexpr (is_short) {
      return of[static_cast<std::size_t>(link)];
    } else {
      return of[link];
    }
  }

  template <class Body>
  [[gnu::always_inline]] void for_links(Body body) {
    detail::for_links<N>(links(), body);
  }
  template <class Body>
  [[gnu::always_inline]] void for_links_inward(Body body) {
    if constexpr (is_short) {
      detail::unrolled<N>([&](auto i) PENDULA_WRITTEN_OUT { body(std::integral_constant<int, N - 1 - i>()); });
    } else {
      for (int i = links(); i-- > 0;) body(i);
    }
  }

  // --- The end of a step ---

  // ξ += h z + what the stages add.
  static void move(const L& h, const Number& moved, const Mask& accepted, Rod& rod, std::size_t k) {
    const Twofold<Number> coasted = exact_product(h, rod.free[k]);
    const Twofold<Number> near = exact_sum(rod.along[k], coasted.value);
    const Twofold<Number> added = exact_sum(near.low + (rod.along_low[k] + coasted.low), moved);
    const Twofold<Number> there = exact_sum(near.value, added.value);
    rod.along[k] = select(accepted, there.value, rod.along[k]);
    rod.along_low[k] = select(accepted, there.low + added.low, rod.along_low[k]);
  }

  // z += what the stages add, and the first link's falls.
  void push(const Number& pushed, bool falls, const Mask& accepted, Rod& rod, std::size_t k) const {
    const Twofold<Number> wanted = ordered_sum(pushed, rod.free_low[k]);
    Twofold<Number> z = exact_sum(rod.free[k], wanted.value);
    z.low = z.low + wanted.low;
    if (falls) {
      const Twofold<L> change = exact_product(columns_.h(), gravity_);
      const Twofold<Number> fallen = exact_sum(z.value, Number(-change.value));
      z = {fallen.value, z.low + (fallen.low - Number(change.low))};
    }
    rod.free[k] = select(accepted, z.value, rod.free[k]);
    rod.free_low[k] = select(accepted, z.low, rod.free_low[k]);
  }

  // |ξ_i| = l_i again, where rounding has changed it.
  void restore_lengths(const Mask& due) {
    restoring_ = select(due, L(0.0), restoring_);
    for (int i = 0; i < links(); ++i) {
      Rod& rod = rods_[i];
      const L& length = constants_[i].length;
      const Twofold<L> right = exact_product(length, length);
      Twofold<Number> missing{Number(right.value), Number(right.low)};
      for (std::size_t k = 0; k < D; ++k) {
        const Twofold<Number> square = exact_product(rod.along[k], rod.along[k]);
        const Twofold<Number> less = exact_sum(missing.value, -square.value);
        missing = {less.value, less.low + ((missing.low - square.low) - L(2.0) * (rod.along[k] * rod.along_low[k]))};
      }
      const Number factor = L(0.5) * (missing.value + missing.low) * constants_[i].inverse_square;
      for (std::size_t k = 0; k < D; ++k) {
        const Twofold<Number> x = ordered_sum(rod.along[k], fma(rod.along[k], factor, rod.along_low[k]));
        rod.along[k] = select(due, x.value, rod.along[k]);
        rod.along_low[k] = select(due, x.low, rod.along_low[k]);
      }
    }
  }

  int links_;
  Columns columns_;
  L gravity_{0.0}, slowest_pace_{1.0}, inverse_pace_squared_{1.0}, scale_{0.0}, turn_{0.0}, quartic_{0.0};
  L brought_{0.0};                     // by loads, in the step that is looked at
  L fastest_swing_{0.0}, hangs_{0.0};  // ω², at rest; whether the step does not resolve it
  bool pulls_more_ = false;
  std::size_t newest_ = 0;
  L restoring_{0.0};  // steps since lengths were restored
  detail::PerLink<LaneLink<L>, N> constants_;
  detail::PerLink<Rod, N> rods_, saved_{rods_};
  detail::PerLink<Work, N> stages_;
  detail::PerLink<Point, N> rates_;
  detail::PerLink<Kept<swept>, is_short ? 1 : N> kept_;
  LaneStageLoads<Space, S, N, L> loads_;
};

}  // namespace pendula
