#pragma once

#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/lanes/lane_links.hpp>
#include <pendula/lanes/lane_pack.hpp>

namespace pendula {

/// The classical Runge–Kutta method of order 4 on several chains at once, one in each lane, for few digits: as a
/// stepper of LaneQueue. Rods and their rates are what is moved, ξ̈ being made of weight and multipliers that keep |ξ̇|²
/// + ξ·ξ̈ = 0 (RodState::for_each_acceleration); after each step rods have their lengths again, and rates go across.
/// Gravity is all that acts.
template <class Space, int N = Eigen::Dynamic, class Register = MemberRegister>
class LaneRk4 {
 public:
  using SpaceType = Space;
  static constexpr int links_known = N, stages = 4;
  static constexpr bool is_implicit = false;
  using L = LanePack<Register>;
  using Mask = typename L::Mask;
  static constexpr int lanes = L::size;
  static constexpr std::size_t D = Space::dimension;
  using Vector = std::array<L, D>;

  struct Options {};
  explicit LaneRk4(int links, Options = {})
      : links_(links), constants_(links), rods_(links), trial_(links), stage_(links), slopes_(links), rows_(links) {
    for (int i = 0; i < links; ++i) {
      rods_[i].along.fill(L(0.0));
      rods_[i].rate.fill(L(0.0));
      rods_[i].along[D - 1] = L(-1.0);
    }
  }

  LaneRk4& chain() { return *this; }
  const LaneRk4& chain() const { return *this; }
  int links() const {
    if constexpr (N == Eigen::Dynamic) return links_;
    return N;
  }

  /// A member comes into a lane, with its chain, at q and v  [rad, rad/s].
  void start(int lane, const ChainLinks<Space, N, double>& chain, double gravity, const double* q, const double* v) {
    gravity_.set(lane, gravity);
    for (int i = 0; i < links(); ++i) {
      constants_[i].set(lane, chain[i]);
      std::array<double, Space::dof> angles, rates;
      for (std::size_t a = 0; a < angles.size(); ++a) {
        angles[a] = q[static_cast<Eigen::Index>(a) * links() + i];
        rates[a] = v[static_cast<Eigen::Index>(a) * links() + i];
      }
      const Heading<Space> heading(angles, rates);
      for (std::size_t k = 0; k < D; ++k) {
        rods_[i].along[k].set(lane, chain[i].length * heading.u[k]);
        rods_[i].rate[k].set(lane, chain[i].length * heading.u_dot[k]);
      }
    }
  }

