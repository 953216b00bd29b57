#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/numeric/functions.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/outcome.hpp>
#include <span>

namespace pendula {

/// What stages of a step do not see of the field between them: its rates are summed along the polynomials through the
/// stages, where functions of the model may be narrow. Of smooth ones the sum is that of the stages, to the order of
/// the method.
template <System S, int Width>
class LagrangianField {
 public:
  using Stages = LagrangianStages<S, Width>;

  explicit LagrangianField(int stages) : look_(stages, Width, argument_bases<S>(), stages < few_stages ? 0.1 : 0.5) {}

  Unseen unseen(Stages& stages) {
    stages.see_speed();
    const auto arguments = [&](std::span<const double> shares, double* found) {
      find_arguments(stages, shares, found);
    };
    if (!look_.may_find(arguments) || !look_.finds(arguments)) return {};
    const double pace = stages.shape().pace;
    std::array<double, 2 * Stages::count> sums, moments, missed;
    const auto rates = [&](std::span<const double> shares, double* found) { find_rates(stages, shares, found); };
    look_.sum(rates, {sums, moments, missed});
    stages.take_changes(sums, moments);
    for (double& number : missed) number *= stages.h();
    const double impulse = stages.size_of(missed, pace), lacks = stages.size_of(sums, pace);
    return {std::max(impulse, lacks), lacks + Unseen::of_wall(impulse / stages.speed_here())};
  }

 private:
  using L = typename Stages::L;
  using Lanes = typename Stages::Lanes;

  static constexpr auto width = static_cast<std::size_t>(Width);
  static constexpr int few_stages = 4;  // fewer tell little of their error where a small event is short

  // Where the system is at shares of the step; lanes beyond them repeat the last.
  struct There {
    typename S::template Parameters<L> parameters;
    typename S::template Inputs<L> inputs;
    Lanes Q, P;
  };
  static There at(const Stages& stages, std::span<const double> shares) {
    There there{stages.parameters(), stages.inputs(), {}, {}};
    alignas(pack_alignment) typename Stages::Stored numbers, times;
    for (std::size_t lane = 0; lane < width; ++lane) {
      numbers[lane] = shares[std::min(lane, shares.size() - 1)];
      times[lane] = stages.time_at(numbers[lane]);
    }
    stages.along(L::load(numbers), there.Q, there.P);
    if constexpr (holds_time<S>) there.parameters.time = L::load(times);
    if (!stages.model().driven()) return there;
    for (Eigen::Index i = 0; i < there.inputs.size(); ++i) {
      for (std::size_t lane = 0; lane < width; ++lane) numbers[lane] = stages.model().inputs(times[lane]).data()[i];
      there.inputs.data()[i] = L::load(numbers);
    }
    return there;
  }

  // by(there, found): numbers in lanes, from `shares` on.
  template <class By>
  static void in_lanes(const Stages& stages, std::span<const double> shares, double* found, By&& by) {
    for (std::size_t first = 0; first < shares.size(); first += width) {
      const std::span<const double> here = shares.subspan(first, std::min(width, shares.size() - first));
      const auto numbers = by(at(stages, here));
      alignas(pack_alignment) typename Stages::Stored each;
      for (std::size_t k = 0; k < numbers.size(); ++k) {
        numbers[k].store(each);
        for (std::size_t lane = 0; lane < here.size(); ++lane) found[(first + lane) * numbers.size() + k] = each[lane];
      }
    }
  }

  static void find_arguments(const Stages& stages, std::span<const double> shares, double* found) {
    if constexpr (tells_arguments<S>) {
      in_lanes(stages, shares, found, [](const There& there) {
        Lanes V;
        S::velocity_from_momentum(there.parameters, there.Q, there.P, V);
        typename S::template Arguments<L> arguments;
        S::call_arguments(there.parameters, there.Q, V, there.inputs, arguments);
        std::array<L, S::argument_is_base.size()> numbers;
        std::copy_n(arguments.data(), numbers.size(), numbers.begin());
        return numbers;
      });
    }
  }

  static void find_rates(const Stages& stages, std::span<const double> shares, double* found) {
    in_lanes(stages, shares, found, [](const There& there) {
      Lanes V, F;
      S::hamiltonian_form(there.parameters, there.Q, there.P, there.inputs, V, F);
      std::array<L, 2 * Stages::count> numbers;
      std::copy_n(V.data(), Stages::count, numbers.begin());
      std::copy_n(F.data(), Stages::count, numbers.begin() + Stages::count);
      return numbers;
    });
  }

  FieldLook look_;
};

}  // namespace pendula
