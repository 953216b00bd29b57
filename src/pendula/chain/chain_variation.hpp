#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/chain/rod_frame.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/numeric/directions.hpp>
#include <vector>

namespace pendula {

/// Converts tangents at one state of a chain between the coordinates of derivatives of steps (chain_tangent.hpp) and
/// those of users: δq, δv of angles and their rates, (2 dof·n), δq first, each ordered as q is. In space the latter
/// fail where sin θ = 0.
///
/// `parameters`, where given, are variations of the parameters, as many columns, ordered as in chain_tangent.hpp.
template <class Space, class Real = double>
class ChainVariation {
 public:
  template <int N>
  ChainVariation(const Chain<Space, N>& chain, const State<Space, N, Real>& state)
      : links_(static_cast<std::size_t>(chain.links())), rows_(links_.size()) {
    Numbers w{}, y{};
    for (std::size_t i = 0; i < links_.size(); ++i) {
      Link& link = links_[i];
      link.mass = Real(chain.masses()[index(i)]);
      link.length = Real(chain.lengths()[index(i)]);
      Angles q;
      for (std::size_t a = 0; a < dof; ++a) {
        q[a] = state.q[index(entry(i, a))];
        link.v[a] = state.v[index(entry(i, a))];
      }
      Rod::trig(q, link.trig);
      Rod::direction(link.trig, link.u);
      Rod::velocity(link.trig, link.v, link.u_dot);
      Rod::direction_first(link.trig, link.first);
      Rod::direction_second(link.trig, link.second);
      link.frame = RodFrame<Space, Real>(link.u);
      link.bob = w = sum(w, scaled(link.length, link.u_dot));
    }
    for (std::size_t i = links_.size(); i-- > 0;) {
      Link& link = links_[i];
      link.momentum = y = sum(y, scaled(link.mass, link.bob));
      link.gauge = dot(y, link.u) / link.length;
    }
  }

  /// Converts variations of angles and rates, (2 dof·n x any), to tangents.
  void tangents(const Directions<Real>& rates, Directions<Real>& tangents) { find_tangents(rates, tangents, nullptr); }
  void tangents(const Directions<Real>& rates, Directions<Real>& tangents, const Directions<Real>& parameters) {
    find_tangents(rates, tangents, parameters.data());
  }

  /// Converts tangents to variations of angles and rates.
  void rates(const Directions<Real>& tangents, Directions<Real>& rates) { find_rates(tangents, rates, nullptr); }
  void rates(const Directions<Real>& tangents, Directions<Real>& rates, const Directions<Real>& parameters) {
    find_rates(tangents, rates, parameters.data());
  }

 private:
  using Rod = typename Space::Link;
  static constexpr std::size_t D = Space::dimension, dof = Space::dof, f = RodFrame<Space, Real>::size;
  using Numbers = std::array<Real, D>;
  using Angles = std::array<Real, dof>;

  struct Link {
    Real mass, length, gauge;
    typename Rod::template Trig<Real> trig;
    typename Rod::template First<Real> first;
    typename Rod::template Second<Real> second;
    Angles v;
    Numbers u, u_dot, bob, momentum;
    RodFrame<Space, Real> frame;
    // For the direction at hand:
    Numbers turned, forced;  // δu; m δw on the way to tangents, M δξ̇ on the way back
  };

  template <class Number>
  struct Column {
    Number* from;
    std::ptrdiff_t stride;
    Number& operator[](std::size_t row) const { return from[static_cast<std::ptrdiff_t>(row) * stride]; }
    Real mass(std::size_t i) const { return from ? (*this)[i] : Real(0); }
    Real length(std::size_t i, std::size_t links) const { return from ? (*this)[links + i] : Real(0); }
  };
  using Given = Column<const Real>;
  using Found = Column<Real>;

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }
  std::size_t n() const { return links_.size(); }
  std::size_t entry(std::size_t i, std::size_t a) const { return a * n() + i; }

  // Σ u_ab v_a δq_b.
  static Numbers bent(const Link& link, const Angles& dq) {
    Numbers bent{};
    for (std::size_t a = 0; a < dof; ++a) {
      for (std::size_t b = 0; b < dof; ++b) bent = sum(bent, scaled(Real(link.v[a] * dq[b]), link.second[a + b]));
    }
    return bent;
  }

  void find_tangents(const Directions<Real>& rates, Directions<Real>& tangents, const Real* parameters) {
    const auto count = rates.cols();
    tangents.resize(index(2 * f * n()), count);
    for (Eigen::Index k = 0; k < count; ++k) {
      find_tangents({rates.data() + k, count}, {tangents.data() + k, count},
                    {parameters ? parameters + k : nullptr, count});
    }
  }
  void find_rates(const Directions<Real>& tangents, Directions<Real>& rates, const Real* parameters) {
    const auto count = tangents.cols();
    rates.resize(index(2 * dof * n()), count);
    for (Eigen::Index k = 0; k < count; ++k) {
      find_rates({tangents.data() + k, count}, {rates.data() + k, count},
                 {parameters ? parameters + k : nullptr, count});
    }
  }

