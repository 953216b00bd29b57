#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <pendula/explicit/error_size.hpp>
#include <pendula/explicit/field_steps.hpp>
#include <pendula/explicit/forced_steps.hpp>
#include <pendula/explicit/system_forward_dynamics.hpp>
#include <pendula/kernels/gauss_tableaux.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_model.hpp>
#include <pendula/system/system_table.hpp>
#include <string_view>
#include <vector>

namespace pendula {

/// A system of a generated kernel as SingleIntegrator moves it, with a Method of explicit_tableau.hpp. `Dynamics` is
/// MemberSystems of plain numbers.
template <class Dynamics, class Method>
class ExplicitSystem {
  static constexpr bool can_choose = Method::error_order > 0;
  static constexpr int nodes = can_choose ? (Method::error_order + 2) / 2 : 2;  // of an equally accurate quadrature
  static constexpr bool is_blind = [] {
    if constexpr (can_choose) return Method::is_blind;
    return false;
  }();

 public:
  /// `table` must outlive this object.
  ExplicitSystem(const SystemTable& table, const PlainSystem& plain, double tolerance)
      : model_(table, plain),
        numbers_{{model_.parameters().begin(), model_.parameters().end()},
                 {plain.inputs, plain.inputs + model_.inputs()},
                 {plain.sines.begin(), plain.sines.end()}},
        dynamics_(std::make_unique<Dynamics>(table)),
        forward_(std::make_unique<SystemForwardDynamics>(model_)),
        forcing_(kernels::GaussTableau<nodes>(), model_.coordinates(), tolerance, is_blind),
        field_(nodes, *forward_, model_.coordinates(), is_blind),
        fastest_(model_.coordinates()),
        x_(2 * model_.coordinates()),
        end_(x_),
        moved_(x_) {}

  static constexpr double tolerance_share = 1;

  Dynamics& subject() { return *dynamics_; }
  std::size_t coordinates() const { return count(); }
  std::string_view kernel() const { return model_.info().name; }
  const SystemModel& model() const { return model_; }

  template <class Steps>
  Outcome start(double time, const double* q, const double* v, Steps& steps) {
    steps.start(0, time, numbers_.plain(), q, v);
    std::fill(fastest_.begin(), fastest_.end(), 0.0);
    field_.forget();
    for (const double* numbers : {q, v}) {
      const std::size_t part = first_not_finite(numbers);
      if (part < count()) return {.status = Status::not_finite, .time = time, .part = static_cast<int>(part)};
    }
    // At a pole accelerations are infinite, and starting there would fail later with a less clear message.
    forward_->acceleration(time, q, v, end_.data());
    const std::size_t part = first_not_finite(end_.data());
    if (part < count()) {
      return {.status = Status::singular_mass_matrix, .time = time, .part = static_cast<int>(part)};
    }
    if (can_choose) forcing_.start(*forward_, time, q, v);
    return {.status = Status::ok, .time = time};
  }

  template <class Steps>
  void follow(const Steps& /*steps*/) const {}

  template <class Steps>
  void read(const Steps& steps, double* q, double* v) const {
    for (int i = 0; i < steps.count(); ++i) read_near(i, steps.exact_place(i), steps.exact_rate(i), q, v);
  }
  template <class Steps>
  void read_within(const Steps& steps, double share, double* q, double* v) const {
    for (int i = 0; i < steps.count(); ++i) {
      const auto there = steps.at(i, share);
      read_near(i, there.place, there.rate, q, v);
    }
  }
  template <class Vector>
  void read_near(int i, const Vector& place, const Vector& rate, double* q, double* v) const {
    q[i] = static_cast<double>(place[0]);
    v[i] = static_cast<double>(rate[0]);
  }

  template <class Steps>
  double followed(const Steps& steps, double time, double h) {
    write(steps.parts(), x_);
    return forcing_.followed(*forward_, time, x_.data(), x_.data() + count(), h);
  }

  bool has_to_look() const {
    if constexpr (requires { Method::looks_itself; }) return false;
    return field_.has_to_look();
  }

  /// Relative to the scale of errors (ErrorSize). Without a tolerance, relative to the highest speed of the coordinate
  /// so far, or to a fraction of the highest speed of any coordinate.
  template <class Parts>
  Unseen unseen(const Parts& from, const Parts& to, double time, double h, double tolerance) {
    write(from, x_);
    write(to, end_);
    if (tolerance > 0) {
      for (std::size_t k = 0; k < x_.size(); ++k) moved_[k] = end_[k] - x_[k];
      return field_.unseen(*forward_, time, h, x_, end_, [&](const std::vector<double>& rate) {
        return [this, sizes = ErrorSize(x_, rate, moved_, h, tolerance)](std::size_t k) { return sizes[count() + k]; };
      });
    }
    for (std::size_t k = 0; k < count(); ++k) fastest_[k] = std::max(fastest_[k], std::abs(end_[count() + k]));
    const double least =
        std::max(FieldSteps::beside * *std::max_element(fastest_.begin(), fastest_.end()), ForcingLook::negligible);
    return field_.unseen(*forward_, time, h, x_, end_, [&](const std::vector<double>&) {
      return [this, least](std::size_t k) { return std::max(fastest_[k], least); };
    });
  }

  void move_on() { field_.move_on(); }

  template <class Numbers>
  void member(Numbers& numbers) {
    field_.forget();
    numbers(forcing_, fastest_);
  }

 private:
  std::size_t count() const { return model_.coordinates(); }

  template <class Parts>
  void write(const Parts& parts, std::vector<double>& to) const {
    for (std::size_t k = 0; k < count(); ++k) {
      to[k] = parts[static_cast<int>(k)].place[0];
      to[count() + k] = parts[static_cast<int>(k)].rate[0];
    }
  }

  // The coordinate of the first number that is not finite; count() if there is none.
  std::size_t first_not_finite(const double* numbers) const {
    const auto* const found = std::find_if_not(numbers, numbers + count(), [](double x) { return std::isfinite(x); });
    return static_cast<std::size_t>(found - numbers);
  }

  SystemModel model_;
  SystemNumbers numbers_;
  std::unique_ptr<Dynamics> dynamics_;  // on the heap, because others hold references to it
  std::unique_ptr<SystemForwardDynamics> forward_;
  ForcedSteps forcing_;
  FieldSteps field_;
  std::vector<double> fastest_;          // the fastest of each coordinate so far
  std::vector<double> x_, end_, moved_;  // (q, q̇) at the start and the end of a step, and their difference
};

}  // namespace pendula
