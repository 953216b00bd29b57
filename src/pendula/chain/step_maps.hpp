#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <pendula/chain/step_variation.hpp>
#include <pendula/numeric/block.hpp>
#include <pendula/numeric/lanes.hpp>

namespace pendula {

/// The small matrices of ChainTangent, link by link, from the stage equations, linearised and eliminated once along the
/// chain, from the tip to the pivot.
template <class Space, int S, int N, class Real, class Arch>
class StepMaps : private StepVariation<Space, S, N, Real, Arch> {
  using Base = StepVariation<Space, S, N, Real, Arch>;
  using Base::D, Base::s, Base::positive_;
  using Base::find_link, Base::of_rod, Base::of_momentum, Base::of_length, Base::of_mass_below, Base::of_damping,
      Base::of_torque, Base::of_gravity;
  using typename Base::L, typename Base::Link, typename Base::Numbers, typename Base::PerStage, typename Base::Source,
      typename Base::Terms, typename Base::Vector;
  template <std::size_t Rows, std::size_t Columns>
  using Block = detail::Block<Rows, Columns, Real>;

 public:
  using Base::torques, Base::vectors;
  using typename Base::Stages;
  static constexpr std::size_t f = Base::Frame::size, u = Base::unknowns;

 private:
  // Sources of a link: δû, δl, δμ; and the other parameters M (all masses from here on), λ, torque, g.
  static constexpr std::size_t length_at = f, momentum_at = f + 1, sources = 2 * f + 1;

 public:
  static constexpr std::size_t others = 3 + torques;

  struct Maps {
    Real own[u][2 * f];                           // α* of (δû, δμ)
    Real push[u][vectors];                        // J
    Real velocity[vectors][u + f];                // δV of (α, δû)
    Real force[vectors][u + f];                   // B δV of the same
    Real follow[u][vectors];                      // K
    Real end[2 * f][u + 2 * f];                   // (δû, δμ) at the end of (α, δû, δμ)
    Real carried[f][vectors], moved[f][vectors];  // δμ at the end of g, of δw
  };

  struct ParameterMaps {  // of (l, M, λ, torque, g)
    Real own[u][1 + others], end[2 * f][1 + others];
    Real velocity[vectors][1], force[vectors][1];  // of l
    Real bob[vectors][1];                          // δg of the mass: the bob's velocity at the stages
    Real start[D];                                 // Σ z_j up to here: not the bob's velocity, but y is made of it
  };

  explicit StepMaps(int links) : maps_(links), parameter_maps_(links), links_(links) {}

  /// Computes the matrices of the step that was solved and not yet accepted.
  void linearize(const Stages& stages) {
    this->set_coefficients(stages.columns());
    positive_ = true;
    find_bobs(stages);
    CarriedMass carried;
    const int last = links_ - 1;
    for (std::size_t k = 0; k < vectors; ++k)
      carried.mass.set_row(k, carried.mass.unit(k, stages.constants(last).mass));
    for (int i = last; i >= 0; --i) {
      for (std::size_t d = 0; d < D; ++d) carried.momentum[d] += stages.constants(i).mass * parameter_maps_[i].start[d];
      find_maps(stages, i, carried);
    }
  }

  const Maps& of(int i) const { return maps_[i]; }
  const ParameterMaps& of_parameters(int i) const { return parameter_maps_[i]; }

 private:
  struct CarriedMass {
    Block<vectors, vectors> mass;  // B
    Numbers momentum{};            // y
  };

  void find_bobs(const Stages& stages) {
    Numbers start{};
    Vector bob = Base::zero();
    for (int i = 0; i < links_; ++i) {
      ParameterMaps& maps = parameter_maps_[i];
      const Vector U = stages.increments(i);
      for (std::size_t d = 0; d < D; ++d) {
        const Real z = stages.rods().free(i)[d];
        maps.start[d] = start[d] += z;
        bob[d] = bob[d] + fma(U[d], this->inverse_hb_.lanes(), L(z));
        PerStage each;
        each = bob[d];
        for (std::size_t k = 0; k < s; ++k) maps.bob[d * s + k][0] = each[k];
      }
    }
  }

  // Derivatives of y at the end of the step with respect to δV of the stages, and to the residual, through δτ.
  struct EndMomentum {
    Real velocity[D][vectors], residual[D][vectors];  // Λ
  };

  EndMomentum end_momentum(const Stages& stages, int i, const Link& link) const {
    const auto& columns = stages.columns();
    const Terms& terms = link.terms;
    const Real drag = stages.constants(i).drag, hanging = stages.hanging(i);
    EndMomentum end{};
    for (std::size_t j = 0; j < s; ++j) {
      Real later(0);
      for (std::size_t k = 0; k < s; ++k) later += columns.hb(k) * this->ha_[k][j];
      for (std::size_t d = 0; d < D; ++d) {
        end.velocity[d][d * s + j] = -columns.hb(j) * (terms.tau[j] + drag) - hanging * later;
        Real through(0);  // −h b V E₂⁻¹ at stage j
        for (std::size_t k = 0; k < s; ++k) through += columns.hb(k) * terms.velocity[d][k] * terms.inverse[k][j];
        for (std::size_t e = 0; e < D; ++e) end.residual[d][e * s + j] = through * terms.dual[e][j];
      }
    }
    if (stages.loaded()) add_torque(stages, i, end);
    return end;
  }

