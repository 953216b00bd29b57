// Where a model is at given times: the equations of model_equations.py, which SymPy derives from the Lagrangian as it
// was written and a C compiler compiles for 80-bit numbers, moved as chain_reference moves chains.
//
// usage: model_reference LIBRARY METHOD TOLERANCE LIMIT DISTURBANCE states|dense < numbers > numbers
//
// Numbers in: of coordinates; of parameters, parameters; of inputs, and for each a constant, the number of its sines,
// for each amplitude, frequency, phase; of narrow places, widths; coordinates, rates; of times, times.
// Rows out: coordinates, rates, t.
#include <dlfcn.h>

#include <journey.hpp>

namespace reference {
namespace {

/// What the library exports. Mass and rest: mass a + rest = 0; derivatives are those of this sum.
struct Equations {
  void (*residual)(const Real* q, const Real* v, Real t, const Real* p, const Real* u, Real* mass, Real* rest);
  void (*jacobian)(const Real* q, const Real* v, const Real* a, Real t, const Real* p, const Real* u, const Real* du,
                   Real* by_q, Real* by_v, Real* by_t);
  void (*narrow)(const Real* q, const Real* v, const Real* a, Real t, const Real* p, Real* value, Real* rate,
                 Real* second_rate);
};

template <class Function>
void find(void* library, const char* name, Function*& function) {
  function = reinterpret_cast<Function*>(dlsym(library, name));
  if (function != nullptr) return;
  std::cerr << "model_reference: the library has no " << name << '\n';
  std::exit(2);
}

struct Sine {
  Real amplitude = 0, frequency = 0, phase = 0;
};

struct Input {
  Real constant = 0;
  std::vector<Sine> sines;

  Real at(Real t) const {
    Real sum = constant;
    for (const Sine& s : sines) sum += s.amplitude * std::sin(s.frequency * t + s.phase);
    return sum;
  }

  Real rate(Real t) const {
    Real sum = 0;
    for (const Sine& s : sines) sum += s.amplitude * s.frequency * std::cos(s.frequency * t + s.phase);
    return sum;
  }
};

class Model {
 public:
  explicit Model(const char* file) {
    void* library = dlopen(file, RTLD_NOW);
    if (library == nullptr) {
      std::cerr << "model_reference: " << dlerror() << '\n';
      std::exit(2);
    }
    find(library, "residual", equations_.residual);
    find(library, "jacobian", equations_.jacobian);
    find(library, "narrow", equations_.narrow);
  }

  /// Returns the start.
  State read(std::vector<Real>& times) {
    size_ = count();
    for (std::size_t left = count(); left-- > 0;) parameters_.push_back(next());
    for (std::size_t left = count(); left-- > 0;) {
      Input input{next(), {}};
      for (std::size_t sines = count(); sines-- > 0;) {
        const Real amplitude = next(), frequency = next();
        input.sines.push_back({amplitude, frequency, next()});
      }
      inputs_.push_back(std::move(input));
    }
    for (std::size_t left = count(); left-- > 0;) widths_.push_back(next());
    State start(2 * size_ + 1);
    for (std::size_t k = 0; k < 2 * size_; ++k) start[k] = next();
    for (std::size_t left = count(); left-- > 0;) times.push_back(next());
    if (!times.empty()) most_ = times.back() / 50;
    return start;
  }

  void operator()(const State& y, State& dy) const {
    dy.resize(y.size());
    std::copy(y.begin() + static_cast<std::ptrdiff_t>(size_), y.end() - 1, dy.begin());
    accelerations(y, &dy[size_]);
    dy.back() = 1;
  }

