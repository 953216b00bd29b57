#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system.hpp>
#include <systems.hpp>

namespace bench {

/// What stands beside the coordinates in a state.
enum class Coordinates { momenta, rates };

/// A generated kernel as explicit equations in numbers of any kind, y = (q, p, t) or (q, q̇, t): each by functions of
/// the kernel that the other does not call.
template <class Real, class Kernel, Coordinates Kind>
class KernelEquations {
 public:
  static constexpr int links = Kernel::coordinates;
  using State = std::array<Real, std::size_t{2} * links + 1>;
  using Rounding = std::function<Real(double)>;

  /// `rounding` makes the parameters of their doubles; inputs are as they stand.
  explicit KernelEquations(
      const pendula::PlainSystem& plain, const Rounding& rounding = [](double value) { return Real(value); })
      : plain_(plain) {
    Rounded::rounding = &rounding;
    typename Kernel::template Parameters<Rounded> rounded;
    Kernel::template read_parameters<Rounded>(plain.parameters, rounded);
    Kernel::cast_parameters(rounded, parameters_);
  }

  State start(const SystemStart& start) const {
    Vector q, v, second;
    for (std::size_t i = 0; i < links; ++i) {
      q.data()[i] = Real(start.q[i]);
      second.data()[i] = v.data()[i] = Real(start.v[i]);
    }
    if constexpr (Kind == Coordinates::momenta) Kernel::momentum_from_velocity(parameters_, q, v, second);
    State y{};
    std::copy_n(q.data(), links, y.data());
    std::copy_n(second.data(), links, y.data() + links);
    return y;
  }

  void derivative(const Real* y, Real* dy) {
    const Eigen::Map<const Vector> q(y), second(y + links);
    const auto inputs = inputs_at(y[2 * links]);
    if constexpr (pendula::holds_time<Kernel>) parameters_.time = y[2 * links];
    Vector v = second, f;
    if constexpr (Kind == Coordinates::momenta) {
      Kernel::template hamiltonian_form<Real>(parameters_, q, second, inputs, v, f);
    } else {
      Kernel::template acceleration<Real>(parameters_, q, second, inputs, f);
    }
    std::copy_n(v.data(), links, dy);
    std::copy_n(f.data(), links, dy + links);
    dy[2 * links] = Real(1);
  }

 private:
  using Vector = typename Kernel::template Vector<Real>;

  // Kernels read parameters as numbers of any type: this one is rounded on the way.
  struct Rounded {
    static inline const Rounding* rounding = nullptr;

    Rounded() = default;
    explicit Rounded(double from) : value((*rounding)(from)) {}
    explicit operator Real() const { return value; }

    Real value{};
  };

  auto inputs_at(const Real& time) const {
    using std::sin;
    typename Kernel::template Inputs<Real> inputs;
    for (Eigen::Index i = 0; i < inputs.size(); ++i) inputs.data()[i] = Real(plain_.inputs[i]);
    for (const pendula::InputSine& sine : plain_.sines) {
      inputs.data()[sine.input] += Real(sine.amplitude) * sin(Real(sine.frequency) * time + Real(sine.phase));
    }
    return inputs;
  }

  pendula::PlainSystem plain_;
  typename Kernel::template Parameters<Real> parameters_;
};

}  // namespace bench
