#pragma once

#include <pendula/chart.hpp>
#include <pendula/gauss/chain_links.hpp>
#include <pendula/gauss/chain_sweep.hpp>
#include <pendula/space.hpp>

namespace pendula {

/// Where a link stands, as the sweeps need it.
template <class Space, class Real>
struct Placed {
  Chart chart;
  typename Space::Link::template Trig<Real> trig;
};

/// The momenta of one link, and what they lost to rounding. Those of neighbours nearly cancel on a long chain, and what
/// is left is the velocity: without the low parts it would carry the rounding of the sum of all masses.
template <class Coordinates>
struct Momenta {
  Coordinates value, low;
};

/// Hamilton's equations of a chain in O(n): velocities v and forces f of every link from positions and momenta p, in
/// any number type. One sweep inward, then one outward. In space low parts go unused.
template <class Space, class Real, int N = Eigen::Dynamic>
class MotionSweep {
  using Link = typename Space::Link;
  using Coordinates = typename Link::template Coordinates<Real>;
  using Cartesian = typename Link::template Cartesian<Real>;

 public:
  using Inward = typename TensionSweep<Space, Real, N>::Inward;
  using Constants = LinkConstants<ScalarOf<Real>>;

  struct Outward {
    explicit Outward(const Placed<Space, Real>& first) : u(direction(first)) {}

    Cartesian u;  // of the link to come
    typename TensionSweep<Space, Real, N>::Outward tension;
  };

  explicit MotionSweep(int links) : tension_(links), inverse_determinant_(links) {}

  /// i = n−1 … 0.
  void inward(Inward& next, int i, const Constants& link, const Placed<Space, Real>& at,
              const Momenta<Coordinates>& p) {
    Real determinant;
    Link::metric_determinant(at.trig, determinant);
    const Real inverse = Real(1.0) / determinant;
    inverse_determinant_[i] = inverse;
    Cartesian u, across;
    Link::direction(at.trig, u);
    Link::tangent_momentum(at.trig, inverse, scaled(Real(link.inverse_length), p.value), across);
    in_chart<Space>(at.chart,
                    [&](auto chart) { tension_.inward(next, i, link, to_world(chart, u), to_world(chart, across)); });
  }

  /// i = 0 … n−1, with the link after it (of the last link: itself). load(chart, v) is the load R in the axes of the
  /// chart.
  template <class Load>
  void outward(Outward& before, int i, const Constants& link, const Placed<Space, Real>& at,
               const Placed<Space, Real>& next, const Coordinates& p, Load load, Coordinates& v, Coordinates& f) {
    const Real inverse = inverse_determinant_[i];
    const Cartesian next_u = direction(next);
    Cartesian across;
    Link::tangent_momentum(at.trig, inverse, scaled(Real(link.inverse_length), p), across);
    in_chart<Space>(at.chart, [&](auto chart) {
      Cartesian u_dot, G;
      tension_.outward(before.tension, i, link, before.u, next_u, to_world(chart, across), u_dot, G);
      Link::rates(at.trig, inverse, to_chart(chart, u_dot), v);
      Link::force(at.trig, v, to_chart(chart, scaled(Real(link.length), G)), load(chart, v), f);
    });
    before.u = next_u;
  }

 private:
  static Cartesian direction(const Placed<Space, Real>& at) {
    Cartesian u;
    Link::direction(at.trig, u);
    return to_world(at.chart, u);
  }

  TensionSweep<Space, Real, N> tension_;
  detail::PerLink<Real, N> inverse_determinant_;
};

/// In the plane there is one direction across a rod, t = û_θ: vectors are pairs of numbers along u and t, and going to
/// the next link turns them by the angle between the two rods. The same sweep with half the arithmetic, and û_θθ = −û.
///
/// That angle enters by 1 − cos, made of the difference of the directions: rounding of a direction along itself, which
/// no angle has, then drops out, where links are nearly aligned and momenta nearly cancel.
template <class Real, int N>
class MotionSweep<Planar, Real, N> {
  using Link = Planar::Link;
  using Coordinates = typename Link::template Coordinates<Real>;
  using Cartesian = typename Link::template Cartesian<Real>;
  using At = Placed<Planar, Real>;
  using Constants = LinkConstants<ScalarOf<Real>>;

