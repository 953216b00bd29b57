#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <pendula/chain/step_maps.hpp>
#include <pendula/numeric/lanes.hpp>
#include <vector>

namespace pendula {

namespace detail {

/// y_i += Σ_j entry(i, j) x_j for rows x, y of packs: many right-hand sides at once, four rows of y kept in registers.
template <std::size_t Rows, std::size_t Columns, class Row, class Entry>
void add_product_of(Entry entry, const Row* x, Row* y) {
  constexpr std::size_t together = 4;
  for (std::size_t begin = 0; begin < Rows; begin += together) {
    const std::size_t count = std::min(together, Rows - begin);
    Row sums[together];
    for (std::size_t i = 0; i < count; ++i) sums[i] = y[begin + i];
    for (std::size_t j = 0; j < Columns; ++j) {
      for (std::size_t i = 0; i < count; ++i) sums[i] = fma(Row(entry(begin + i, j)), x[j], sums[i]);
    }
    for (std::size_t i = 0; i < count; ++i) y[begin + i] = sums[i];
  }
}

/// y += A x for a small matrix A.
template <std::size_t Rows, std::size_t Columns, class Real, class Row>
void add_product(const Real (&a)[Rows][Columns], const Row* x, Row* y) {
  add_product_of<Rows, Columns>([&](std::size_t i, std::size_t j) { return a[i][j]; }, x, y);
}

/// y += Aᵀ x.
template <std::size_t Rows, std::size_t Columns, class Real, class Row>
void add_transposed_product(const Real (&a)[Rows][Columns], const Row* x, Row* y) {
  add_product_of<Columns, Rows>([&](std::size_t i, std::size_t j) { return a[j][i]; }, x, y);
}

}  // namespace detail

/// The exact derivative of one discrete Gauss step of a chain. The stage equations of chain_elimination.hpp are
/// linearised at their solution (implicit function theorem) and eliminated once along the chain, in O(n). Then each
/// direction takes O(n).
///
/// A tangent has, for each link i, the change δû_i of its direction, and the change δμ_i of its angular momentum across
/// the direction,
///   μ_i = l_i (y_i − (y_i·ξ_i/l_i²) ξ_i).
/// First come all δû  [1], link by link, then all δμ  [N m s]. In the plane they are δθ_i and δp_i, p = ∂L/∂θ̇. In
/// space each is a vector across û in the axes of the world, so that poles need no care; a part along û that a seed has
/// is left out. The form Σ δû·δμ' − δμ·δû' is kept where nothing damps.
///
/// Parameters are the masses, lengths, dampings of all links, gravity, and then the components of a torque on every
/// link that is constant through the step, (3n + 1 + torque_components n)  [kg, m, N m s, m/s², N m].
///
/// A variation changes the sums q(k) of a link by r(k) at given V, and X·V by `slip`. With the names of ChainNewton and
/// J = −S⁻¹ L, inward
///   α* = J ((B − N) v₀ + g − r),  g ← g + B (v₀ + Z α*),
/// outward δV = v₀ + Z (α* + K δw_{i−1}), and multipliers and momenta follow with
///   δτ = E₂⁻¹ X̂·(g + B δw − r − N δV),  δy = Σ_j h b_j δf(j).
/// All of this is linear: its small matrices are kept, and the adjoint applies their transposes in reverse order.
template <class Space, int S, int N = Eigen::Dynamic, class RealType = double, class Arch = xsimd::default_arch>
class ChainTangent {
  using Maps = StepMaps<Space, S, N, RealType, Arch>;

 public:
  using Real = RealType;
  using Stages = typename Maps::Stages;

  explicit ChainTangent(int links)
      : maps_(links),
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

  /// Computes the derivative of the step that was solved and not yet accepted.
  void linearize(const Stages& stages) { maps_.linearize(stages); }

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

  /// The same, and adds gradients with respect to the parameters to `parameters`, (parameters x count).
  void pull(Real* gradients, int count, Real* parameters) {
    in_rows(gradients, count, [&](int begin, int columns) {
      load(parameters + begin, count, columns, numbers_);
      pull_rows<true>();
      store(parameters + begin, count, columns, numbers_);
    });
  }

 private:
  static constexpr std::size_t f = Maps::f, u = Maps::u, vectors = Maps::vectors, others = Maps::others,
                               torques = Maps::torques;

  // Number of directions that go through the chain together, in the lanes of a Row.
  static constexpr int width = 2 * detail::register_size<RegisterFor<8, Real>>;
  static constexpr auto held = static_cast<std::size_t>(width);
  using Row = Pack<width, RegisterFor<width, Real>>;

