#pragma once

#include <cstddef>
#include <numeric>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/member_inputs.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula {

/// Several systems of one kernel, one in each lane: every member has its own parameters, inputs and time. Numbers of
/// all lanes lie side by side, coordinate after coordinate, aligned to `pack_alignment`.
template <class L>
class MemberSystems {
 public:
  /// `table` must outlive this object.
  explicit MemberSystems(const SystemTable& table)
      : table_(table),
        functions_(functions_of<static_cast<int>(width_of<L>)>(table)),
        parameters_(1 + parameter_count(table.info)),  // one more, so that there is always an address
        inputs_now_(1 + table.info.inputs.size()),
        now_(1),
        inputs_(table.info.inputs.size()) {}
  MemberSystems(const MemberSystems&) = delete;
  MemberSystems& operator=(const MemberSystems&) = delete;

  const SystemTable& table() const { return table_; }
  const SystemInfo& info() const { return table_.info; }
  int coordinates() const { return static_cast<int>(info().coordinates.size()); }
  /// Kinds and units of coordinates.
  bool is_angle(int i) const { return info().is_angle[static_cast<std::size_t>(i)]; }
  bool of_one_unit(int i, int j) const {
    return info().coordinate_units[static_cast<std::size_t>(i)] == info().coordinate_units[static_cast<std::size_t>(j)];
  }
  bool is_periodic(int i) const { return info().is_periodic[static_cast<std::size_t>(i)]; }
  /// Whether the pivots of the mass matrix are constant.
  bool constant_masses() const { return info().constant_masses; }
  /// Whether functions depend on time other than through inputs.
  bool depends_on_time() const { return info().depends_on_time; }

  /// Loads the parameters and inputs of a member into a lane.
  void take(int lane, const PlainSystem& system) {
    for (std::size_t k = 0; k < parameter_count(info()); ++k) parameters_[k][lane] = system.parameters[k];
    inputs_.take(lane, system.inputs, system.sines);
  }
  /// Highest frequency of a sine added to the inputs  [rad/s].
  L fastest_drives() const { return inputs_.fastest(); }

  /// Calls a function at a row of times, or at one time of each member: call(times, &SystemFunctions::acceleration, q,
  /// v, a).
  template <class Function, class... Numbers>
  void call(const double* times, Function function, Numbers... numbers) {
    (functions_.*function)(at(times), numbers...);
  }
  template <class Function, class... Numbers>
  void here(const L& time, Function function, Numbers... numbers) {
    to_row(time, now_[0]);
    call(now_[0], function, numbers...);
  }

  /// Computes orders 0 to `last` of the Taylor series of motions about the states in the first row of `rows.state`.
  /// `inputs` gets (order + 1) rows of each input.
  void begin_series(const L& time, const L& unit, int order, int last, PackRows<width_of<L>>& inputs,
                    const SeriesRows& rows) {
    to_row(time, now_[0]);
    functions_.series_start(at(now_[0]), rows);
    inputs_.series(time, unit, order, inputs);
    end_series(time, 1, last, inputs, rows);
  }
  /// Computes orders `first` to `last` of series that have begun.
  void end_series(const L& time, int first, int last, const PackRows<width_of<L>>& inputs, const SeriesRows& rows) {
    if (first > last) return;
    to_row(time, now_[0]);
    functions_.series_next({table_.context, parameters_[0], now_[0], inputs[0]}, rows, first, last);
  }

 private:
  static std::size_t parameter_count(const SystemInfo& info) {
    return std::accumulate(info.parameter_sizes.begin(), info.parameter_sizes.end(), std::size_t{0});
  }
  Conditions at(const double* times) {
    inputs_.at(from_row<L>(times), inputs_now_);
    return {table_.context, parameters_[0], times, inputs_now_[0]};
  }

  const SystemTable& table_;
  SystemFunctions functions_;
  PackRows<width_of<L>> parameters_, inputs_now_, now_;
  MemberInputs<L> inputs_;
};

}  // namespace pendula
