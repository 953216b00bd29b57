#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <vector>

namespace pendula {

/// What stages of a step do not see of the field between them: its rates are summed along the polynomials through the
/// stages, where functions of the model may be narrow. Of smooth ones the sum is that of the stages, to the order of
/// the method.
template <int Width, class Form>
class LagrangianField {
 public:
  using Stages = LagrangianStages<Width, Form>;

  LagrangianField(const SystemModel& model, int stages)
      : at_(model),
        look_(stages, Width, model.info().argument_is_base, stages < few_stages ? 0.1 : 0.5),
        count_(model.coordinates()),
        arguments_(model.info().argument_is_base.size()),
        there_(2 * count_),
        found_(std::max(2 * count_, count_ + arguments_)),
        sums_(2 * count_),
        moments_(sums_),
        missed_(sums_) {}

  Unseen unseen(Stages& stages) {
    stages.see_speed();
    const auto arguments = [&](std::span<const double> shares, double* found) {
      in_lanes(stages, shares, found, arguments_, [&] {
        Form::rates(at_, count_ * width, there_[0], there_[count_], found_[arguments_]);
        at_(&SystemFunctions::call_arguments, there_[0], found_[arguments_], found_[0]);
      });
    };
    if (!look_.may_find(arguments) || !look_.finds(arguments)) return {};
    const double pace = stages.shape().pace;
    const auto rates = [&](std::span<const double> shares, double* found) {
      in_lanes(stages, shares, found, 2 * count_,
               [&] { Form::field(at_, count_ * width, there_[0], there_[count_], found_[0], found_[count_]); });
    };
    look_.sum(rates, {sums_, moments_, missed_});
    stages.take_changes(sums_, moments_);
    for (double& number : missed_) number *= stages.h();
    const double impulse = stages.size_of(missed_, pace), lacks = stages.size_of(sums_, pace);
    return {std::max(impulse, lacks), lacks + Unseen::of_wall(impulse / stages.speed_here())};
  }

 private:
  using L = typename Stages::L;

  static constexpr auto width = static_cast<std::size_t>(Width);
  static constexpr int few_stages = 4;  // fewer tell little of their error where a small event is short

  // Finds so many numbers at all shares of the step: by() computes them at `there_`, and writes them to found_. Lanes
  // beyond the last share repeat it.
  template <class By>
  void in_lanes(const Stages& stages, std::span<const double> shares, double* found, std::size_t numbers, By&& by) {
    for (std::size_t first = 0; first < shares.size(); first += width) {
      const std::span<const double> here = shares.subspan(first, std::min(width, shares.size() - first));
      alignas(pack_alignment) typename Stages::Stored each;
      for (std::size_t lane = 0; lane < width; ++lane) each[lane] = here[std::min(lane, here.size() - 1)];
      at_.set_times([&](std::size_t lane) { return stages.time_at(each[lane]); });
      stages.along(L::load(each), there_);
      by();
      for (std::size_t k = 0; k < numbers; ++k) {
        for (std::size_t lane = 0; lane < here.size(); ++lane) found[(first + lane) * numbers + k] = found_[k][lane];
      }
    }
  }

  SystemAt<Width> at_;
  FieldLook look_;
  std::size_t count_, arguments_;
  typename Stages::Rows there_, found_;  // the state at some shares of the step; what is found there
  std::vector<double> sums_, moments_, missed_;
};

}  // namespace pendula
