#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cstddef>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/run/derivatives.hpp>
#include <pendula/run/linearize.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <pendula/system/no_constraints.hpp>
#include <pendula/system/parameter_slopes.hpp>
#include <pendula/system/system_model.hpp>
#include <stdexcept>

namespace pendula {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Fills A column by column, `width` columns at once: by coordinates, then by rates.
void find_a(SystemAt<8>& here, const Motion& motion, double* a) {
  constexpr std::size_t width = 8;
  const auto n = static_cast<std::size_t>(motion.q.size());
  Eigen::Map<RowMajor> all(a, 2 * motion.q.size(), 2 * motion.q.size());
  all.setZero();
  all.topRightCorner(motion.q.size(), motion.q.size()).setIdentity();
  PackRows<width> numbers(6 * n);
  for (std::size_t k = 0; k < n; ++k) {
    std::fill_n(numbers[k], width, motion.q[static_cast<Eigen::Index>(k)]);
    std::fill_n(numbers[n + k], width, motion.v[static_cast<Eigen::Index>(k)]);
  }
  for (std::size_t first = 0; first < 2 * n; first += width) {
    const std::size_t count = std::min(width, 2 * n - first);
    std::fill_n(numbers[2 * n], 2 * n * width, 0.0);
    for (std::size_t lane = 0; lane < count; ++lane) numbers[2 * n + first + lane][lane] = 1;
    here(&SystemFunctions::acceleration_along, numbers[0], numbers[n], numbers[2 * n], numbers[3 * n], numbers[4 * n],
         numbers[5 * n]);
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t lane = 0; lane < count; ++lane) {
        all(static_cast<Eigen::Index>(n + k), static_cast<Eigen::Index>(first + lane)) = numbers[5 * n + k][lane];
      }
    }
  }
}

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

// Inputs change forces only: M δa = δf.
void find_b(const SystemModel& model, const Motion& motion, double* b) {
  const Eigen::Index n = motion.q.size(), inputs = static_cast<Eigen::Index>(model.inputs());
  Eigen::Map<RowMajor> all(b, 2 * n, inputs);
  SystemAt<1> here(model);
  here.set_time(motion.time);
  RowMajor mass(n, n);
  here(&SystemFunctions::mass_matrix, motion.q.data(), mass.data());
  ParameterSlopes slopes(model);
  slopes.evaluate(motion.time, motion.q.data(), motion.v.data());
  all.topRows(n).setZero();
  all.bottomRows(n) = mass.partialPivLu().solve(slopes.f.rightCols(inputs));
}

}  // namespace

void linearize(const Subject& subject, const Motion& motion, double* a, double* b) {
  require_regular(subject, motion);
  const SystemModel model =
      as_its_kind_at(subject, motion.time, [&](const auto& kind) { return system_model_of(kind, motion); });
  require_no_constraints(model.info(), "linearization: expected a system whose coordinates are free");
  if (a != nullptr) {
    SystemAt<8> here(model);
    here.set_time(motion.time);
    find_a(here, motion, a);
  }
  if (b != nullptr && model.inputs() > 0) find_b(model, motion, b);
}

Eigen::VectorXcd eigenvalues(const double* a, Eigen::Index size) {
  return Eigen::MatrixXd(Eigen::Map<const RowMajor>(a, size, size)).eigenvalues();
}

Motion equilibrium(const Subject& subject, const Motion& near) {
  if (changes_with_time(subject)) {
    throw std::invalid_argument("at: expected start for a system that changes with time, got equilibrium");
  }
  constexpr int most = 100;
  constexpr double largest = 0.5, smallest = 1e-13;  // changes of a step, relative to the size of the coordinates
  const Eigen::Index n = near.q.size();
  Motion at(near.time, near.q, Eigen::VectorXd::Zero(n));
  RowMajor a(2 * n, 2 * n);
  for (int k = 0; k < most; ++k) {
    linearize(subject, at, a.data(), nullptr);
    const Eigen::VectorXd acceleration = field_at(subject, at).tail(n);
    if (!acceleration.allFinite() || !a.allFinite()) break;
    Eigen::VectorXd change = -a.bottomLeftCorner(n, n).completeOrthogonalDecomposition().solve(acceleration);
    const double size = change.cwiseAbs().maxCoeff(), scale = std::max(1.0, at.q.cwiseAbs().maxCoeff());
    if (size > largest * scale) change *= largest * scale / size;
    at.q += change;
    if (size > smallest * scale) continue;
    // Where accelerations cannot vanish, the iteration ends at a minimum of the sum of their squares.
    const double swing = a.bottomLeftCorner(n, n).cwiseAbs().maxCoeff();
    if (acceleration.cwiseAbs().maxCoeff() > 1e-9 * swing * scale) break;
    at.q = (at.q.array().abs() < smallest * scale).select(0, at.q);
    return at;
  }
  throw std::invalid_argument("at: expected a start near an equilibrium, got one from which none was found");
}

}  // namespace pendula
