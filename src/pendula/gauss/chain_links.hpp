#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <new>
#include <pendula/chain.hpp>
#include <pendula/gauss/lanes.hpp>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {

namespace detail {

/// What workspaces hold before anybody wrote there: NaN where the build hunts for reads of it, otherwise zero.
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
/// Up to eight more numbers can be read after the last.
template <int PerLink, int N, class Real = double>
class LinkArray {
  static_assert(std::is_trivially_destructible_v<Real>);
  static constexpr int round_up(int count) { return (count + 7) / 8 * 8; }
  static constexpr bool fixed = N != Eigen::Dynamic;

 public:
  explicit LinkArray(int links) {
    const int used = PerLink * links, held = round_up(used);
    if constexpr (!fixed) {
      const auto bytes = static_cast<std::size_t>(held) * sizeof(Real);
      block_.reset(static_cast<Real*>(::operator new (bytes, std::align_val_t{pack_alignment})));
    }
    std::uninitialized_fill(data(), data() + used, unwritten<Real>());
    std::uninitialized_fill(data() + used, data() + held, Real(0));
  }

  Real* operator[](int link) { return data() + static_cast<std::ptrdiff_t>(PerLink) * link; }
  const Real* operator[](int link) const { return data() + static_cast<std::ptrdiff_t>(PerLink) * link; }
  Real* data() { return get(block_); }
  const Real* data() const { return get(block_); }

 private:
  using Fixed = std::array<Real, static_cast<std::size_t>(fixed ? round_up(PerLink* N) : 1)>;
  using Block = std::conditional_t<fixed, Fixed, std::unique_ptr<Real[], AlignedDelete>>;

  template <class Held>
  static auto get(Held& block) {
    if constexpr (fixed) {
      return block.data();
    } else {
      return block.get();
    }
  }

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
template <class Real, std::size_t D>
std::array<Real, D> scaled(const Real& a, const std::array<Real, D>& x) {
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

/// What the sweeps along a chain need to know of one link. Low parts are what a number has lost to rounding: unlike
/// that of a sum, it would act in the same sense step after step.
template <class Real>
struct LinkConstants {
  Real mass{0}, inverse_mass{0};      ///< m, 1/m
  Real length{0}, inverse_length{0};  ///< l, 1/l
  Real inverse_length_low{0};
  Real moment{0}, moment_low{0};  ///< M g l, M the mass that the rod carries
  Real damping{0};                ///< λ

  /// x/l as if 1/l were exact.
  template <class Number>
  Number over_length(const Number& x) const {
    return x * Number(inverse_length) + x * Number(inverse_length_low);
  }
};

/// The constants of a chain link by link, and the load R on a link, f_a = y_a·(l G) + û_a·R, for numbers or packs.
template <class Space, int N = Eigen::Dynamic, class Real = double>
class ChainLinks {
 public:
  using Link = typename Space::Link;

  explicit ChainLinks(const Chain<Space, N>& chain)
      : links_(chain.links()), loaded_(chain.loaded()), constants_(chain.links()) {
    Real carried(0);  // Chain::mass_below in the bits of Real
    for (int i = links(); i-- > 0;) {
      const Real m = Real(chain.masses()[i]), l = Real(chain.lengths()[i]);
      carried += m;
      constants_[i] = link_constants(m, l, carried, Real(chain.gravity()), Real(chain.damping()[i]));
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
  const LinkConstants<Real>& operator[](int link) const { return constants_[link]; }

  /// Weight alone, in the axes of the world.
  template <class Number>
  typename Link::template Cartesian<Number> weight(int link) const {
    typename Link::template Cartesian<Number> load;
    Link::weight_load(Number(constants_[link].moment), load);
    return load;
  }

  /// Adds torque and drag to `load`; everything in the axes of the link's chart.
  template <class Number>
  void add_loads(int link, const typename Link::template Torque<Number>& torque,
                 const typename Link::template Trig<Number>& trig, const typename Link::template Coordinates<Number>& v,
                 typename Link::template Cartesian<Number>& load) const {
    typename Link::template Cartesian<Number> u, u_dot, turning, drag;
    Link::direction(trig, u);
    Link::velocity(trig, v, u_dot);
    Link::torque_load(torque, u, turning);
    Link::drag_load(Number(constants_[link].damping), u_dot, drag);
    load = sum(load, sum(turning, drag));
  }

 private:
  static LinkConstants<Real> link_constants(const Real& m, const Real& l, const Real& M, const Real& g,
                                            const Real& damping) {
    using std::fma;
    const Real inverse = 1 / l, inverse_low = fma(-l, inverse, Real(1)) / l;
    const Real weight = M * g, weight_low = fma(M, g, -weight);
    const Real moment = weight * l, moment_low = fma(weight, l, -moment) + weight_low * l;
    return {m, 1 / m, l, inverse, inverse_low, moment, moment_low, damping};
  }

  int links_;
  bool loaded_;
  detail::PerLink<LinkConstants<Real>, N> constants_;
};

}  // namespace pendula
