#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

/// A system with its parameters and inputs; immutable. Its table must outlive it.
class SystemModel {
 public:
  SystemModel(const SystemTable& table, const PlainSystem& plain)
      : table_(&table),
        parameters_(plain.parameters, plain.parameters + parameter_count(table.info)),
        constant_(plain.inputs, plain.inputs + table.info.inputs.size()),
        sines_(plain.sines.begin(), plain.sines.end()),
        loaded_(table.info.depends_on_time) {
    sample_power();
  }

  const SystemTable& table() const { return *table_; }
  const SystemInfo& info() const { return table_->info; }
  std::size_t coordinates() const { return info().coordinates.size(); }

  /// Throws std::invalid_argument unless a motion has the right number of coordinates and rates.
  void require(const Motion& motion) const {
    for (const auto& [name, numbers] : {std::pair{"q", &motion.q}, std::pair{"v", &motion.v}}) {
      if (static_cast<std::size_t>(numbers->size()) == coordinates()) continue;
      throw std::invalid_argument(std::string(name) + ": expected " + std::to_string(coordinates()) + " numbers, got " +
                                  std::to_string(numbers->size()));
    }
  }

  std::span<const double> parameters() const { return parameters_; }
  std::size_t inputs() const { return constant_.size(); }

  /// Writes the inputs at `time`, each `apart` numbers after the one before.
  void inputs(double time, double* found, std::size_t apart = 1) const {
    for (std::size_t k = 0; k < constant_.size(); ++k) found[k * apart] = constant_[k];
    for (const InputSine& sine : sines_) {
      found[static_cast<std::size_t>(sine.input) * apart] +=
          sine.amplitude * std::sin(sine.frequency * time + sine.phase);
    }
  }

  /// Whether anything depends on time.
  bool driven() const { return info().depends_on_time || !sines_.empty(); }

  /// Highest frequency of a sine added to an input  [rad/s]; 0 without sines.
  double fastest_drive() const {
    double fastest = 0;
    for (const InputSine& sine : sines_) {
      if (sine.amplitude != 0) fastest = std::max(fastest, std::abs(sine.frequency));
    }
    return fastest;
  }

  /// Whether the energy may change through forces or inputs.
  bool loaded() const { return loaded_; }

  /// Whether forces dissipate energy when all inputs are zero.
  bool damped() const { return damped_; }

 private:
  static int parameter_count(const SystemInfo& info) {
    return std::accumulate(info.parameter_sizes.begin(), info.parameter_sizes.end(), 0);
  }

  // Forces are loads if their power is not zero. It is sampled in a few generic states, near and far, since a force may
  // act in some places only. Systems that depend on time explicitly always count as loaded.
  void sample_power() {
    std::vector<double> q(coordinates()), v(coordinates()), driven(inputs());
    const std::vector<double> none(inputs());
    for (int k = 1; k <= samples; ++k) {
      const double far = k <= near_samples ? 1 : std::pow(10, k - near_samples);
      for (std::size_t i = 0; i < q.size(); ++i) {
        q[i] = far * (0.5 + std::sin(1.7 * k + 2.3 * static_cast<double>(i)));
        v[i] = std::cos(1.1 * k + 3.1 * static_cast<double>(i));
      }
      const double time = 0.37 * k;
      inputs(time, driven.data());
      const auto power = [&](const std::vector<double>& given) {
        double found = 0;
        table_->of_1.power({table_->context, parameters_.data(), &time, given.data()}, q.data(), v.data(), &found);
        return found;
      };
      loaded_ = loaded_ || power(driven) != 0;
      damped_ = damped_ || power(none) < 0;
    }
  }

  static constexpr int near_samples = 4, samples = 8;

  const SystemTable* table_;
  std::vector<double> parameters_, constant_;
  std::vector<InputSine> sines_;
  bool loaded_, damped_ = false;
};

/// Calls the functions of a system for W states, each at its own time.
template <int W>
class SystemAt {
  static constexpr auto width = static_cast<std::size_t>(W);

 public:
  explicit SystemAt(const SystemModel& model)
      : model_(model),
        functions_(functions_of<W>(model.table())),
        parameters_(model.parameters().size() + 1),
        times_(1),
        inputs_(model.inputs() + 1) {  // one more, so that there is always an address
    for (std::size_t k = 0; k < model.parameters().size(); ++k) {
      std::fill_n(parameters_[k], width, model.parameters()[k]);
    }
    for (std::size_t lane = 0; lane < width; ++lane) model.inputs(0, inputs_[0] + lane, width);
  }

  const SystemModel& model() const { return model_; }

  /// Sets one time for all states, or times(k) for state k.
  void set_time(double time) {
    set_times([&](std::size_t /*lane*/) { return time; });
  }
  template <class Times>
  void set_times(Times&& times) {
    if (!model_.driven()) return;
    for (std::size_t lane = 0; lane < width; ++lane) {
      times_[0][lane] = times(lane);
      model_.inputs(times_[0][lane], inputs_[0] + lane, width);
    }
  }

  Conditions conditions() const { return {model_.table().context, parameters_[0], times_[0], inputs_[0]}; }

  /// Calls a function: at(&SystemFunctions::acceleration, q, v, a).
  template <class Result, class... Given, class... Numbers>
  Result operator()(Result (*SystemFunctions::*function)(const Conditions&, Given...), Numbers... numbers) const {
    return (functions_.*function)(conditions(), numbers...);
  }

 private:
  SystemModel model_;
  SystemFunctions functions_;
  PackRows<width> parameters_, times_, inputs_;
};

/// Accelerations of a system in one state at any number of times, of which eight are computed at once.
class AtTimes {
 public:
  explicit AtTimes(const SystemModel& model)
      : at_(model), q_(model.coordinates()), v_(model.coordinates()), found_(model.coordinates()) {}

  const SystemModel& model() const { return at_.model(); }

  /// q, v: (coordinates); found: (times, coordinates).
  void accelerations(std::span<const double> times, const double* q, const double* v, double* found) {
    const std::size_t count = model().coordinates();
    for (std::size_t k = 0; k < count; ++k) {
      std::fill_n(q_[k], width, q[k]);
      std::fill_n(v_[k], width, v[k]);
    }
    for (std::size_t first = 0; first < times.size(); first += width) {
      const std::size_t here = std::min(width, times.size() - first);
      at_.set_times([&](std::size_t lane) { return times[first + std::min(lane, here - 1)]; });
      at_(&SystemFunctions::acceleration, q_[0], v_[0], found_[0]);
      for (std::size_t lane = 0; lane < here; ++lane) {
        for (std::size_t k = 0; k < count; ++k) found[(first + lane) * count + k] = found_[k][lane];
      }
    }
  }

 private:
  static constexpr std::size_t width = 8;

  SystemAt<8> at_;
  PackRows<width> q_, v_, found_;
};

}  // namespace pendula