  struct Frame {
    Cartesian u, t;

    explicit Frame(const At& at) {
      typename Link::template First<Real> u_a;
      Link::direction(at.trig, u);
      Link::direction_first(at.trig, u_a);
      t = u_a[0];
    }
  };

  struct Turn {  // from a link to the next
    Real versine, cosine, sine;

    Turn(const Frame& frame, const Cartesian& next_u) {
      const Cartesian onward = difference(next_u, frame.u);
      versine = Real(0.5) * dot(onward, onward);
      cosine = Real(1.0) - versine;
      sine = dot(frame.t, onward);
    }
  };

 public:
  struct Inward {  // of the link just done, with the momentum below it where its rod rests
    Cartesian u{Real(0.0), Real(0.0)};
    Real across{0.0}, across_low{0.0}, gamma{0.0}, pi{0.0};
  };

  struct Outward {  // the link to come, and in its frame the velocity of the bob before
    explicit Outward(const At& first) : at(first) {}

    At at;
    Real along{0.0}, aside{0.0};
  };

  explicit MotionSweep(int links) : last_(links - 1), carried_(links, unwritten()) {}

  void inward(Inward& next, int i, const Constants& link, const At& at, const Momenta<Coordinates>& p) {
    using std::fma;
    const Frame frame(at);
    const Real inverse(link.inverse_length), inverse_low(link.inverse_length_low), m(link.mass);
    const Real across = p.value[0] * inverse;
    const Real across_low = fma(p.value[0], inverse, -across) + (p.value[0] * inverse_low + p.low[0] * inverse);
    if (i == last_) {  // nothing hangs there, and nothing has to be divided
      const Real free = (across + across_low) * Real(link.inverse_mass);
      carried_[i] = {free, Real(0.0), m, Real(0.0)};
      next = {frame.u, across, across_low, Real(0.0), m};
      return;
    }
    const Turn turn(frame, next.u);
    const Real push = next.pi * turn.sine;
    const Real e = Real(1.0) / (m + push * turn.sine);
    const Real pull = push * turn.cosine;
    const Real low = across_low - turn.cosine * next.across_low;
    const Real free = ((across - next.across) + (low + (turn.versine * next.across - turn.sine * next.gamma))) * e;
    const Real gamma = (turn.cosine * next.gamma - turn.sine * next.across) + pull * free;
    const Real pi = (next.pi + m) * (e * m);
    carried_[i] = {free, pull * e, pi, gamma};
    next = {frame.u, across, across_low, gamma, pi};
  }

  template <class Load>
  void outward(Outward& before, int i, const Constants& link, const At& /*at*/, const At& next, const Coordinates&,
               Load load, Coordinates& v, Coordinates& f) {
    const Carried& here = carried_[i];
    const Frame frame(before.at);
    // Of this bob, across the rod; along it, it goes as the bob before.
    const Real w = here.free - before.along * here.coupling;
    const Real turning = w - before.aside;
    v[0] = link.over_length(turning);
    Cartesian weight_low;
    Link::weight_load(Real(link.moment_low), weight_low);
    const Real tension = here.pi * before.along + here.gamma;
    f[0] = dot(frame.t, load(Chart{0}, v)) - (turning * tension - dot(frame.t, weight_low));
    const Turn turn(frame, Frame(next).u);
    const Real along = turn.cosine * before.along + turn.sine * w;
    before.aside = turn.cosine * w - turn.sine * before.along;
    before.along = along;
    before.at = next;
  }

 private:
  struct Carried {
    Real free, coupling, pi, gamma;
  };

  static Carried unwritten() {
    const Real none(detail::unwritten<ScalarOf<Real>>());
    return {none, none, none, none};
  }

  int last_;
  detail::PerLink<Carried, N> carried_;
};

}  // namespace pendula