  static std::size_t count(int links) { return static_cast<std::size_t>(links); }
  static int parameters(int links) { return (3 + static_cast<int>(torques)) * links + 1; }

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

  // Loads as many columns as a Row holds, calls through(first column, columns), and stores them; for all columns.
  template <class Through>
  void in_rows(Real* tangents, int count, Through through) {
    for (int begin = 0; begin < count; begin += width) {
      const int columns = std::min(width, count - begin);
      load(tangents + begin, count, columns, rows_);
      through(begin, columns);
      store(tangents + begin, count, columns, rows_);
    }
  }

  // Rows of one link: δû, δμ, and its parameters.
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

  // The outermost link with a change at the start; links beyond it can be skipped on the way in.
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
      const auto& maps = maps_.of(i);
      Row x[u + 2 * f];
      std::fill_n(x, u, Row(Real(0)));
      std::copy_n(directions(i), f, x + u);
      std::copy_n(momenta(i), f, x + u + f);
      detail::add_product(maps.own, x + u, x);
      if constexpr (Parameters) {
        detail::add_product(maps_.of_parameters(i).bob, &mass(i), g);
        mass_below = mass_below + mass(i);
        below_[count(i)] = mass_below;
        detail::add_product(maps_.of_parameters(i).own, varied(i).data(), x);
      }
      detail::add_product(maps.push, g, x);
      std::copy_n(x, u, alpha_.data() + count(i) * u);
      Row* momentum = momentum_.data() + count(i) * f;
      std::fill_n(momentum, f, Row(Real(0)));
      detail::add_product(maps.carried, g, momentum);
      detail::add_product(maps.force, x, g);
      if constexpr (Parameters) detail::add_product(maps_.of_parameters(i).force, &length(i), g);
    }
    push_out<Parameters>();
  }

  template <bool Parameters>
  PENDULA_IN_REGISTERS void push_out() {
    Row w[vectors];
    std::fill_n(w, vectors, Row(Real(0)));
    for (int i = 0; i < links_; ++i) {
      const auto& maps = maps_.of(i);
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
        detail::add_product(maps_.of_parameters(i).velocity, &length(i), w);
        detail::add_product(maps_.of_parameters(i).end, varied(i).data(), end);
      }
      detail::add_product(maps.moved, w, end + f);
      std::copy_n(end, f, directions(i));
      std::copy_n(end + f, f, momenta(i));
    }
  }

  // Adds gradients with respect to the parameters of link i. Returns that of M.
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
      const auto& maps = maps_.of(i);
      Row x[u + 2 * f], end[2 * f];
      std::fill_n(x, u + 2 * f, Row(Real(0)));
      std::copy_n(directions(i), f, end);
      std::copy_n(momenta(i), f, end + f);
      detail::add_transposed_product(maps.moved, end + f, w);
      detail::add_transposed_product(maps.end, end, x);
      detail::add_transposed_product(maps.velocity, w, x);
      if constexpr (Parameters) {
        below_[count(i)] = pull_parameters(i, maps_.of_parameters(i).end, end, maps_.of_parameters(i).velocity, w);
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
    Row before(Real(0));  // sum of the gradients of M_j, j up to here: each M_j contains the mass of this bob
    for (int i = 0; i < links_; ++i) {
      const auto& maps = maps_.of(i);
      Row x[u + 2 * f];
      std::copy_n(alpha_.data() + count(i) * u, u, x);
      std::copy_n(directions(i), f, x + u);
      std::copy_n(momenta(i), f, x + u + f);
      detail::add_transposed_product(maps.force, g, x);
      detail::add_transposed_product(maps.own, x, x + u);
      if constexpr (Parameters) {
        before = before + below_[count(i)] +
                 pull_parameters(i, maps_.of_parameters(i).own, x, maps_.of_parameters(i).force, g);
        mass(i) = mass(i) + before;
      }
      detail::add_transposed_product(maps.push, x, g);
      detail::add_transposed_product(maps.carried, momentum_.data() + count(i) * f, g);
      if constexpr (Parameters) detail::add_transposed_product(maps_.of_parameters(i).bob, g, &mass(i));
      std::copy_n(x + u, f, directions(i));
      std::copy_n(x + u + f, f, momenta(i));
    }
  }

  Maps maps_;
  std::vector<Row> alpha_, momentum_;  // of all links: α, and the part of δμ at the end that comes from g
  std::vector<Row> rows_, numbers_;    // tangents, parameters
  std::vector<Row> below_;             // M
  int links_;
};

}  // namespace pendula
