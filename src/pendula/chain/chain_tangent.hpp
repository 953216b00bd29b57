#pragma once

#include <algorithm>
#include <array>
#include <pendula/chain/chain_elimination.hpp>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/chain/rod_frame.hpp>
#include <pendula/numeric/block.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/row_product.hpp>
#include <vector>

namespace pendula {

/// The derivative of one Gauss step of a chain, exactly that of the discrete step: the stage equations of
/// chain_elimination.hpp, linearised where they are solved (implicit function theorem), eliminated once along the chain
/// in O(n), and then applied to any direction in O(n).
///
/// Coordinates of the tangent space are δû_i, of the directions, and δμ_i, of the angular momenta across them,
///   μ_i = l_i (y_i − (y_i·ξ_i/l_i²) ξ_i),
/// in components of RodFrame: all δû, link by link  [1], then all δμ  [N m s]. In the plane they are δθ and δp, p =
/// ∂L/∂θ̇; in space the three components of vectors across û in the axes of the world, so that nothing happens at a pole
/// (what a seed has along û is left out). The form Σ δû·δμ' − δμ·δû' is kept where nothing damps.
///
/// Parameters are the masses, lengths, dampings of all links, gravity, and then the components of a torque on every
/// link that is constant through the step, (3n + 1 + torque_components n)  [kg, m, N m s, m/s², N m].
///
/// A variation changes the sums q(k) of a link by r(k) at given V, and X·V by `slip`. With the names of ChainNewton and
/// J = −S⁻¹ L, inward
///   α* = J ((B − N) v₀ + g − r),  g ← g + B (v₀ + Z α*),
/// outward δV = v₀ + Z (α* + K δw_{i−1}), and multipliers and momenta follow with
///   δτ = E₂⁻¹ X̂·(g + B δw − r − N δV),  δy = Σ_j h b_j δf(j).
/// All of this is linear, so that its small matrices are kept; the adjoint goes through their transposes, the other
/// way.
template <class Space, int S, int N = Eigen::Dynamic, class RealType = double, class Arch = xsimd::default_arch>
class ChainTangent : private ChainElimination<Space, S, N, RealType, Arch> {
  using Base = ChainElimination<Space, S, N, RealType, Arch>;

 public:
  using Real = RealType;
  using Stages = ChainStages<Space, S, N, Real, Arch>;

  explicit ChainTangent(int links)
      : maps_(links),
        parameter_maps_(links),
        alpha_(count(links) * u),
        momentum_(count(links) * f),
        rows_(static_cast<std::size_t>(2 * links) * f),
        numbers_(static_cast<std::size_t>(parameters(links))),
        below_(count(links)),
        links_(links) {}

  /// Rows of a tangent.
  int size() const { return 2 * static_cast<int>(f) * links_; }
  /// Rows of a variation of the parameters.
  int parameters() const { return parameters(links_); }

  /// The derivative of the step whose stages are found and that was not accepted yet.
  void linearize(const Stages& stages) {
    this->set_coefficients(stages.columns());
    positive_ = true;
    find_bobs(stages);
    Carried carried;
    const int last = links_ - 1;
    for (std::size_t k = 0; k < vectors; ++k)
      carried.mass.set_row(k, carried.mass.unit(k, stages.constants(last).mass));
    for (int i = last; i >= 0; --i) {
      for (std::size_t d = 0; d < D; ++d) carried.momentum[d] += stages.constants(i).mass * parameter_maps_[i].start[d];
      find_maps(stages, i, carried);
    }
  }

  /// Replaces tangents at the start of the step, (size x count) row by row, by those at its end.
  void push(Real* tangents, int count) {
    in_rows(tangents, count, [&](int, int) { push_rows<false>(); });
  }

  /// The same where parameters are varied, too, by (parameters x count).
  void push(Real* tangents, int count, const Real* parameters) {
    in_rows(tangents, count, [&](int begin, int columns) {
      load(parameters + begin, count, columns, numbers_);
      push_rows<true>();
    });
  }

  /// The transpose: replaces gradients with respect to the end of the step, (size x count), by those with respect to
  /// its start.
  void pull(Real* gradients, int count) {
    in_rows(gradients, count, [&](int, int) { pull_rows<false>(); });
  }

