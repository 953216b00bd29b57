/// RATTLE and the generalised-alpha method on plane linkages of uniform bars, by hand, for bench/linkage_races.py.
///
/// usage: linkage_peers METHOD STEPS < PROBLEM; prints where the watched joint ends and the seconds of stepping alone.
///
/// Coordinates q are the places of the joints that move. A uniform bar from a to b of mass m has the kinetic energy
/// m/6 (|a'|² + a'·b' + |b'|²), so that the mass matrix M is constant; so is the weight f; and g_k = (|b − a|² − l²)/2
/// is quadratic, its Jacobian G linear. There is no sine in it.

#include <Eigen/Dense>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <span>
#include <string>
#include <vector>

namespace {

struct Bar {
  int a, b;  // joints; those that do not move come after those that do
  double mass, length;
};

struct Problem {
  int moving = 0, watched = 0;
  double gravity = 0, duration = 0;
  std::vector<Eigen::Vector2d> places, speeds;  // of all joints
  std::vector<Bar> bars;
};

Problem read(std::istream& in) {
  Problem problem;
  std::size_t joints = 0;
  std::size_t bars = 0;
  in >> problem.gravity >> problem.duration >> joints >> problem.moving >> bars >> problem.watched;
  for (std::size_t k = 0; k < joints; ++k) {
    Eigen::Vector2d place, speed;
    in >> place.x() >> place.y() >> speed.x() >> speed.y();
    problem.places.push_back(place);
    problem.speeds.push_back(speed);
  }
  for (std::size_t k = 0; k < bars; ++k) {
    Bar bar{};
    in >> bar.a >> bar.b >> bar.mass >> bar.length;
    problem.bars.push_back(bar);
  }
  return problem;
}

/// n coordinates and m bars, known when this is compiled.
template <int n, int m>
struct Linkage {
  using Coordinates = Eigen::Vector<double, n>;
  using Multipliers = Eigen::Vector<double, m>;
  using Square = Eigen::Matrix<double, n, n>;
  using Jacobian = Eigen::Matrix<double, m, n>;

  explicit Linkage(const Problem& problem) {
    for (int k = 0; k < n / 2; ++k) {
      q.template segment<2>(2 * k) = problem.places[static_cast<std::size_t>(k)];
      v.template segment<2>(2 * k) = problem.speeds[static_cast<std::size_t>(k)];
    }
    for (std::size_t k = 0; k < m; ++k) {
      bars[k] = problem.bars[k];
      for (const int end : {bars[k].a, bars[k].b}) {
        if (end >= n / 2) {
          fixed[k] = problem.places[static_cast<std::size_t>(end)];
          continue;
        }
        mass.template block<2, 2>(2 * end, 2 * end).diagonal().array() += bars[k].mass / 3;
        weight[2 * end + 1] -= bars[k].mass * problem.gravity / 2;
      }
      if (bars[k].a >= n / 2 || bars[k].b >= n / 2) continue;
      mass.template block<2, 2>(2 * bars[k].a, 2 * bars[k].b).diagonal().array() += bars[k].mass / 6;
      mass.template block<2, 2>(2 * bars[k].b, 2 * bars[k].a).diagonal().array() += bars[k].mass / 6;
    }
    mobility = mass.inverse();
  }

  /// From one end of a bar to the other.
  [[nodiscard]] Eigen::Vector2d across(const Coordinates& at, std::size_t bar) const {
    const auto place = [&](int end) -> Eigen::Vector2d {
      return end < n / 2 ? Eigen::Vector2d(at.template segment<2>(2 * end)) : fixed[bar];
    };
    return place(bars[bar].b) - place(bars[bar].a);
  }

  /// g and G.
  void constraints(const Coordinates& at, Multipliers& g, Jacobian& G) const {
    G.setZero();
    for (std::size_t k = 0; k < m; ++k) {
      const Eigen::Vector2d along = across(at, k);
      const int row = static_cast<int>(k);
      g[row] = (along.squaredNorm() - bars[k].length * bars[k].length) / 2;
      if (bars[k].a < n / 2) G.template block<1, 2>(row, 2 * bars[k].a) = -along.transpose();
      if (bars[k].b < n / 2) G.template block<1, 2>(row, 2 * bars[k].b) = along.transpose();
    }
  }

  /// Adds Σ λ_k ∂²g_k/∂q² to a matrix.
  template <class Matrix>
  void add_curvature(const Multipliers& lambda, Matrix& to) const {
    for (std::size_t k = 0; k < m; ++k) {
      const double pull = lambda[static_cast<int>(k)];
      const int a = 2 * bars[k].a;
      const int b = 2 * bars[k].b;
      for (int axis = 0; axis < 2; ++axis) {
        if (a < n) to(a + axis, a + axis) += pull;
        if (b < n) to(b + axis, b + axis) += pull;
        if (a >= n || b >= n) continue;
        to(a + axis, b + axis) -= pull;
        to(b + axis, a + axis) -= pull;
      }
    }
  }