  void differentiate(const State& y, Matrix& jacobian) const {
    const auto n = static_cast<Eigen::Index>(size_);
    using Rows = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Rows mass(n, n), by_q(n, n), by_v(n, n), by_t(n, 1);
    std::vector<Real> a(size_), rest(size_), u, du;
    for (const Input& input : inputs_) {
      u.push_back(input.at(y.back()));
      du.push_back(input.rate(y.back()));
    }
    accelerations(y, a.data());
    equations_.residual(y.data(), y.data() + size_, y.back(), parameters_.data(), u.data(), mass.data(), rest.data());
    equations_.jacobian(y.data(), y.data() + size_, a.data(), y.back(), parameters_.data(), u.data(), du.data(),
                        by_q.data(), by_v.data(), by_t.data());
    const Eigen::PartialPivLU<Matrix> inverse(mass);
    jacobian = Matrix::Zero(2 * n + 1, 2 * n + 1);
    jacobian.block(0, n, n, n).setIdentity();
    jacobian.block(n, 0, n, n) = -inverse.solve(by_q);
    jacobian.block(n, n, n, n) = -inverse.solve(by_v);
    jacobian.block(n, 2 * n, n, 1) = -inverse.solve(by_t);
  }

  /// Steps are no longer than what keeps what is narrow in sight: of its own width and how far away it is, a part.
  Real longest(const State& y) const {
    static constexpr Real part = 0.2L;
    Real longest = most_;
    if (widths_.empty()) return longest;
    std::vector<Real> a(size_), value(widths_.size()), rate(value), second(value);
    accelerations(y, a.data());
    equations_.narrow(y.data(), y.data() + size_, a.data(), y.back(), parameters_.data(), value.data(), rate.data(),
                      second.data());
    for (std::size_t k = 0; k < widths_.size(); ++k) {
      const Real far = part * (std::abs(value[k]) + widths_[k]);
      longest =
          std::min({longest, far / (std::abs(rate[k]) + 1e-30L), std::sqrt(far / (std::abs(second[k]) + 1e-30L))});
    }
    return longest;
  }

  void project(State&) const {}
  void pass(const State&, const State&) const {}
  std::vector<Real> row(const State& now, const State&) const { return now; }
  void print(const State&) const {}

 private:
  void accelerations(const State& y, Real* a) const {
    static thread_local std::vector<Real> mass, u;
    const std::size_t n = size_;
    mass.resize(n * n);
    u.clear();
    for (const Input& input : inputs_) u.push_back(input.at(y.back()));
    equations_.residual(y.data(), y.data() + n, y.back(), parameters_.data(), u.data(), mass.data(), a);
    for (std::size_t i = 0; i < n; ++i) a[i] = -a[i];
    for (std::size_t i = 0; i < n; ++i) {  // the mass matrix is positive definite: no pivoting
      for (std::size_t r = i + 1; r < n; ++r) {
        const Real factor = mass[r * n + i] / mass[i * n + i];
        for (std::size_t c = i; c < n; ++c) mass[r * n + c] -= factor * mass[i * n + c];
        a[r] -= factor * a[i];
      }
    }
    for (std::size_t i = n; i-- > 0;) {
      for (std::size_t c = i + 1; c < n; ++c) a[i] -= mass[i * n + c] * a[c];
      a[i] /= mass[i * n + i];
    }
  }

  Equations equations_{};
  std::size_t size_ = 0;
  std::vector<Real> parameters_, widths_;
  std::vector<Input> inputs_;
  Real most_ = 1;
};

}  // namespace
}  // namespace reference

int main(int count, char** words) {
  using namespace reference;
  const std::string telling = count == 7 ? words[6] : "";
  if (telling != "states" && telling != "dense") {
    std::cerr << "usage: model_reference LIBRARY METHOD TOLERANCE LIMIT DISTURBANCE states|dense < numbers > numbers\n";
    return 2;
  }
  const Real tolerance = std::strtold(words[3], nullptr), limit = std::strtold(words[4], nullptr);
  const Real disturbance = std::strtold(words[5], nullptr);
  Model model(words[1]);
  std::vector<Real> times;
  State start = model.read(times);
  for (std::size_t k = 0; k + 1 < start.size(); ++k) {
    start[k] += disturbance * std::cos(Real(1.7) * Real(k) + Real(0.3)) * std::max(Real(1), std::abs(start[k]));
  }
  Journey<Model> journey(model, start, times, limit);
  const auto differentiate = [&](const State& y, Matrix& jacobian) { model.differentiate(y, jacobian); };
  return travel(journey, words[2], tolerance, telling == "dense" ? Telling::dense : Telling::states, model,
                differentiate);
}
