#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/stage_system.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/gauss/system_forcing.hpp>
#include <pendula/gauss/velocity_stages.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// A StageSolver for any system in the paper's velocity form, E(q, v, a, t) = 0, over its generated kernel: Gauss
/// methods are symmetric, but not symplectic.
///
/// It solves by Newton. The unknowns are the stage accelerations K_i, so that the mass matrix is never inverted:
///   Q_i = q + h c_i v + h² Σ_j (A²)_ij K_j,  V_i = v + h Σ_j a_ij K_j,
///   residual  E(Q_i, V_i, K_i, t_i)  (paper eq. 27).
template <int Width = max_stages>
class VelocityNewton : public VelocityStages<Width> {
  using Base = VelocityStages<Width>;
  using typename Base::L, typename Base::Rows;

 public:
  using Model = SystemModel;
  using Real = double;
  using typename Base::State;

  /// Throws std::invalid_argument unless the method has so many stages, at most Width.
  VelocityNewton(const Model& model, int stages, Family family = Family::gauss)
      : Base(model, stages, family),
        family_(family),
        system_(count_, stages),
        forcing_(model, family, stages),
        look_(stages, few_samples, model.info().argument_is_base),
        jacobians_(3 * count_ * count_),
        sums_(3 * count_) {}

  void prepare(const StepTask& task) {
    Base::prepare(task);
    is_first_ = true;
  }
  double defect(double noticed) { return Base::defect(noticed, first_correction_); }

  Correction correct() {
    place_stages();
    at_(&SystemFunctions::residual_with_jacobians, q(0), v(0), a(0), stages_[3 * count_], jacobian(0, 0, 0),
        jacobian(1, 0, 0), jacobian(2, 0, 0));
    for (int i = 0; i < Base::stages(); ++i) masses_.see(jacobian(2, 0, 0) + i, static_cast<std::size_t>(Width));
    for (std::size_t row = 0; row < count_; ++row) system_.set_residual(row, L::load(stages_[3 * count_ + row]));
    for (std::size_t k = 0; k < system_.stages(); ++k) {
      const L ha = columns_.ha(k), h2a2 = columns_.integral(columns_.hb() * ha);
      for (std::size_t column = 0; column < count_; ++column) {
        for (std::size_t row = 0; row < count_; ++row) {
          system_.set_derivative(row, column, k, derivative(row, column, k, ha, h2a2));
        }
      }
    }
    system_.solve();
    const Correction correction = apply();
    if (std::exchange(is_first_, false)) first_correction_ = correction.relative;
    return correction;
  }

  static constexpr Iteration iteration() { return Iteration::newton; }
  int part_of(Status status) const {
    if (status == Status::singular_mass_matrix) return masses_.singular();
    return status == Status::wrong_root ? Base::farthest_turn().second : -1;
  }
  SolverTraits traits() const {
    const int coordinates = static_cast<int>(count_);
    return {coordinates,
            coordinates,
            Base::stages(),
            detail::largest_turn_of(info().constant_masses),
            at_.model().loaded(),
            at_.model().damped(),
            family_ == Family::radau};
  }
  double followed(double time, double h, double tolerance) {
    return forcing_.followed(h, tolerance, [&] {
      const double pace = Base::tempo().pace;
      read_state(numbers(0), numbers(1));
      return SystemForcing::Here{time, numbers(0), numbers(1), pace};
    });
  }
  /// What forces do between the stages that were solved.
  Unseen unseen() {
    if (!look_.has_to_look()) return {};
    Base::shape();  // places the stages
    const std::size_t arguments = info().argument_is_base.size();
    const auto find_arguments = [&](std::span<const double> shares, double* found) {
      for (std::size_t i = 0; i < shares.size(); ++i) {
        along(shares[i])(&SystemFunctions::call_arguments, numbers(2), numbers(3), found + i * arguments);
      }
    };
    if (!look_.may_find(find_arguments) || !look_.finds(find_arguments)) return {};
    const auto accelerations = [&](std::span<const double> shares, double* found) {
      for (std::size_t i = 0; i < shares.size(); ++i) {
        along(shares[i])(&SystemFunctions::acceleration, numbers(2), numbers(3), found + i * count_);
      }
    };
    const std::span<double> sums(sums_.data(), count_), moments(sums.data() + count_, count_),
        missed(moments.data() + count_, count_);
    look_.sum(accelerations, {sums, moments, missed});
    find_increments();
    const double fastest = Base::fastest(), h = columns_.h();
    double impulse_squared = 0, lack_squared = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double impulse = weight_[k] * h * missed[k], lack = weight_[k] * (h * sums[k] - numbers(1)[k]);
      impulse_squared += impulse * impulse;
      lack_squared += lack * lack;
    }
    const double impulse = std::sqrt(impulse_squared / fastest), lacks = std::sqrt(lack_squared / fastest);
    return {std::max(impulse, lacks), lacks + Unseen::of_wall(impulse / std::sqrt(fastest_here_ / fastest))};
  }

 private:
  using Base::a, Base::along, Base::at_, Base::columns_, Base::count_, Base::fastest_here_, Base::find_increments,
      Base::info, Base::masses_, Base::numbers, Base::place_stages, Base::q, Base::read_state, Base::stages_,
      Base::state_, Base::v, Base::weight_;
  static constexpr int few_samples = 3;  // between which functions may be narrow

  // ∂E/∂q, ∂E/∂v, ∂E/∂a.
  double* jacobian(std::size_t which, std::size_t row, std::size_t column) {
    return jacobians_[(which * count_ + row) * count_ + column];
  }

  // ∂(residual of row, stage i)/∂(K of column, stage k) for all i.
  L derivative(std::size_t row, std::size_t column, std::size_t k, const L& ha, const L& h2a2) {
    return fma(ha, L::load(jacobian(1, row, column)),
               fma(h2a2, L::load(jacobian(0, row, column)), L(jacobian(2, row, column)[k]) * columns_.unit(k)));
  }

  // Subtracts the solution from the accelerations. Its size is that of the changes of rates it makes.
  Correction apply() {
    const double h = std::abs(columns_.h());
    double scale = 0, largest = 0;
    int worst = -1;
    for (std::size_t k = 0; k < count_; ++k) scale = std::max(scale, weight_[k] * std::abs(state_[count_ + k].value));
    for (std::size_t i = 0; i < system_.stages(); ++i) {
      for (std::size_t k = 0; k < count_; ++k) {
        const double change = system_.correction(k, i);
        if (!std::isfinite(change)) return {std::numeric_limits<double>::quiet_NaN(), static_cast<int>(k)};
        a(k)[i] -= change;
        scale = std::max(scale, h * weight_[k] * std::abs(a(k)[i]));
        const double size = h * weight_[k] * std::abs(change);
        if (size < largest) continue;
        largest = size;
        worst = static_cast<int>(k);
      }
    }
    return {largest > 0 ? largest / scale : 0, worst, Convergence::quadratic};
  }

  Family family_;
  detail::StageSystem system_;
  SystemForcing forcing_;
  FieldLook look_;
  Rows jacobians_;  // ∂E/∂q, ∂E/∂v, ∂E/∂a
  std::vector<double> sums_;
  bool is_first_ = true;  // of the iterations of a step
  double first_correction_ = 0;
};

}  // namespace pendula