  Coordinates q, v;
  Square mass = Square::Zero(), mobility;
  Coordinates weight = Coordinates::Zero();
  std::array<Bar, m> bars;
  std::array<Eigen::Vector2d, m> fixed;
};

/// In closed form up to four unknowns, which takes a third of the time.
template <class Vector, class Matrix>
Vector solve(const Matrix& matrix, const Vector& right) {
  if constexpr (Matrix::RowsAtCompileTime <= 4) {
    return matrix.inverse() * right;
  } else {
    return matrix.partialPivLu().solve(right);
  }
}

constexpr int most_iterations = 30;
// Newton's iteration is quadratic: after a correction of this size, in metres, what is left is rounding.
constexpr double last_correction = 1e-9;

/// RATTLE: v½ = v + h/2 M⁻¹(f − Gᵀλ), q₁ = q + h v½, g(q₁) = 0; v₁ = v½ + h/2 M⁻¹(f − G₁ᵀμ), G₁ v₁ = 0.
template <int n, int m>
class Rattle {
 public:
  using Model = Linkage<n, m>;

  explicit Rattle(Model& model) : model_(model), fall_(model.mobility * model.weight) {
    model.constraints(model.q, g_, G_);
  }

  bool step(double h) {
    const Eigen::Matrix<double, n, m> back = model_.mobility * G_.transpose();
    const typename Model::Coordinates free = model_.q + h * model_.v + h * h / 2 * fall_;
    typename Model::Multipliers pull = h * h / 2 * lambda_;
    typename Model::Coordinates end;
    for (int iteration = 1;; ++iteration) {
      end = free - back * pull;
      model_.constraints(end, g_, G_);
      const Eigen::Matrix<double, m, m> slope = G_ * back;
      const typename Model::Multipliers correction = solve(slope, g_);
      pull += correction;
      const double moved = (back * correction).template lpNorm<Eigen::Infinity>();
      if (moved < last_correction) break;
      if (iteration == most_iterations || !std::isfinite(moved)) return false;
    }
    end = free - back * pull;
    lambda_ = 2 / (h * h) * pull;
    const typename Model::Coordinates middle = model_.v + h * fall_ - back * pull / h;
    model_.q = end;
    model_.constraints(end, g_, G_);
    const Eigen::Matrix<double, n, m> onward = model_.mobility * G_.transpose();
    const Eigen::Matrix<double, m, m> gives = G_ * onward;
    const typename Model::Multipliers speed = G_ * middle;
    model_.v = middle - onward * solve(gives, speed);
    return true;
  }

 private:
  Model& model_;
  typename Model::Coordinates fall_;
  typename Model::Multipliers lambda_ = Model::Multipliers::Zero(), g_;
  typename Model::Jacobian G_;
};

/// RATTLE steps of given parts of h, a symmetric composition of higher order.
template <int n, int m>
class Composed {
 public:
  Composed(Linkage<n, m>& model, std::span<const double> parts) : rattle_(model) {
    for (std::size_t k = 0; k < 2 * parts.size() - 1; ++k) {
      parts_.push_back(parts[k < parts.size() ? k : 2 * parts.size() - 2 - k]);
    }
  }

  bool step(double h) {
    for (const double part : parts_) {
      if (!rattle_.step(part * h)) return false;
    }
    return true;
  }

 private:
  Rattle<n, m> rattle_;
  std::vector<double> parts_;
};

/// Generalised-alpha of index 3 (Arnold, Brüls 2007): M q̈₁ + G₁ᵀλ₁ = f, g(q₁) = 0, for an algorithmic acceleration a
/// with (1 − α_m) a₁ + α_m a = (1 − α_f) q̈₁ + α_f q̈, q₁ = q + h v + h² ((½ − β) a + β a₁), v₁ = v + h ((1 − γ) a + γ
/// a₁).
template <int n, int m>
class GeneralisedAlpha {
 public:
  using Model = Linkage<n, m>;

  GeneralisedAlpha(Model& model, double radius)
      : model_(model),
        alpha_m_((2 * radius - 1) / (radius + 1)),
        alpha_f_(radius / (radius + 1)),
        gamma_(0.5 + alpha_f_ - alpha_m_),
        beta_((gamma_ + 0.5) * (gamma_ + 0.5) / 4) {
    // M q̈ + Gᵀλ = f, G q̈ = −(dG/dt) v, and (dG/dt) v is G(v) v, G being linear, without what does not move.
    typename Model::Multipliers g;
    typename Model::Jacobian G, later;
    model.constraints(model.q, g, G);
    model.constraints(model.q + model.v, g, later);
    const Eigen::Matrix<double, n, m> back = model.mobility * G.transpose();
    const typename Model::Coordinates fall = model.mobility * model.weight;
    lambda_ = (G * back).ldlt().solve(G * fall + (later - G) * model.v);
    acceleration_ = fall - back * lambda_;
    a_ = acceleration_;
  }