  void add_torque(const Stages& stages, int i, EndMomentum& end) const {
    for (std::size_t e = 0; e < D; ++e) {
      Vector axis = Base::zero(), turned;
      axis[e] = L(Real(1));
      Space::Link::torque_load(stages.torque(i), axis, turned);
      for (std::size_t d = 0; d < D; ++d) {
        PerStage torque;  // times h b
        torque = turned[d];
        for (std::size_t j = 0; j < s; ++j) {
          for (std::size_t k = 0; k < s; ++k) end.velocity[d][e * s + j] += torque[k] * this->ha_[k][j];
        }
      }
    }
  }

  // A column (δξ, δy) at the end of the step as (δû, δμ).
  static void set_end(const Link& link, const Real& length, const Numbers& rod, const Numbers& momentum, Real* to,
                      std::size_t stride) {
    const auto across = link.frame_at_end.components(difference(momentum, scaled(link.gauge_at_end, rod)));
    const auto turned = link.frame_at_end.components(rod);
    for (std::size_t a = 0; a < f; ++a) {
      to[a * stride] = turned[a] / length;
      to[(f + a) * stride] = length * across[a];
    }
  }

  static Numbers product(const Real (&a)[D][vectors], const Real* x, std::size_t stride) {
    return components<D>([&](std::size_t d) {
      Real sum(0);
      for (std::size_t v = 0; v < vectors; ++v) sum += a[d][v] * x[v * stride];
      return sum;
    });
  }

  void find_maps(const Stages& stages, int i, CarriedMass& carried) {
    static constexpr std::size_t slipping = u + f + 1, all = u + sources;
    const Real length = stages.constants(i).length;
    Link link;
    find_link(stages, i, carried.momentum, link);
    std::array<Source, sources> source;
    PerStage slips[f + 1];
    for (std::size_t a = 0; a < f; ++a) {
      source[a] = of_rod(stages, i, link, scaled(length, link.frame.vector(a)));
      source[momentum_at + a] = of_momentum(scaled(stages.constants(i).inverse_length, link.frame.vector(a)));
    }
    source[length_at] = of_length(stages, i, link);
    for (std::size_t a = 0; a <= f; ++a) {
      L slip(Real(0));
      for (std::size_t d = 0; d < D; ++d) slip = fma(link.terms.velocity[d].lanes(), L(source[a].rod[d]), slip);
      slips[a] = slip;
    }
    Block<vectors, slipping> Z, BZ, own;
    Block<u, vectors> push;
    this->find_null_space(link.terms, slips, Z);
    this->find_annihilator(link.terms, push);
    set_product(carried.mass, Z, BZ);
    this->subtract_own(stages, i, link.terms, Z, BZ, own);
    Block<vectors, all> whole;  // (B − N) (Z, v₀) − r
    for (std::size_t v = 0; v < vectors; ++v) {
      std::copy_n(own[v], slipping, whole[v]);
      std::fill_n(whole[v] + slipping, Block<vectors, all>::stride - slipping, Real(0));
    }
    for (std::size_t c = 0; c < sources; ++c) {
      for (std::size_t d = 0; d < D; ++d) {
        PerStage residual;
        residual = source[c].residual[d];
        for (std::size_t k = 0; k < s; ++k) whole[d * s + k][u + c] -= residual[k];
      }
    }
    Block<u, all> pivots;
    set_product(push, whole, pivots);
    positive_ = detail::solve_negated(pivots, push) && positive_;
    Block<u, vectors> follow;
    set_product(push, carried.mass, follow);
    const EndMomentum end = end_momentum(stages, i, link);
    keep(stages, i, link, source, Z, BZ, whole, pivots, push, follow, end, carried);
    keep_others(stages, i, link, push, end);
    if (i > 0) hand_on(BZ, follow, stages.constants(i - 1).mass, carried);
  }

