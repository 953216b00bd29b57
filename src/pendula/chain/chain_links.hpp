#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <new>
#include <pendula/chain/chain.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numeric.hpp>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {

namespace detail {

/// The value that workspaces are filled with: NaN in builds that search for reads of unwritten numbers, otherwise zero.
template <class Real>
Real unwritten() {
#ifdef EIGEN_INITIALIZE_MATRICES_BY_NAN
  return std::numeric_limits<Real>::quiet_NaN();
#else
  return Real(0);
#endif
}

struct AlignedDelete {
  void operator()(void* block) const { ::operator delete (block, std::align_val_t{pack_alignment}); }
};

/// `PerLink` numbers a link in one block aligned for packs; on the stack where the number of links N is known.
/// Up to eight more numbers can be read after the last. Assignment of an array of the same size allocates nothing.
template <int PerLink, int N, class Real = double>
class LinkArray {
  static_assert(std::is_trivially_destructible_v<Real>);
  static constexpr int round_up(int count) { return (count + 7) / 8 * 8; }
  static constexpr bool fixed = N != Eigen::Dynamic;

 public:
  explicit LinkArray(int links) : held_(round_up(PerLink * links)) {
    const int used = PerLink * links;
    allocate();
    std::uninitialized_fill(data(), data() + used, unwritten<Real>());
    std::uninitialized_fill(data() + used, data() + held_, Real(0));
  }
  LinkArray(const LinkArray& other) : held_(other.held_) {
    allocate();
    std::uninitialized_copy_n(other.data(), held_, data());
  }
  LinkArray& operator=(const LinkArray& other) {
    if (this == &other) return *this;
    if (std::exchange(held_, other.held_) != other.held_) allocate();
    std::copy_n(other.data(), held_, data());
    return *this;
  }
  ~LinkArray() = default;

  Real* operator[](int link) { return data() + static_cast<std::ptrdiff_t>(PerLink) * link; }
  const Real* operator[](int link) const { return data() + static_cast<std::ptrdiff_t>(PerLink) * link; }
  Real* data() { return get(block_); }
  const Real* data() const { return get(block_); }

 private:
  using Fixed = std::array<Real, static_cast<std::size_t>(fixed ? round_up(PerLink* N) : 1)>;
  using Block = std::conditional_t<fixed, Fixed, std::unique_ptr<Real[], AlignedDelete>>;

  void allocate() {
    if constexpr (!fixed) {
      const auto bytes = static_cast<std::size_t>(held_) * sizeof(Real);
      block_.reset(static_cast<Real*>(::operator new (bytes, std::align_val_t{pack_alignment})));
    }
  }

  template <class Held>
  static auto get(Held& block) {
    if constexpr (fixed) {
      return block.data();
    } else {
      return block.get();
    }
  }

  int held_;
  alignas(pack_alignment) Block block_;
};

/// One T a link; on the stack where the number of links is known.
template <class T, int N>
class PerLink {
 public:
  explicit PerLink(int links, const T& value = T()) {
    if constexpr (N == Eigen::Dynamic) {
      values_.assign(static_cast<std::size_t>(links), value);
    } else {
      values_.fill(value);
    }
  }
  T& operator[](int link) { return values_[static_cast<std::size_t>(link)]; }
  const T& operator[](int link) const { return values_[static_cast<std::size_t>(link)]; }

 private:
  std::conditional_t<N == Eigen::Dynamic, std::vector<T>,
                     std::array<T, static_cast<std::size_t>(N == Eigen::Dynamic ? 1 : N)>>
      values_;
};

}  // namespace detail

/// {component(0), component(1), …}; written out, so that the numbers can stay in registers.
template <std::size_t D, class Component>
auto components(Component component) {
  return [&]<std::size_t... k>(std::index_sequence<k...>) {
    return std::array{component(k)...};
  }
  (std::make_index_sequence<D>());
}