  bool step(double h) {
    const double share = (1 - alpha_f_) / (1 - alpha_m_);  // of q̈₁ in a₁
    const typename Model::Coordinates known = (alpha_f_ * acceleration_ - alpha_m_ * a_) / (1 - alpha_m_);
    const double scale = h * h * beta_ * share;
    const typename Model::Coordinates before = model_.q + h * model_.v + h * h * ((0.5 - beta_) * a_ + beta_ * known);
    typename Model::Coordinates end = before + scale * acceleration_;
    for (int iteration = 1;; ++iteration) {
      typename Model::Multipliers g;
      typename Model::Jacobian G;
      model_.constraints(end, g, G);
      // Unknowns are q₁ and scale λ₁.
      Eigen::Matrix<double, n + m, n + m> matrix = Eigen::Matrix<double, n + m, n + m>::Zero();
      auto top = matrix.template topLeftCorner<n, n>();
      model_.add_curvature(scale * lambda_, top);
      top += model_.mass;
      matrix.template topRightCorner<n, m>() = G.transpose();
      matrix.template bottomLeftCorner<m, n>() = G;
      Eigen::Vector<double, n + m> left;
      left << scale * (model_.mass * acceleration_ + G.transpose() * lambda_ - model_.weight), g;
      const Eigen::Vector<double, n + m> correction = matrix.partialPivLu().solve(left);
      acceleration_ -= correction.template head<n>() / scale;
      end = before + scale * acceleration_;
      lambda_ -= correction.template tail<m>() / scale;
      const double moved = correction.template head<n>().template lpNorm<Eigen::Infinity>();
      if (moved < last_correction) break;
      if (iteration == most_iterations || !std::isfinite(moved)) return false;
    }
    const typename Model::Coordinates a = known + share * acceleration_;
    model_.v += h * ((1 - gamma_) * a_ + gamma_ * a);
    model_.q = end;
    a_ = a;
    return true;
  }

 private:
  Model& model_;
  double alpha_m_, alpha_f_, gamma_, beta_;
  typename Model::Coordinates acceleration_, a_;
  typename Model::Multipliers lambda_;
};

template <int n, int m, class Method>
int race(Linkage<n, m>& model, Method method, const Problem& problem, long steps) {
  const double h = problem.duration / static_cast<double>(steps);
  const auto begin = std::chrono::steady_clock::now();
  for (long k = 0; k < steps; ++k) {
    if (method.step(h)) continue;
    std::cerr << "no convergence at t = " << static_cast<double>(k) * h << " s\n";
    return EXIT_FAILURE;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  std::cout.precision(17);
  std::cout << model.q[2 * problem.watched] << ' ' << model.q[2 * problem.watched + 1] << ' ' << took.count() << '\n';
  return EXIT_SUCCESS;
}

// Symmetric compositions: the first half of the parts of a step, and the middle one.
constexpr std::array whole{1.0};
constexpr std::array kahan_li_6{0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981,
                                0.08221359629355080023, 0.79854399093482996340};
constexpr std::array suzuki_umeno_8{0.74167036435061295345,  -0.40910082580003159400, 0.19075471029623837995,
                                    -0.57386247111608226666, 0.29906418130365592384,  0.33462491824529818378,
                                    0.31529309239676659663,  -0.79688793935291635402};

template <int n, int m>
int run(const Problem& problem, const std::string& method, long steps) {
  Linkage<n, m> model(problem);
  if (method == "rattle") return race(model, Composed<n, m>(model, whole), problem, steps);
  if (method == "rattle6") return race(model, Composed<n, m>(model, kahan_li_6), problem, steps);
  if (method == "rattle8") return race(model, Composed<n, m>(model, suzuki_umeno_8), problem, steps);
  return race(model, GeneralisedAlpha<n, m>(model, std::stod(method)), problem, steps);
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) return EXIT_FAILURE;
  const Problem problem = read(std::cin);
  const long steps = std::stol(words[2]);
  if (problem.moving == 2 && problem.bars.size() == 3) return run<4, 3>(problem, words[1], steps);
  if (problem.moving == 3 && problem.bars.size() == 5) return run<6, 5>(problem, words[1], steps);
  std::cerr << "a linkage of another size\n";
  return EXIT_FAILURE;
}