  template <class Sources, class Slipping, class Whole, class Pivots>
  void keep(const Stages& stages, int i, const Link& link, const Sources& source, const Slipping& Z, const Slipping& BZ,
            const Whole& whole, const Pivots& pivots, const Block<u, vectors>& push, const Block<u, vectors>& follow,
            const EndMomentum& end, const CarriedMass& carried) {
    Maps& maps = maps_[i];
    ParameterMaps& parameter = parameter_maps_[i];
    for (std::size_t r = 0; r < u; ++r) {
      std::copy_n(push[r], vectors, maps.push[r]);
      std::copy_n(follow[r], vectors, maps.follow[r]);
      std::copy_n(pivots[r] + u, f, maps.own[r]);
      std::copy_n(pivots[r] + u + momentum_at, f, maps.own[r] + f);
      parameter.own[r][0] = pivots[r][u + length_at];
    }
    for (std::size_t v = 0; v < vectors; ++v) {
      std::copy_n(Z[v], u + f, maps.velocity[v]);
      std::copy_n(BZ[v], u + f, maps.force[v]);
      parameter.velocity[v][0] = Z[v][u + length_at];
      parameter.force[v][0] = BZ[v][u + length_at];
    }
    // Columns (α, δû, δl, δμ) of the end.
    const Real length = stages.constants(i).length;
    Real ends[2 * f][u + sources];
    for (std::size_t c = 0; c < u + sources; ++c) {
      Numbers rod{}, momentum{};
      if (c >= u) {
        rod = source[c - u].rod;
        momentum = source[c - u].momentum;
      }
      const bool slips = c < u + f + 1;
      Real across[vectors];
      for (std::size_t v = 0; v < vectors; ++v) across[v] = whole[v][c] - (slips ? BZ[v][c] : Real(0));
      momentum = sum(momentum, product(end.residual, across, 1));
      if (slips) {
        momentum = sum(momentum, product(end.velocity, Z[0] + c, Slipping::stride));
        for (std::size_t d = 0; d < D; ++d) {
          for (std::size_t k = 0; k < s; ++k) rod[d] += stages.columns().hb(k) * Z[d * s + k][c];
        }
      }
      set_end(link, length, rod, momentum, &ends[0][c], u + sources);
    }
    const auto grown = link.frame_at_end.components(link.momentum_at_end);
    for (std::size_t r = 0; r < 2 * f; ++r) {
      std::copy_n(ends[r], u + f, maps.end[r]);
      std::copy_n(ends[r] + u + momentum_at, f, maps.end[r] + u + f);
      parameter.end[r][0] = ends[r][u + length_at] + (r < f ? Real(0) : grown[r < f ? 0 : r - f]);
    }
    for (std::size_t v = 0; v < vectors; ++v) {
      const auto of_residual =
          link.frame_at_end.components(components<D>([&](std::size_t d) { return Real(length * end.residual[d][v]); }));
      for (std::size_t a = 0; a < f; ++a) maps.carried[a][v] = of_residual[a];
    }
    for (std::size_t a = 0; a < f; ++a) {
      for (std::size_t v = 0; v < vectors; ++v) {
        Real sum(0);
        for (std::size_t k = 0; k < vectors; ++k) sum += maps.carried[a][k] * carried.mass[k][v];
        maps.moved[a][v] = sum;
      }
    }
  }

  // Keeps the maps of parameters that change forces only.
  void keep_others(const Stages& stages, int i, const Link& link, const Block<u, vectors>& push,
                   const EndMomentum& end) {
    ParameterMaps& maps = parameter_maps_[i];
    const auto keep = [&](std::size_t column, const Source& source) {
      Real residual[vectors];
      for (std::size_t d = 0; d < D; ++d) {
        PerStage each;
        each = source.residual[d];
        for (std::size_t k = 0; k < s; ++k) residual[d * s + k] = -each[k];
      }
      for (std::size_t r = 0; r < u; ++r) {
        Real sum(0);
        for (std::size_t v = 0; v < vectors; ++v) sum += push[r][v] * residual[v];
        maps.own[r][column] = sum;
      }
      set_end(link, stages.constants(i).length, source.rod, sum(source.momentum, product(end.residual, residual, 1)),
              &maps.end[0][column], 1 + others);
    };
    keep(1, of_mass_below(stages, i, link));
    keep(2, of_damping(stages, i));
    for (std::size_t k = 0; k < torques; ++k) keep(3 + k, of_torque(stages, i, link, k));
    keep(3 + torques, of_gravity(stages, i, link));
  }

  // B ← B + B Z K with the mass of the bob before on its diagonal; y of the link before is still without that bob.
  template <class Slipping>
  static void hand_on(const Slipping& BZ, const Block<u, vectors>& follow, const Real& mass_before,
                      CarriedMass& carried) {
    using BlockRow = typename Block<vectors, vectors>::Row;
    for (std::size_t v = 0; v < vectors; ++v) {
      BlockRow row = carried.mass.row(v) + carried.mass.unit(v, mass_before);
      for (std::size_t r = 0; r < u; ++r) row = fma(BlockRow(BZ[v][r]), follow.row(r), row);
      carried.mass.set_row(v, row);
    }
  }

  detail::PerLink<Maps, N> maps_;
  detail::PerLink<ParameterMaps, N> parameter_maps_;
  int links_;
};

}  // namespace pendula