  /// Adds those with respect to the parameters, too, to (parameters x count).
  void pull(Real* gradients, int count, Real* parameters) {
    in_rows(gradients, count, [&](int begin, int columns) {
      load(parameters + begin, count, columns, numbers_);
      pull_rows<true>();
      store(parameters + begin, count, columns, numbers_);
    });
  }

 private:
  using Base::D, Base::Lanes, Base::s, Base::unknowns, Base::vectors, Base::positive_;
  using typename Base::L, typename Base::Vector, typename Base::PerStage, typename Base::Terms;
  template <std::size_t Rows, std::size_t Columns>
  using Block = detail::Block<Rows, Columns, Real>;
  using Frame = RodFrame<Space, Real>;
  using Numbers = std::array<Real, D>;

  static constexpr std::size_t f = Frame::size, u = unknowns, torques = Space::torque_components;
  // Sources of a link: δû, δl, δμ; and the other parameters M (all masses from here on), λ, torque, g.
  static constexpr std::size_t length_at = f, momentum_at = f + 1, sources = 2 * f + 1, others = 3 + torques;

  // Right-hand sides that go through the chain together, a row of them a pack.
  static constexpr int width = 2 * detail::register_size<RegisterFor<8, Real>>;
  static constexpr auto held = static_cast<std::size_t>(width);
  using Row = Pack<width, RegisterFor<width, Real>>;

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
    Real start[D];                                 // Σ z_j up to here: not the bob's velocity, but what y is made of
  };

  struct Carried {
    Block<vectors, vectors> mass;  // B
    Numbers momentum{};            // y
  };

  // A variation of the stage equations of a link, times nothing: r at the stages; of δξ and δy at the end.
  struct Source {
    Vector residual = Base::zero();
    Numbers rod{}, momentum{};
  };

  static std::size_t count(int links) { return static_cast<std::size_t>(links); }
  static int parameters(int links) { return (3 + static_cast<int>(torques)) * links + 1; }

  static Real total(const L& x) {
    alignas(pack_alignment) Real stored[Lanes];
    x.store(stored);
    Real sum(0);
    for (std::size_t k = 0; k < s; ++k) sum += stored[k];
    return sum;
  }

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

  // What link i has at its stages and at both ends of the step.
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

  /// What a change x of the rod at the start does, y − c x apart unchanged.
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

  // A force at the stages, times h b.
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

  // h b times the rod.
  static Vector pull_of(const Stages& stages, const Link& link, const Real& tension) {
    return components<D>([&](std::size_t d) { return stages.columns().hb() * L(-tension) * link.rod[d]; });
  }

  /// What the length changes where angles and their momenta stay: ξ = l û, y = μ/l + c ξ, and what loads depend on.
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

  // What δV and δτ of the stages do to y by the end of the step: of δV, and of what is across the residual.
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

