#pragma once

#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/chain_motion.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/member_loads.hpp>
#include <pendula/chain/rod_tangent.hpp>
#include <pendula/gauss/member_layout.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/long_real.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/system/forcing_look.hpp>
#include <type_traits>

namespace pendula {

/// The chains of several members of an ensemble, one member in each lane, and the stages of their Gauss steps:
/// ChainMotion with what members need.
///
/// N may be Eigen::Dynamic. With a tangent, every number carries its derivative along one tangent of each member: that
/// of the discrete step, solved together with it.
template <class Space, int S, int N = Eigen::Dynamic, class Register = MemberRegister, bool with_tangent = false>
class ChainMembers
    : public ChainMotion<
          Space, MembersInLanes<S, std::conditional_t<with_tangent, Dual<LanePack<Register>>, LanePack<Register>>>, N> {
 public:
  using L = LanePack<Register>;
  using Mask = typename L::Mask;
  using Number = std::conditional_t<with_tangent, Dual<L>, L>;
  using Motion = ChainMotion<Space, MembersInLanes<S, Number>, N>;
  using SpaceType = Space;
  using Subject = int;
  using Columns = typename Motion::Columns;
  using Vector = std::array<L, static_cast<std::size_t>(Space::dimension)>;
  static constexpr bool has_tangent = with_tangent;
  using Motion::D, Motion::links, Motion::energy;

  explicit ChainMembers(int count) : Motion(count), rates_(count), loads_(count), saved_(count) {
    for (int i = 0; i < count; ++i) {  // unused lanes hold a resting chain
      rods_.set_mass(i, constants_[i].inverse_mass);
      rods_.along(i)[D - 1] = Number(-1.0);
      rates_[i] = Motion::zero();
    }
  }

  /// Number of links.
  int count() const { return links(); }

  // --- One member ---

  /// A member comes into a lane, with its chain, at q and v  [rad, rad/s]; its next step starts cold.
  void start(int lane, double /*time*/, const Chain<Space, N>& given, const ChainLinks<Space, N, double>& chain,
             const double* q, const double* v) {
    const double gravity = given.gravity();
    this->gravity_.set(lane, gravity);
    loads_.take(lane, given, chain);
    if (loads_.any()) this->expect_loads();
    double length = 0;
    for (int i = 0; i < links(); ++i) {
      constants_[i].set(lane, chain[i]);
      rods_.set_mass(i, constants_[i].inverse_mass);
      length += chain[i].length;
      std::array<Wide, Space::dof> angles, rates;
      for (std::size_t a = 0; a < angles.size(); ++a) {
        angles[a] = Wide(q[entry(i, a)]);
        rates[a] = Wide(v[entry(i, a)]);
      }
      rods_.start(lane, i, Wide(chain[i].length), Heading<Space, Wide>(angles, rates));
    }
    this->slowest_pace_.set(lane, slowest_pace_squared<double>(links(), gravity, length));
    this->fastest_swing_.set(lane, chain.fastest_swing_squared());
    restoring_.set(lane, 0);
    if constexpr (has_tangent) start_tangent(lane);
  }

  /// Direction of a member's link and its rate. Call `find_rates` first.
  auto heading(int lane, int i) const { return rods_.heading(lane, i, rates_[i]); }

  // --- All members ---

  Vector along(int i) const { return detail::values_of(Motion::Rods::vector(rods_.along(i))); }  ///< ξ_i  [m]
  const L& length(int i) const { return constants_[i].length; }
  const L& inverse_square(int i) const { return constants_[i].inverse_square; }

  /// Calls visit(i, ξ̇_i, τ_i) for all rods at the present state.
  template <class Visit>
  void for_each_rate(Visit visit) {
    rods_.for_each_rate(constants_, [&](int i, const Point& rate, const Number& tau) {
      visit(i, detail::values_of(rate), detail::value_of(tau));
    });
  }

  void find_rates() {
    rods_.for_each_rate(constants_, [&](int i, const Point& rate, const Number&) { rates_[i] = rate; });
  }

  /// Members that have damping, torques or drives.
  Mask loaded() const { return loads_.loaded(); }
  /// Members with which convergence of the fixed point may need shorter steps than errors do, because of damping.
  Mask may_be_stiff() const { return loaded(); }
  /// The longest step in which stages integrate the drives to a tolerance  [s].
  L longest_step(double tolerance) const { return L(SineTurn(S, 2 * S).within(tolerance)) / loads_.fastest_drive(); }

  /// The energy that the end of the solved step should have: the present one and the work of loads  [J].
  L energy_due() {
    brought_ = loads_.any() ? select(loaded(), this->work(), L(0.0)) : L(0.0);
    return energy() + brought_;
  }

  /// Energy errors are relative to this: Σ M |g| l + |due| + |work of loads|  [J].
  L energy_scale(const L& due) const {
    L scale(0.0);
    for (int i = 0; i < links(); ++i) scale = fma(abs(constants_[i].weight), constants_[i].length, scale);
    return scale + abs(due) + abs(brought_);
  }

  /// Predicts the stages of a step of `h`, `ratio` times as long as the one that it is predicted from.
  void prepare(const L& time, const L& h, const L& ratio, const StagePrediction<L>& kind) {
    this->columns_.prepare(h);
    if (loads_.any()) set_torques(time);
    Motion::predict(h, ratio, kind);
  }

  L iterate(const Mask& active) {
    return Motion::iterate(active, [](int, const L&) {});
  }
  using Motion::finish;

  /// A rod at stage j of the step.
  Vector along(int i, int j) const { return detail::values_of(this->rod(i, j)); }

  /// Rods of the members whose step was accepted, and their rates, when `share` of it was done, by the polynomial
  /// through its stages; visit(i, ξ, ξ̇).
  template <class Visit>
  void for_each_at(double share, Visit visit) {
    const typename Columns::Shares& weights = this->columns_.shares(share);
    const L inverse_h = L(1.0) / this->columns_.h();
    for (int i = 0; i < links(); ++i) {
      Vector rod = along(i), rate = detail::values_of(Motion::zero());
      for (std::size_t k = 0; k < D; ++k) {
        const auto& advance = past(i).advance[k];
        for (int j = 0; j < S; ++j) {
          const auto stage = static_cast<std::size_t>(j);
          rod[k] = fma(L(-weights.ahead[stage]), detail::value_of(advance[j]), rod[k]);
          rate[k] = fma(L(weights.values[stage]), detail::value_of(advance[j]), rate[k]);
        }
        rate[k] = rate[k] * inverse_h;
      }
      visit(i, rod, rate);
    }
  }

  /// save() keeps the rods of all members. restore(which) puts these members back to them.
  void save() { saved_ = rods_.place(); }
  void restore(const Mask& which) { rods_.go_to(saved_, which); }

  /// A close upper bound of the largest turn of a link in the step, squared  [rad²].
  L turn() const { return this->turn_squared(); }
  /// With larger turns the solution of the stage equations may not be the motion  [rad].
  static constexpr double largest_turn(bool /*chosen*/) { return detail::largest_turn; }

  /// R in the middle of the step, squared, times h².
  L pace_squared() const {
    const L h = this->columns_.h();
    return fma(this->slowest_pace_, h * h, sqrt(sqrt(this->quartic_)));
  }

  /// The largest coefficient of the Legendre polynomial P_k in the rates, times h, relative to the length of the rod,
  /// squared. With a share of that of the tangent, which alone limits steps where the motion rests.
  PENDULA_IN_REGISTERS L decay(int k) const {
    L largest(0.0);
    for (int i = 0; i < links(); ++i) {
      L squared(0.0);
      for (std::size_t d = 0; d < D; ++d) {
        const auto& advance = past(i).advance[d];
        const L a = this->columns_.legendre(k, detail::values_of(advance));
        squared = fma(a, a, squared);
        if constexpr (has_tangent) {
          const L slope = this->columns_.legendre(k, detail::slopes_of(advance));
          squared = fma(L(tangent_share * tangent_share) * slope, slope, squared);
        }
      }
      largest = max(largest, squared * constants_[i].inverse_square);
    }
    return largest;
  }

  /// The largest error, at the start of the step, of the polynomials through the stages' rates, times h, relative to
  /// the length of the rod, squared.
  L missed_at_start() {
    L largest(0.0);
    for_each_rate([&](int i, const Vector& rate, const L&) {
      L squared(0.0);
      for (std::size_t d = 0; d < D; ++d) {
        const L missed = this->columns_.at_start(detail::values_of(past(i).advance[d])) - this->columns_.h() * rate[d];
        squared = fma(missed, missed, squared);
      }
      largest = max(largest, squared * constants_[i].inverse_square);
    });
    return largest;
  }

  /// Moves the members that are `accepted` to the end of the step; the others stay where they are.
  void accept(const Mask& accepted) {
    Motion::move(accepted);
    restoring_ = restoring_ + select(accepted, L(1.0), L(0.0));
    const Mask due = restoring_ == L(16.0);
    if (!xsimd::any(due)) return;
    restoring_ = select(due, L(0.0), restoring_);
    rods_.restore_lengths(constants_, due);
  }

  /// The logarithm of the growth of these members' tangents since their length was 1. Scales them to the length 1
  /// again.
  L take_growth(const Mask& which) requires with_tangent {
    find_rates();
    L squared(0.0);
    for (int i = 0; i < links(); ++i) {
      const L along = slopes_squared(Motion::Rods::vector(rods_.along(i))), rate = slopes_squared(rates_[i]);
      squared = fma(constants_[i].inverse_square, fma(inverse_pace_squared_, rate, along), squared);
    }
    const L factor = select(which, L(1.0) / sqrt(squared), L(1.0));
    for (int i = 0; i < links(); ++i) scale_tangent(factor, i);
    return 0.5 * log(squared);
  }

 private:
  using Motion::constants_, Motion::rods_;
  using typename Motion::Point;
  using Wide = LongReal;

  const auto& past(int i) const { return this->pasts_[i][this->newest_]; }
  Eigen::Index entry(int i, std::size_t a) const { return static_cast<Eigen::Index>(a) * links() + i; }

  // Sets the torques at the stages of a step from `time`, for which the columns are prepared.
  void set_torques(const L& time) {
    for (int j = 0; j < S; ++j) {
      loads_.set_time(time + this->columns_.hc(j));
      for (int i = 0; i < links(); ++i) {
        const auto torque = loads_.torque(i, constants_[i]);
        for (std::size_t k = 0; k < torque.size(); ++k) {
          this->torques_[i][k].set(j, Number(this->columns_.hb(j) * torque[k]));
        }
      }
    }
  }

  // --- Tangents ---

  void start_tangent(int lane) {
    const auto numbers = [&](const Number* from) {
      return components<D>([&](std::size_t k) { return detail::value_of(from[k])[lane]; });
    };
    const auto rod_of = [&](int i) {
      return MovingRod<D>{numbers(rods_.along(i)), numbers(rods_.free(i)), constants_[i].inverse_square[lane]};
    };
    const RodTangent<Space> tangent(links(), this->slowest_pace_[lane], rod_of);
    inverse_pace_squared_.set(lane, tangent.inverse_pace_squared());
    for (int i = 0; i < links(); ++i) {
      for (std::size_t k = 0; k < D; ++k) {
        rods_.along(i)[k].slope.set(lane, tangent.place(i)[k]);
        rods_.free(i)[k].slope.set(lane, tangent.rate(i)[k]);
      }
    }
  }

  static L slopes_squared(const Point& point) {
    L squared(0.0);
    for (const Number& x : point) squared = fma(x.slope, x.slope, squared);
    return squared;
  }

  // Scales the tangent of the state, and of the stages that the next step is predicted from.
  void scale_tangent(const L& factor, int i) {
    const auto scale = [&](Number* numbers, std::size_t count) {
      for (std::size_t k = 0; k < count; ++k) numbers[k].slope = factor * numbers[k].slope;
    };
    auto& place = rods_.place();
    for (auto* part : {&place.along, &place.along_low, &place.free, &place.free_low}) scale((*part)[i], D);
    for (auto& past : this->pasts_[i]) {
      for (auto& row : past.advance) scale(row.data(), row.size());
      scale(past.tau.data(), past.tau.size());
    }
  }

  L inverse_pace_squared_{1.0};
  L brought_{0.0};    // work of loads in the step
  L restoring_{0.0};  // steps since lengths were restored
  detail::PerLink<Point, N> rates_;
  MemberLoads<Space, N, L> loads_;
  typename Motion::Rods::FullState saved_;
};

}  // namespace pendula