  /// Direction of a member's link and its rate.
  auto heading(int lane, int i) const {
    Heading<Space, long double> heading;
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] = rods_[i].along[k][lane] / constants_[i].length[lane];
      heading.u_dot[k] = rods_[i].rate[k][lane] / constants_[i].length[lane];
    }
    return heading;
  }
  void find_rates() const {}
  const Vector& along(int i) const { return rods_[i].along; }

  /// T + U  [J].
  L energy() const {
    L energy(0.0);
    Vector bob{};
    bob.fill(L(0.0));
    for (int i = 0; i < links(); ++i) {
      bob = sum(bob, rods_[i].rate);
      energy = fma(0.5 * constants_[i].mass, dot(bob, bob), energy);
      energy = fma(constants_[i].weight, rods_[i].along[D - 1], energy);
    }
    return energy;
  }

  /// Tries a step of `h`; gives those of the members that are `wanted` to whom nothing happened that is not finite. The
  /// state stays what it was.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& h, const Mask& wanted) {
    slopes(rods_);
    for_links([&](auto i) PENDULA_WRITTEN_OUT { at(trial_, i) = at(rods_, i); });
    advance(L(1.0 / 6) * h, 0.5 * h);
    slopes(stage_);
    advance(L(1.0 / 3) * h, 0.5 * h);
    slopes(stage_);
    advance(L(1.0 / 3) * h, h);
    slopes(stage_);
    L all(0.0);
    const L last = L(1.0 / 6) * h;
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      Rod& rod = at(trial_, i);
      move(last, at(slopes_, i), rod);
      restore(at(constants_, i), rod);
      all = all + dot(rod.rate, rod.rate);
    });
    return wanted & (all < L(1e300));
  }

  /// Moves the members to the end of the step that was tried.
  void accept(const Mask& which) {
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      for (std::size_t k = 0; k < D; ++k) {
        Rod& rod = at(rods_, i);
        const Rod& moved = at(trial_, i);
        rod.along[k] = select(which, moved.along[k], rod.along[k]);
        rod.rate[k] = select(which, moved.rate[k], rod.rate[k]);
      }
    });
  }

 private:
  struct Rod {
    Vector along, rate;  // ξ, ξ̇; of slopes ξ̇, ξ̈
  };
  using Rods = detail::PerLink<Rod, N>;

  static constexpr bool is_short = detail::is_short_chain<N>;

  template <class Links>
  static auto& at(Links& of, int link) {
    return of[link];
  }

  template <class Body>
  [[gnu::always_inline]] void for_links(Body body) {
    detail::for_links<N>(links(), body);
  }

  // ξ̇ and ξ̈ of rods.
  [[gnu::always_inline]] void slopes(const Rods& rods) {
    MultiplierRow<L> row;
    L beyond(0.0);
    const auto inward = [&](auto i) PENDULA_WRITTEN_OUT {
      const Rod& rod = at(rods, i);
      L right = -dot(rod.rate, rod.rate), before(0.0);
      if (i == 0) {
        right = fma(rod.along[D - 1], gravity_, right);
      } else {
        before = -at(constants_, i - 1).inverse_mass.value * dot(at(rods, i - 1).along, rod.along);
      }
      const L square = at(constants_, i).inverse_masses * dot(rod.along, rod.along);
      const L inverse = L(1.0) / fma(-beyond, row.coupling, square);
      row = {fma(-beyond, row.offset, right) * inverse, before * inverse};
      at(rows_, i) = row;
      beyond = before;
    };
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      if constexpr (is_short) {
        inward(std::integral_constant<int, N - 1 - i>());
      } else {
        inward(links() - 1 - i);
      }
    });
    L tau = row.offset;
    Vector bond_before{};
    bond_before.fill(L(0.0));
    bond_before[D - 1] = gravity_;
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      const Rod& rod = at(rods, i);
      Vector pull = scaled(tau, rod.along);
      if (i + 1 < links()) {
        tau = fma(-at(rows_, i + 1).coupling, tau, at(rows_, i + 1).offset);
        for (std::size_t k = 0; k < D; ++k) pull[k] = fma(-tau, at(rods, i + 1).along[k], pull[k]);
      }
      const Vector bond = scaled(at(constants_, i).inverse_mass.value, pull);
      at(slopes_, i) = {rod.rate, difference(bond, bond_before)};
      bond_before = bond;
    });
  }

  static void move(const L& h, const Rod& slope, Rod& rod) {
    for (std::size_t k = 0; k < D; ++k) {
      rod.along[k] = fma(h, slope.along[k], rod.along[k]);
      rod.rate[k] = fma(h, slope.rate[k], rod.rate[k]);
    }
  }

  // The trial by `weight` of the slopes; the next stage by h of them.
  [[gnu::always_inline]] void advance(const L& weight, const L& h) {
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      move(weight, at(slopes_, i), at(trial_, i));
      at(stage_, i) = at(rods_, i);
      move(h, at(slopes_, i), at(stage_, i));
    });
  }

  // |ξ| = l and ξ·ξ̇ = 0 again; what a step errs by in them is small.
  static void restore(const LaneLink<L>& link, Rod& rod) {
    const L factor = fma(-0.5 * link.inverse_square, dot(rod.along, rod.along), L(1.5));
    rod.along = scaled(factor, rod.along);
    const L along = dot(rod.along, rod.rate) * link.inverse_square;
    for (std::size_t k = 0; k < D; ++k) rod.rate[k] = fma(-along, rod.along[k], rod.rate[k]);
  }

  int links_;
  L gravity_{0.0};
  detail::PerLink<LaneLink<L>, N> constants_;
  Rods rods_, trial_, stage_, slopes_;
  detail::PerLink<MultiplierRow<L>, N> rows_;
};

}  // namespace pendula