  void find_maps(const Stages& stages, int i, Carried& carried) {
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
            const EndMomentum& end, const Carried& carried) {
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

  // Parameters that change nothing but the forces.
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
  static void hand_on(const Slipping& BZ, const Block<u, vectors>& follow, const Real& mass_before, Carried& carried) {
    using BlockRow = typename Block<vectors, vectors>::Row;
    for (std::size_t v = 0; v < vectors; ++v) {
      BlockRow row = carried.mass.row(v) + carried.mass.unit(v, mass_before);
      for (std::size_t r = 0; r < u; ++r) row = fma(BlockRow(BZ[v][r]), follow.row(r), row);
      carried.mass.set_row(v, row);
    }
  }

  // --- Many directions at once ---

  void load(const Real* from, int stride, int columns, std::vector<Row>& rows) const {
    alignas(pack_alignment) Real row[held] = {};
    for (std::size_t r = 0; r < rows.size(); ++r) {
      std::copy_n(from + static_cast<std::ptrdiff_t>(r) * stride, columns, row);
      rows[r] = Row::load(row);
    }
  }
  void store(Real* to, int stride, int columns, const std::vector<Row>& rows) const {
    alignas(pack_alignment) Real row[held];
    for (std::size_t r = 0; r < rows.size(); ++r) {
      rows[r].store(row);
      std::copy_n(row, columns, to + static_cast<std::ptrdiff_t>(r) * stride);
    }
  }

  // through(first column, columns) between loading and storing as many as a row holds.
  template <class Through>
  void in_rows(Real* tangents, int count, Through through) {
    for (int begin = 0; begin < count; begin += width) {
      const int columns = std::min(width, count - begin);
      load(tangents + begin, count, columns, rows_);
      through(begin, columns);
      store(tangents + begin, count, columns, rows_);
    }
  }

  // Rows of one link, of all that it is varied by.
  Row* directions(int i) { return rows_.data() + count(i) * f; }
  Row* momenta(int i) { return rows_.data() + count(links_ + i) * f; }
  Row& mass(int i) { return numbers_[count(i)]; }
  Row& length(int i) { return numbers_[count(links_ + i)]; }
  Row& damping(int i) { return numbers_[count(2 * links_ + i)]; }
  Row& gravity() { return numbers_[count(3 * links_)]; }
  Row& torque(int i, std::size_t k) { return numbers_[count(3 * links_ + 1) + count(i) * torques + k]; }

  using Varied = std::array<Row, 1 + others>;
  Varied varied(int i) {
    Varied varied;
    varied[0] = length(i);
    varied[1] = below_[count(i)];
    varied[2] = damping(i);
    for (std::size_t k = 0; k < torques; ++k) varied[3 + k] = torque(i, k);
    varied[3 + torques] = gravity();
    return varied;
  }

  static bool is_zero(const Row& row) {
    alignas(pack_alignment) Real numbers[held];
    row.store(numbers);
    return std::all_of(numbers, numbers + held, [](const Real& x) { return x == 0; });
  }

  // Links beyond feel nothing on the way in.
  int outermost() {
    for (int i = links_ - 1; i > 0; --i) {
      for (std::size_t a = 0; a < f; ++a) {
        if (!is_zero(directions(i)[a]) || !is_zero(momenta(i)[a])) return i;
      }
    }
    return 0;
  }

  template <bool Parameters>
  PENDULA_IN_REGISTERS void push_rows() {
    const int from = Parameters ? links_ - 1 : outermost();
    std::fill(alpha_.begin() + static_cast<std::ptrdiff_t>(u) * (from + 1), alpha_.end(), Row(Real(0)));
    std::fill(momentum_.begin() + static_cast<std::ptrdiff_t>(f) * (from + 1), momentum_.end(), Row(Real(0)));
    Row g[vectors], mass_below(Real(0));
    std::fill_n(g, vectors, Row(Real(0)));
    for (int i = from; i >= 0; --i) {
      const Maps& maps = maps_[i];
      Row x[u + 2 * f];
      std::fill_n(x, u, Row(Real(0)));
      std::copy_n(directions(i), f, x + u);
      std::copy_n(momenta(i), f, x + u + f);
      detail::add_product(maps.own, x + u, x);
      if constexpr (Parameters) {
        detail::add_product(parameter_maps_[i].bob, &mass(i), g);
        mass_below = mass_below + mass(i);
        below_[count(i)] = mass_below;
        detail::add_product(parameter_maps_[i].own, varied(i).data(), x);
      }
      detail::add_product(maps.push, g, x);
      std::copy_n(x, u, alpha_.data() + count(i) * u);
      Row* momentum = momentum_.data() + count(i) * f;
      std::fill_n(momentum, f, Row(Real(0)));
      detail::add_product(maps.carried, g, momentum);
      detail::add_product(maps.force, x, g);
      if constexpr (Parameters) detail::add_product(parameter_maps_[i].force, &length(i), g);
    }
    push_out<Parameters>();
  }

  template <bool Parameters>
  PENDULA_IN_REGISTERS void push_out() {
    Row w[vectors];
    std::fill_n(w, vectors, Row(Real(0)));
    for (int i = 0; i < links_; ++i) {
      const Maps& maps = maps_[i];
      Row x[u + 2 * f], end[2 * f];
      std::copy_n(alpha_.data() + count(i) * u, u, x);
      std::copy_n(directions(i), f, x + u);
      std::copy_n(momenta(i), f, x + u + f);
      detail::add_product(maps.follow, w, x);
      detail::add_product(maps.velocity, x, w);
      std::fill_n(end, f, Row(Real(0)));
      std::copy_n(momentum_.data() + count(i) * f, f, end + f);
      detail::add_product(maps.end, x, end);
      if constexpr (Parameters) {
        detail::add_product(parameter_maps_[i].velocity, &length(i), w);
        detail::add_product(parameter_maps_[i].end, varied(i).data(), end);
      }
      detail::add_product(maps.moved, w, end + f);
      std::copy_n(end, f, directions(i));
      std::copy_n(end + f, f, momenta(i));
    }
  }

  // Adds gradients with respect to the parameters of link i; gives that of M.
  template <class Map, class OfLength>
  Row pull_parameters(int i, const Map& map, const Row* x, const OfLength& of_length, const Row* y) {
    Varied sums;
    sums.fill(Row(Real(0)));
    detail::add_transposed_product(map, x, sums.data());
    detail::add_transposed_product(of_length, y, sums.data());
    length(i) = length(i) + sums[0];
    damping(i) = damping(i) + sums[2];
    for (std::size_t k = 0; k < torques; ++k) torque(i, k) = torque(i, k) + sums[3 + k];
    gravity() = gravity() + sums[3 + torques];
    return sums[1];
  }

  template <bool Parameters>
  PENDULA_IN_REGISTERS void pull_rows() {
    Row w[vectors];
    std::fill_n(w, vectors, Row(Real(0)));
    for (int i = links_ - 1; i >= 0; --i) {
      const Maps& maps = maps_[i];
      Row x[u + 2 * f], end[2 * f];
      std::fill_n(x, u + 2 * f, Row(Real(0)));
      std::copy_n(directions(i), f, end);
      std::copy_n(momenta(i), f, end + f);
      detail::add_transposed_product(maps.moved, end + f, w);
      detail::add_transposed_product(maps.end, end, x);
      detail::add_transposed_product(maps.velocity, w, x);
      if constexpr (Parameters) {
        below_[count(i)] = pull_parameters(i, parameter_maps_[i].end, end, parameter_maps_[i].velocity, w);
      }
      detail::add_transposed_product(maps.follow, x, w);
      std::copy_n(x, u, alpha_.data() + count(i) * u);
      std::copy_n(end + f, f, momentum_.data() + count(i) * f);
      std::copy_n(x + u, f, directions(i));
      std::copy_n(x + u + f, f, momenta(i));
    }
    pull_out<Parameters>();
  }

  template <bool Parameters>
  PENDULA_IN_REGISTERS void pull_out() {
    Row g[vectors];
    std::fill_n(g, vectors, Row(Real(0)));
    Row before(Real(0));  // gradients of M_j, j up to here: all that the mass of this bob is in
    for (int i = 0; i < links_; ++i) {
      const Maps& maps = maps_[i];
      Row x[u + 2 * f];
      std::copy_n(alpha_.data() + count(i) * u, u, x);
      std::copy_n(directions(i), f, x + u);
      std::copy_n(momenta(i), f, x + u + f);
      detail::add_transposed_product(maps.force, g, x);
      detail::add_transposed_product(maps.own, x, x + u);
      if constexpr (Parameters) {
        before = before + below_[count(i)] + pull_parameters(i, parameter_maps_[i].own, x, parameter_maps_[i].force, g);
        mass(i) = mass(i) + before;
      }
      detail::add_transposed_product(maps.push, x, g);
      detail::add_transposed_product(maps.carried, momentum_.data() + count(i) * f, g);
      if constexpr (Parameters) detail::add_transposed_product(parameter_maps_[i].bob, g, &mass(i));
      std::copy_n(x + u, f, directions(i));
      std::copy_n(x + u + f, f, momenta(i));
    }
  }

  detail::PerLink<Maps, N> maps_;
  detail::PerLink<ParameterMaps, N> parameter_maps_;
  std::vector<Row> alpha_, momentum_;  // of all links: α, and what μ ends with of g
  std::vector<Row> rows_, numbers_;    // tangents, parameters
  std::vector<Row> below_;             // M
  int links_;
};

}  // namespace pendula
