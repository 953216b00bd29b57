#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain_elimination.hpp>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/chain/rod_frame.hpp>
#include <pendula/numeric/lanes.hpp>

namespace pendula {

/// Variations of the stage equations of a chain at their solution: the quantities of a link there, and the terms by
/// which changes of its start and of its parameters enter.
template <class Space, int S, int N, class Real, class Arch>
class StepVariation : protected ChainElimination<Space, S, N, Real, Arch> {
  using Base = ChainElimination<Space, S, N, Real, Arch>;

 protected:
  using Stages = ChainStages<Space, S, N, Real, Arch>;
  using Base::D, Base::Lanes, Base::s, Base::vectors;
  using typename Base::L, typename Base::Vector, typename Base::Terms;
  using Frame = RodFrame<Space, Real>;
  using Numbers = std::array<Real, D>;
  static constexpr std::size_t torques = Space::torque_components;

  // A variation of the stage equations of a link: r at the stages, and direct changes of ξ and y at the end.
  struct Source {
    Vector residual = Base::zero();
    Numbers rod{}, momentum{};
  };

  static Real total(const L& x) {
    alignas(pack_alignment) Real stored[Lanes];
    x.store(stored);
    Real sum(0);
    for (std::size_t k = 0; k < s; ++k) sum += stored[k];
    return sum;
  }

  // Quantities of link i at its stages and at both ends of the step.
  struct Link {
    Terms terms;
    Vector rod;
    Numbers direction, eta;    // û and y − c ξ at the start
    Real gauge, gauge_at_end;  // c = y·ξ/l²
    Frame frame, frame_at_end;
    Numbers momentum_at_end;
  };

  void find_link(const Stages& stages, int i, const Numbers& y, Link& link) {
    const LinkConstants<Real>& c = stages.constants(i);
    link.rod = stages.place(i);
    const Vector pull = stages.pull(i, link.rod);
    this->set_directions(stages, i, link.rod, link.terms);
    link.terms.tau = stages.multiplier(i);
    this->find_inverse(link.terms);
    const Vector advance = stages.advance(i);
    Numbers along, end;
    for (std::size_t d = 0; d < D; ++d) {
      along[d] = stages.rods().along(i)[d];
      end[d] = along[d] + total(advance[d]);
      link.direction[d] = along[d] * c.inverse_length;
      link.momentum_at_end[d] = y[d] - total(pull[d]);
    }
    link.momentum_at_end[D - 1] -= stages.h() * c.weight;
    link.gauge = dot(along, y) * c.inverse_square;
    link.gauge_at_end = dot(end, link.momentum_at_end) * c.inverse_square;
    link.eta = difference(y, scaled(link.gauge, along));
    link.frame = Frame(link.direction);
    link.frame_at_end = Frame(scaled(c.inverse_length, end));
  }

  /// The variation by a change x of the rod at the start, where y changes by c x only.
  static Source of_rod(const Stages& stages, int i, const Link& link, const Numbers& x) {
    const Real hanging = stages.hanging(i);
    Source source;
    source.rod = x;
    for (std::size_t d = 0; d < D; ++d) {
      source.residual[d] = (link.terms.tau.lanes() + L(link.gauge) - L(hanging) * stages.columns().hc()) * L(x[d]);
      source.momentum[d] = (link.gauge - hanging * stages.h()) * x[d];
    }
    if (stages.loaded()) {
      Vector turned;
      Space::Link::torque_load(stages.torque(i), components<D>([&](std::size_t d) { return L(x[d]); }), turned);
      add_force(stages, turned, source);
    }
    return source;
  }

  static Source of_momentum(const Numbers& y) {
    Source source;
    source.momentum = y;
    for (std::size_t d = 0; d < D; ++d) source.residual[d] = L(y[d]);
    return source;
  }

  // Adds a force at the stages, times h b.
  static void add_force(const Stages& stages, const Vector& force, Source& source) {
    for (std::size_t d = 0; d < D; ++d) {
      source.residual[d] = source.residual[d] + stages.columns().integral(force[d]);
      source.momentum[d] += total(force[d]);
    }
  }

  static Source of_weight(const Stages& stages, const Real& weight) {
    Source source;
    source.residual[D - 1] = -stages.columns().hc() * L(weight);
    source.momentum[D - 1] = -stages.h() * weight;
    return source;
  }

  // −tension times h b times the rod.
  static Vector pull_of(const Stages& stages, const Link& link, const Real& tension) {
    return components<D>([&](std::size_t d) { return stages.columns().hb() * L(-tension) * link.rod[d]; });
  }

  /// The variation by a change of the length with constant angles and momenta: of ξ = l û, y = μ/l + c ξ, and of loads.
  static Source of_length(const Stages& stages, int i, const Link& link) {
    const LinkConstants<Real>& c = stages.constants(i);
    Source source = of_rod(stages, i, link, link.direction);
    const Source momentum = of_momentum(scaled(Real(-c.inverse_length), link.eta));
    source.residual = sum(source.residual, momentum.residual);
    source.momentum = sum(source.momentum, momentum.momentum);
    Vector force = pull_of(stages, link, Real(-stages.hanging(i) * c.inverse_length));
    if (stages.loaded()) {
      const Vector advance = stages.advance(i);
      const L twice(-2 * c.inverse_length);
      Vector turned;
      Space::Link::torque_load(stages.torque(i), link.rod, turned);
      for (std::size_t d = 0; d < D; ++d) force[d] = force[d] + twice * (turned[d] - L(c.drag) * advance[d]);
    }
    add_force(stages, force, source);
    return source;
  }

  static Source of_mass_below(const Stages& stages, int i, const Link& link) {
    Source source = of_weight(stages, Real(stages.chain().gravity()));
    if (stages.hanging(i) != 0) {
      using std::abs;
      const Real gravity = abs(Real(stages.chain().gravity()));
      add_force(stages, pull_of(stages, link, gravity * stages.constants(i).inverse_length), source);
    }
    return source;
  }

  static Source of_gravity(const Stages& stages, int i, const Link& link) {
    const Real gravity = Real(stages.chain().gravity()), mass = Real(stages.chain().mass_below()[i]);
    Source source = of_weight(stages, mass);
    if (stages.hanging(i) != 0) add_force(stages, pull_of(stages, link, stages.hanging(i) / gravity), source);
    return source;
  }

  static Source of_damping(const Stages& stages, int i) {
    Source source;
    const L scale(-stages.constants(i).inverse_square);
    const Vector advance = stages.advance(i);
    add_force(stages, components<D>([&](std::size_t d) { return scale * advance[d]; }), source);
    return source;
  }

  static Source of_torque(const Stages& stages, int i, const Link& link, std::size_t component) {
    Source source;
    std::array<L, torques> torque;
    torque.fill(L(Real(0)));
    torque[component] = stages.columns().hb() * L(stages.constants(i).inverse_square);
    Vector turned;
    Space::Link::torque_load(torque, link.rod, turned);
    add_force(stages, turned, source);
    return source;
  }
};

}  // namespace pendula