/// a·b.
template <class Real, std::size_t D>
Real dot(const std::array<Real, D>& a, const std::array<Real, D>& b) {
  static_assert(D == 2 || D == 3);
  if constexpr (D == 2) {
    return a[0] * b[0] + a[1] * b[1];
  } else {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
}

/// a x.
template <class Factor, class Real, std::size_t D>
std::array<Real, D> scaled(const Factor& a, const std::array<Real, D>& x) {
  return components<D>([&](std::size_t k) { return a * x[k]; });
}

/// a + b.
template <class Real, std::size_t D>
std::array<Real, D> sum(const std::array<Real, D>& a, const std::array<Real, D>& b) {
  return components<D>([&](std::size_t k) { return a[k] + b[k]; });
}

/// a − b.
template <class Real, std::size_t D>
std::array<Real, D> difference(const std::array<Real, D>& a, const std::array<Real, D>& b) {
  return components<D>([&](std::size_t k) { return a[k] - b[k]; });
}

/// The largest component of a × b: how far b goes across a, exactly zero where both lie along one axis.
template <class Real, std::size_t D>
Real largest_across(const std::array<Real, D>& a, const std::array<Real, D>& b) {
  using std::abs, std::max;
  Real largest = abs(a[0] * b[1] - a[1] * b[0]);
  if constexpr (D == 3) {
    largest = max(largest, abs(a[1] * b[2] - a[2] * b[1]));
    largest = max(largest, abs(a[2] * b[0] - a[0] * b[2]));
  }
  return largest;
}

/// The constants of one link that sweeps along a chain need, of one motion or of several members. The default values
/// are those of unused lanes.
template <class Real>
struct LinkConstants {
  Real mass{1.0}, length{1.0};
  Real inverse_length{1.0}, inverse_square{1.0};     ///< 1/l, 1/l²
  Twofold<Real> inverse_mass{Real(1.0), Real(0.0)};  ///< 1/m
  Real inverse_masses{1.0};  ///< 1/m_i + 1/m_{i−1}, of the bobs at both ends of the rod; 1/m_0 = 0
  Real drag{0.0};            ///< damping: λ/l²
  Real weight{1.0};          ///< M g, M the mass that the rod carries
  Real hanging{0.0};         ///< M |g|/l, tension over length where the chain hangs at rest

  /// Sets the constants of this link for one of several members.
  void set(int member, const LinkConstants<double>& given) {
    const auto take = [member](Real& number, double value) { pendula::set(number, member, value); };
    take(mass, given.mass);
    take(length, given.length);
    take(inverse_length, given.inverse_length);
    take(inverse_square, given.inverse_square);
    take(inverse_mass.value, given.inverse_mass.value);
    take(inverse_mass.low, given.inverse_mass.low);
    take(inverse_masses, given.inverse_masses);
    take(drag, given.drag);
    take(weight, given.weight);
    take(hanging, given.hanging);
  }
};

namespace detail {

/// κ is this many n² |g|/L, for n links of total length L: close to the ω² of a chain's modes.
inline constexpr double slowest_pace_factor = 0.15;

}  // namespace detail

/// κ, the R² of a chain at rest (docs/explanation/steps.md)  [1/s²]; `length` is the sum of the links' lengths.
template <class Real>
Real slowest_pace_squared(Real links, Real gravity, Real length) {
  using std::abs;
  return Real(detail::slowest_pace_factor) * links * links * abs(gravity) / length;
}

/// The constants of a chain link by link.
template <class Space, int N = Eigen::Dynamic, class Real = double>
class ChainLinks {
 public:
  explicit ChainLinks(const Chain<Space, N>& chain)
      : links_(chain.links()), loaded_(chain.loaded()), constants_(chain.links()) {
    Real carried(0);  // Chain::mass_below in the bits of Real
    for (int i = links(); i-- > 0;) {
      LinkConstants<Real>& link = constants_[i];
      const Real l = Real(chain.lengths()[i]);
      link.mass = Real(chain.masses()[i]);
      link.length = l;
      link.inverse_length = 1 / l;
      link.inverse_square = 1 / (l * l);
      link.inverse_mass = reciprocal(link.mass);
      link.inverse_masses = link.inverse_mass.value + (i == 0 ? Real(0) : Real(1 / Real(chain.masses()[i - 1])));
      link.drag = Real(chain.damping()[i]) * link.inverse_square;
      link.weight = (carried += link.mass) * Real(chain.gravity());
      using std::abs, std::max;
      link.hanging = abs(link.weight) * link.inverse_length;
      const Real of_neighbours = link.inverse_masses - (i + 1 < links() ? Real(0) : link.inverse_mass.value);
      fastest_swing_ = max(fastest_swing_, Real((link.inverse_masses + of_neighbours) * link.hanging));
    }
  }

  int links() const {
    if constexpr (N == Eigen::Dynamic) {
      return links_;
    } else {
      return N;
    }
  }
  bool loaded() const { return loaded_; }
  /// Whether a step of h resolves the fastest swinging, (h ω)² <= 4, with a bound of ω² at rest by Gershgorin's
  /// theorem.
  bool resolves(Real h) const { return !(h * h * fastest_swing_ > Real(4)); }
  /// The bound of ω²  [1/s²].
  Real fastest_swing_squared() const { return fastest_swing_; }
  const LinkConstants<Real>& operator[](int link) const { return constants_[link]; }

 private:
  int links_;
  bool loaded_;
  Real fastest_swing_{0};  // ω²  [1/s²]
  detail::PerLink<LinkConstants<Real>, N> constants_;
};

}  // namespace pendula