  void find_tangents(Given rates, Found tangents, Given parameters) {
    Numbers w{}, y{};
    for (std::size_t i = 0; i < n(); ++i) {
      Link& link = links_[i];
      Angles dq;
      Numbers turned{}, faster{};
      for (std::size_t a = 0; a < dof; ++a) {
        dq[a] = rates[entry(i, a)];
        turned = sum(turned, scaled(dq[a], link.first[a]));
        faster = sum(faster, scaled(Real(rates[(dof * n()) + entry(i, a)]), link.first[a]));
      }
      faster = sum(faster, bent(link, dq));
      w = sum(w, sum(scaled(link.length, faster), scaled(parameters.length(i, n()), link.u_dot)));
      link.turned = turned;
      link.forced = sum(scaled(link.mass, w), scaled(parameters.mass(i), link.bob));
    }
    for (std::size_t i = n(); i-- > 0;) {
      const Link& link = links_[i];
      y = sum(y, link.forced);
      const auto turned = link.frame.components(link.turned);
      const auto across = link.frame.components(difference(y, scaled(Real(link.gauge * link.length), link.turned)));
      const auto grown = link.frame.components(link.momentum);
      for (std::size_t a = 0; a < f; ++a) {
        tangents[i * f + a] = turned[a];
        tangents[(n() + i) * f + a] = link.length * across[a] + parameters.length(i, n()) * grown[a];
      }
    }
  }

  // Solves M δξ̇ = δy − δM ξ̇ + κ ξ, with κ such that ξ·ξ̇ stays 0.
  void find_rates(Given tangents, Found rates, Given parameters) {
    Numbers forced{};
    for (std::size_t i = n(); i-- > 0;) {
      Link& link = links_[i];
      const Real grown = parameters.length(i, n()) / link.length;
      Numbers turned{}, across{};
      for (std::size_t a = 0; a < f; ++a) {
        turned = sum(turned, scaled(Real(tangents[i * f + a]), link.frame.vector(a)));
        across = sum(across, scaled(Real(tangents[(n() + i) * f + a]), link.frame.vector(a)));
      }
      link.turned = turned;
      forced = sum(forced, scaled(parameters.mass(i), link.bob));
      link.forced = sum(scaled(Real(1 / link.length), across), scaled(Real(link.gauge * link.length), turned));
      link.forced = difference(link.forced, scaled(grown, link.momentum));
      link.forced = difference(link.forced, forced);
    }
    keep_lengths();
    Numbers before{};
    for (std::size_t i = 0; i < n(); ++i) {
      const Link& link = links_[i];
      Numbers next{};
      if (i + 1 < n()) next = links_[i + 1].forced;
      const Numbers bond = scaled(Real(1 / link.mass), difference(link.forced, next));
      Numbers faster = difference(bond, before);
      before = bond;
      faster = scaled(Real(1 / link.length), difference(faster, scaled(parameters.length(i, n()), link.u_dot)));
      write_rates(link, i, faster, rates);
    }
  }

  // Finds the multipliers κ inward, and adds κ ξ to δy outward.
  void keep_lengths() {
    MultiplierRow<Real> row;
    Real beyond(0);
    for (std::size_t i = n(); i-- > 0;) {
      const Link& link = links_[i];
      const Real inverse = 1 / link.mass, inverse_before = i == 0 ? Real(0) : Real(1 / links_[i - 1].mass);
      Numbers rate = scaled(inverse, link.forced);
      if (i + 1 < n()) rate = difference(rate, scaled(inverse, links_[i + 1].forced));
      if (i > 0) rate = sum(rate, scaled(inverse_before, difference(link.forced, links_[i - 1].forced)));
      const Real along = dot(link.u, rate) + link.length * dot(link.u_dot, link.turned);
      const Real square = (inverse + inverse_before) * link.length * link.length;
      const Real before =
          i == 0 ? Real(0) : Real(-inverse_before * link.length * links_[i - 1].length * dot(links_[i - 1].u, link.u));
      rows_[i] = row = row.next(square, beyond, before, Real(-link.length * along));
      beyond = before;
    }
    Real kappa(0);
    for (std::size_t i = 0; i < n(); ++i) {
      kappa = rows_[i].offset - rows_[i].coupling * kappa;
      links_[i].forced = sum(links_[i].forced, scaled(Real(kappa * links_[i].length), links_[i].u));
    }
  }

  void write_rates(const Link& link, std::size_t i, const Numbers& faster, Found rates) const {
    Real inverse(1);
    if constexpr (dof == 2) {
      Rod::metric_determinant(link.trig, inverse);
      inverse = 1 / inverse;
    }
    Angles dq, dv;
    Rod::rates(link.trig, inverse, link.turned, dq);
    Rod::rates(link.trig, inverse, difference(faster, bent(link, dq)), dv);
    for (std::size_t a = 0; a < dof; ++a) {
      rates[entry(i, a)] = dq[a];
      rates[dof * n() + entry(i, a)] = dv[a];
    }
  }

  std::vector<Link> links_;
  std::vector<MultiplierRow<Real>> rows_;
};

}  // namespace pendula
