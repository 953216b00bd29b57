#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <pendula/run/assembly.hpp>
#include <pendula/run/derivatives.hpp>
#include <pendula/run/linearize.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <pendula/system/constraint_forces.hpp>
#include <pendula/system/parameter_slopes.hpp>
#include <pendula/system/state_slopes.hpp>
#include <pendula/system/system_model.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

namespace pendula {
namespace {

/// A system at one motion, its masses, and derivatives of its functions.
class Beside {
 public:
  Beside(const SystemModel& model, const Motion& motion)
      : n_(motion.q.size()), here_(model), slopes_(model), motion_(motion), masses_(n_, n_) {
    here_.set_time(motion.time);
    here_(&SystemFunctions::mass_matrix, motion.q.data(), masses_.data());
    factors_.compute(masses_);
  }

  const SystemAt<1>& here() const { return here_; }
  const Directions<>& masses() const { return masses_; }
  Eigen::MatrixXd moved(const Eigen::MatrixXd& forces) const { return factors_.solve(forces); }

  Directions<> acceleration() { return slopes_.acceleration(motion_.time, motion_.q.data(), motion_.v.data()); }
  std::pair<Directions<>, Directions<>> constraint_rates(const Eigen::VectorXd& v) {
    return slopes_.constraint_rates(motion_.time, motion_.q.data(), v.data());
  }

  /// Forces, and what they and the momenta, M v + …, change by with coordinates, where rates are `v`  (n x n).
  struct Forces {
    Eigen::VectorXd f;
    Directions<> f_D_q, p_D_q;
  };
  Forces forces(const Eigen::VectorXd& v) const {
    Eigen::VectorXd p(n_), f(n_);
    Directions<> p_D_q(n_, n_), p_D_v(n_, n_), f_D_q(n_, n_), f_D_v(n_, n_);
    here_(&SystemFunctions::momentum_form_with_jacobians, motion_.q.data(), v.data(), p.data(), f.data(), p_D_q.data(),
          p_D_v.data(), f_D_q.data(), f_D_v.data());
    return {f, f_D_q, p_D_q};
  }

 private:
  Eigen::Index n_;
  SystemAt<1> here_;
  StateSlopes slopes_;
  const Motion& motion_;
  Directions<> masses_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factors_;
};

/// Which coordinates follow from others: of the columns of G, as masses weigh them, from the last to the first, as many
/// as do not depend on each other.
std::vector<bool> dependent(Eigen::MatrixXd slopes, const Directions<>& masses, Eigen::Index count) {
  const Eigen::Index n = slopes.cols();
  for (Eigen::Index k = 0; k < n; ++k) slopes.col(k) /= std::sqrt(masses(k, k));
  const double largest = n > 0 ? slopes.colwise().norm().maxCoeff() : 0;
  std::vector<bool> chosen;
  // The first bound that is low enough for all of them: those that follow badly would move far with the others.
  for (double least = 0.1; least > 1e-16; least /= 10) {
    Eigen::MatrixXd left = slopes;
    Eigen::Index found = 0;
    chosen.assign(static_cast<std::size_t>(n), false);
    for (Eigen::Index k = n; k-- > 0 && found < count;) {
      const double size = left.col(k).norm();
      if (!(size > least * largest)) continue;
      const Eigen::VectorXd direction = left.col(k) / size;
      left -= direction * (direction.transpose() * left).eval();
      chosen[static_cast<std::size_t>(k)] = true;
      ++found;
    }
    if (found == count) break;
  }
  return chosen;
}

Independent all_of(Eigen::Index n) {
  std::vector<Eigen::Index> places(static_cast<std::size_t>(2 * n));
  std::iota(places.begin(), places.end(), Eigen::Index{0});
  return {.places = places, .basis = Directions<>::Identity(2 * n, 2 * n)};
}

/// Constraints at one motion: forces that keep them, and how they change.
class ConstraintsBeside {
 public:
  ConstraintsBeside(const SystemModel& model, const Motion& motion, Beside& beside)
      : n_(motion.q.size()),
        m_(std::ssize(model.info().constraints)),
        forces_(model.info()),
        beside_(beside),
        of_rates_(model.info().constraint_is_of_rates.begin(), model.info().constraint_is_of_rates.end()),
        slope_(m_, n_),
        resisting_(n_, m_) {
    if (m_ == 0) return;
    forces_.look(beside.here(), motion.q.data());
    for (Eigen::Index i = 0; i < m_; ++i) {
      for (Eigen::Index k = 0; k < n_; ++k) {
        slope_(i, k) = forces_.slope(static_cast<std::size_t>(i), static_cast<std::size_t>(k));
      }
    }
    Eigen::MatrixXd inverse(m_, m_);
    for (Eigen::Index i = 0; i < m_; ++i) {
      for (Eigen::Index j = 0; j < m_; ++j) {
        inverse(i, j) = forces_.inverse(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
      }
    }
    resisting_ = beside.moved(slope_.transpose()) * inverse;
  }

  Independent independent(const Motion& motion) {
    if (m_ == 0) return all_of(n_);
    std::vector<double> unused(static_cast<std::size_t>(m_ * m_));
    const Along places = along(slope_of_positions(), forces_.find_inverse_of_positions(unused.data()));
    const Along rates = along(slope_, forces_.independent());
    const Eigen::Index of_places = places.changes.cols(), of_rates = rates.changes.cols();
    Independent found{.places = places.free, .basis = Directions<>::Zero(2 * n_, of_places + of_rates)};
    for (const Eigen::Index k : rates.free) found.places.push_back(n_ + k);
    found.basis.topLeftCorner(n_, of_places) = places.changes;
    found.basis.bottomRightCorner(n_, of_rates) = rates.changes;
    if (rates.others.empty()) return found;
    const Eigen::MatrixXd turned = beside_.constraint_rates(motion.v).first.leftCols(n_) * places.changes;
    found.basis.bottomLeftCorner(n_, of_places)(rates.others, Eigen::all) = -rates.factors.solve(turned);
    return found;
  }

  /// Makes derivatives of accelerations without constraints  (n x 2n) those of accelerations with them.
  ///   M (δa − δa_free) = −(δM) M⁻¹Gᵀλ + (δG)ᵀ λ + Gᵀ δλ,   G δa + (δG) a + δ(d²g/dt² without accelerations) = 0.
  void constrain(const Motion& motion, Directions<>& acceleration) {
    const auto [free, lambda] = pull(motion);
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(n_), pulled = beside_.moved(slope_.transpose() * lambda);
    const Directions<> heavier = beside_.forces(pulled).p_D_q - beside_.forces(none).p_D_q;
    acceleration.leftCols(n_) += beside_.moved(turned(motion, lambda) - heavier);
    Directions<> lacking = slope_ * acceleration + beside_.constraint_rates(motion.v).second;
    lacking.leftCols(n_) +=
        (beside_.constraint_rates(free + pulled).first - beside_.constraint_rates(none).first).leftCols(n_);
    acceleration -= resisting_ * lacking;
  }
  void constrain_inputs(Directions<>& by_inputs) const { by_inputs -= resisting_ * (slope_ * by_inputs); }

  /// What the forces at a motion and their constraints' change by with coordinates, if λ is held  (n x n).
  Directions<> stiffness(const Motion& motion) {
    const Directions<> f_D_q = beside_.forces(motion.v).f_D_q;
    return m_ == 0 ? f_D_q : Directions<>(f_D_q + turned(motion, pull(motion).second));
  }

 private:
  /// Changes that keep constraints, by those of some coordinates, which are free; the others follow  (n x free).
  struct Along {
    std::vector<Eigen::Index> free, others;
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factors;  // of the slopes by the others
    Eigen::MatrixXd changes;
  };
  Along along(const Eigen::MatrixXd& slope, std::size_t independent) const {
    const std::vector<bool> follows = dependent(slope, beside_.masses(), static_cast<Eigen::Index>(independent));
    Along found;
    for (std::size_t k = 0; k < follows.size(); ++k) {
      (follows[k] ? found.others : found.free).push_back(static_cast<Eigen::Index>(k));
    }
    found.changes = Eigen::MatrixXd::Zero(n_, std::ssize(found.free));
    found.changes(found.free, Eigen::all).setIdentity();
    if (found.others.empty()) return found;
    found.factors.compute(Eigen::MatrixXd(slope(Eigen::all, found.others)));
    found.changes(found.others, Eigen::all) = -found.factors.solve(Eigen::MatrixXd(slope(Eigen::all, found.free)));
    return found;
  }

  /// Constraints of rates do not bind coordinates.
  Eigen::MatrixXd slope_of_positions() const {
    Eigen::MatrixXd slope = slope_;
    for (Eigen::Index i = 0; i < m_; ++i) {
      if (of_rates_[static_cast<std::size_t>(i)]) slope.row(i).setZero();
    }
    return slope;
  }

  /// Accelerations without constraints, and λ.
  std::pair<Eigen::VectorXd, Eigen::VectorXd> pull(const Motion& motion) {
    Eigen::VectorXd free(n_), lambda(m_);
    beside_.here()(&SystemFunctions::acceleration, motion.q.data(), motion.v.data(), free.data());
    forces_.find(beside_.here(), motion.q.data(), motion.v.data(), free.data(), lambda.data());
    return {free, lambda};
  }

  /// Σ_i λ_i ∂²g_i/∂q²
  Directions<> turned(const Motion& motion, const Eigen::VectorXd& lambda) {
    Directions<> found(n_, n_);
    forces_.find_curvature(beside_.here(), motion.q.data(), lambda.data(), found.data());
    return found;
  }

  Eigen::Index n_, m_;
  ConstraintForces forces_;
  Beside& beside_;
  std::vector<bool> of_rates_;
  Eigen::MatrixXd slope_, resisting_;  // G, M⁻¹ Gᵀ K⁻¹
};

bool changes_with_time(const Subject& subject) {
  if (subject.part_at(0)) return true;
  return as_its_kind(subject, [](const auto& kind) {
    if constexpr (requires { kind.chain(); }) {
      return !kind.chain().drives().empty();
    } else {
      return kind.info().depends_on_time || !kind.numbers().sines.empty();
    }
  });
}

/// Brings coordinates that follow from others back onto the constraints. Returns whether that is done.
bool bring_back_others(const Subject& subject, const Independent& independent, Motion& motion) {
  std::vector<bool> follow(static_cast<std::size_t>(motion.q.size()), true);
  for (const Eigen::Index k : independent.places) {
    if (k < motion.q.size()) follow[static_cast<std::size_t>(k)] = false;
  }
  return as_its_kind(subject, [&](const auto& kind) {
    if constexpr (requires { kind.info(); }) return bring_back(kind, follow, motion).empty();
    return true;
  });
}

SystemModel regular_model(const Subject& subject, const Motion& motion) {
  require_regular(subject, motion);
  return as_its_kind_at(subject, motion.time, [&](const auto& kind) { return system_model_of(kind, motion); });
}

/// Scales rows and columns, by powers of 2, until those of a number are of one size: units of x cost eigenvalues no
/// digits (Osborne, J. ACM 7, 1960).
void balance(Eigen::MatrixXd& a) {
  constexpr int most = 100;
  bool changed = a.allFinite();
  for (int sweep = 0; changed && sweep < most; ++sweep) {
    changed = false;
    for (Eigen::Index k = 0; k < a.rows(); ++k) {
      const double own = std::abs(a(k, k));
      const double row = a.row(k).lpNorm<1>() - own, column = a.col(k).lpNorm<1>() - own;
      if (!(row > 0) || !(column > 0)) continue;
      const double scale = std::exp2(std::round(std::log2(row / column) / 2));
      if (!(row / scale + column * scale < 0.95 * (row + column))) continue;
      a.row(k) /= scale;
      a.col(k) *= scale;
      changed = true;
    }
  }
}

}  // namespace

Independent find_independent(const Subject& subject, const Motion& motion) {
  const bool has_constraints = as_its_kind_at(subject, motion.time, [](const auto& kind) {
    if constexpr (requires { kind.info(); }) return !kind.info().constraints.empty();
    return false;
  });
  if (!has_constraints) return all_of(motion.q.size());
  const SystemModel model = regular_model(subject, motion);
  Beside beside(model, motion);
  return ConstraintsBeside(model, motion, beside).independent(motion);
}

Linearized linearize(const Subject& subject, const Motion& motion) {
  const SystemModel model = regular_model(subject, motion);
  const Eigen::Index n = motion.q.size(), inputs = static_cast<Eigen::Index>(model.inputs());
  Beside beside(model, motion);
  ConstraintsBeside constraints(model, motion, beside);
  Directions<> by_state = beside.acceleration(), by_inputs(n, inputs);
  if (inputs > 0) {  // they change forces only: M δa = δf
    ParameterSlopes slopes(model);
    slopes.evaluate(motion.time, motion.q.data(), motion.v.data());
    by_inputs = beside.moved(slopes.f.rightCols(inputs));
  }
  if (!model.info().constraints.empty()) {
    constraints.constrain(motion, by_state);
    constraints.constrain_inputs(by_inputs);
  }
  Linearized found{.independent = constraints.independent(motion), .a = {}, .b = {}};
  Directions<> a = Directions<>::Zero(2 * n, 2 * n), b = Directions<>::Zero(2 * n, inputs);
  a.topRightCorner(n, n).setIdentity();
  a.bottomRows(n) = by_state;
  b.bottomRows(n) = by_inputs;
  found.a = found.independent.rows(a * found.independent.basis);
  found.b = found.independent.rows(b);
  return found;
}

Eigen::VectorXcd eigenvalues(const Directions<>& a) {
  Eigen::MatrixXd balanced = a;
  balance(balanced);
  return balanced.eigenvalues();
}

Motion equilibrium(const Subject& subject, const Motion& near) {
  if (changes_with_time(subject)) {
    throw std::invalid_argument("at: expected start for a system that changes with time, got equilibrium");
  }
  constexpr int most = 100;
  constexpr double smallest = 1e-13;  // changes of a step, relative to the size of the coordinates
  const Eigen::Index n = near.q.size();
  Motion at(near.time, near.q, Eigen::VectorXd::Zero(n));
  for (int k = 0; k < most; ++k) {
    const SystemModel model = regular_model(subject, at);
    Beside beside(model, at);
    ConstraintsBeside constraints(model, at, beside);
    const Independent independent = constraints.independent(at);
    const auto d = static_cast<Eigen::Index>(
        std::ranges::count_if(independent.places, [&](Eigen::Index place) { return place < n; }));
    const Eigen::MatrixXd along = independent.basis.topLeftCorner(n, d);
    const Eigen::MatrixXd free = independent.basis.bottomRightCorner(n, independent.basis.cols() - d);
    const Eigen::VectorXd force = free.transpose() * beside.forces(at.v).f;
    const Eigen::MatrixXd stiffness = -free.transpose() * constraints.stiffness(at) * along;
    if (!force.allFinite() || !stiffness.allFinite()) break;
    Eigen::VectorXd change = along * stiffness.completeOrthogonalDecomposition().solve(force);
    const double size = change.cwiseAbs().maxCoeff(), scale = std::max(1.0, at.q.cwiseAbs().maxCoeff());
    const double largest = (d < n ? 0.1 : 0.5) * scale;  // a linkage that jumps is another one
    if (size > largest) change *= largest / size;
    at.q += change;
    if (d < n && !bring_back_others(subject, independent, at)) break;
    if (size > smallest * scale) continue;
    // Where forces cannot vanish, the iteration ends at a minimum of the sum of their squares.
    if (force.cwiseAbs().maxCoeff() > 1e-9 * stiffness.cwiseAbs().maxCoeff() * scale) break;
    at.q = (at.q.array().abs() < smallest * scale).select(0, at.q);
    return at;
  }
  throw std::invalid_argument(
      "at: expected a start near an equilibrium, got one from which Newton's method finds none");
}

}  // namespace pendula
