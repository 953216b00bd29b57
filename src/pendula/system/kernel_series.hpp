#pragma once

#include <array>
#include <cstddef>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/system/kernel_numbers.hpp>
#include <pendula/system/series_sums.hpp>

namespace pendula::detail {

/// Taylor series of W motions of the generated kernel S: series_start and series_next of SystemFunctions.
template <System S, int W>
class KernelSeries : KernelNumbers<S, W> {
 public:
  static void start(const Conditions& at, const SeriesRows& rows) {
    if constexpr (has_series<S>) {
      constexpr std::size_t row = series_state_row(coordinates, width);
      std::array<L, numbers> state, next;
      std::array<L, static_cast<std::size_t>(S::series_kept) + 1> kept;
      for (std::size_t i = 0; i < numbers; ++i) state[i] = load(rows.state + i * width);
      S::template series_start<L>(parameters(at), inputs(at), load(rows.unit), state.data(), next.data(), kept.data());
      for (std::size_t i = 0; i < numbers; ++i) store(next[i], rows.state + row + i * width);
      for (std::size_t i = 0; i + 1 < kept.size(); ++i) store(kept[i], rows.kept + i * width);
    }
  }

  static void start_along(const Conditions& at, const double* unit, const double* state, const double* d_parameters,
                          const double* d_inputs, const double* d_state, double* next, double* kept, double* d_next,
                          double* d_kept) {
    if constexpr (has_series<S> && W == 8) {
      const std::array<Varied, numbers> from = varied<numbers>(state, d_state);
      std::array<Varied, numbers> to;
      std::array<Varied, static_cast<std::size_t>(S::series_kept) + 1> held;
      S::template series_start<Varied>(
          Crossing::template read_parameters<Varied>(VariedRows{at.parameters, d_parameters}, at),
          Crossing::template read<typename Crossing::template Inputs<Varied>>(VariedRows{at.inputs, d_inputs}),
          Varied(load(unit)), from.data(), to.data(), held.data());
      write_varied(to.data(), numbers, next, d_next);
      write_varied(held.data(), held.size() - 1, kept, d_kept);
    }
  }

  static void next_along(const Conditions& at, const double* order, const double* state, const double* kept,
                         const double* sums, const double* d_state, const double* d_kept, const double* d_sums,
                         double* next, double* operands, double* d_next, double* d_operands) {
    if constexpr (has_series<S> && W == 8) {
      const std::array<Varied, numbers> from = varied<numbers>(state, d_state);
      const auto totals = varied<S::series_sums.size() + 1>(sums, d_sums, S::series_sums.size());
      std::array<Varied, S::input_names.size() + 1> pushes;
      for (std::size_t i = 0; i + 1 < pushes.size(); ++i) pushes[i] = Varied(load(at.inputs + i * width));
      std::array<Varied, 4> of_order;
      for (std::size_t i = 0; i < of_order.size(); ++i) of_order[i] = Varied(load(order + i * width));
      std::array<Varied, numbers> to;
      std::array<Varied, static_cast<std::size_t>(info.operands) + 1> found;
      S::template series_next<Varied>(VariedRows{kept, d_kept}, pushes.data(), of_order.data(), from.data(),
                                      totals.data(), to.data(), found.data());
      write_varied(to.data(), numbers, next, d_next);
      write_varied(found.data(), found.size() - 1, operands, d_operands);
    }
  }

  PENDULA_IN_REGISTERS static void next(const Conditions& at, const SeriesRows& rows, int first, int last) {
    if constexpr (has_series<S>) {
      constexpr std::size_t given = S::input_names.size();
      constexpr std::size_t state_row = series_state_row(coordinates, width);
      constexpr std::size_t operand_row = series_operand_row(info, width);
      const Rows kept{rows.kept};
      const L unit = load(rows.unit);
      std::array<L, numbers> state, next;
      std::array<L, given + 1> pushes;
      std::array<L, static_cast<std::size_t>(info.operands) + 1> found;
      std::array<L, S::series_sums.size() + 1> sums;
      const auto begin = static_cast<std::size_t>(first), end = static_cast<std::size_t>(last) + 1;
      for (std::size_t i = 0; i < numbers; ++i) state[i] = load(rows.state + begin * state_row + i * width);
      if constexpr (W == 1) found_before(rows.operands, begin, found);
      double share = 1.0 / static_cast<double>(begin);
      for (std::size_t k = begin; k < end; ++k) {
        const double following = 1.0 / static_cast<double>(k + 1);
        const std::array<L, 4> order{L(static_cast<double>(k)), L(share), unit * L(following), k == 1 ? unit : L(0.0)};
        share = following;
        for (std::size_t i = 0; i < given; ++i) pushes[i] = load(at.inputs + (k * given + i) * width);
        if constexpr (W == 1) {
          sums_of_one(rows.operands, k, found, sums);
        } else {
          known_sums_of_many<W, S::series_sums>(rows.operands, operand_row, k, sums.data());
        }
        S::template series_next<L>(kept, pushes.data(), order.data(), state.data(), sums.data(), next.data(),
                                   found.data());
        double *const to = rows.state + (k + 1) * state_row, *const row = rows.operands + k * operand_row;
        for (std::size_t i = 0; i < numbers; ++i) store(state[i] = next[i], to + i * width);
        if constexpr (W == 1) {
          for (std::size_t m = 0; m < S::series_sums.size(); ++m) {
            row[m] = found[S::series_sums[m][0]];
            row[series_lanes(info) + m] = found[S::series_sums[m][1]];
          }
        } else {
          for (std::size_t i = 0; i + 1 < found.size(); ++i) store(found[i], row + i * width);
        }
      }
    }
  }

 private:
  using Crossing = KernelNumbers<S, W>;
  using Crossing::inputs, Crossing::load, Crossing::parameters, Crossing::store, Crossing::width;
  using typename Crossing::L, typename Crossing::Rows, typename Crossing::VariedRows;
  using Varied = Dual<L>;
  static constexpr auto coordinates = static_cast<std::size_t>(S::coordinates), numbers = 2 * coordinates;
  static constexpr SeriesInfo info = series_of<S>();

  template <std::size_t size>
  static std::array<Varied, size> varied(const double* from, const double* slopes, std::size_t count = size) {
    std::array<Varied, size> found;
    for (std::size_t i = 0; i < count; ++i) found[i] = VariedRows{from, slopes}[i];
    return found;
  }
  static void write_varied(const Varied* from, std::size_t count, double* to, double* slopes) {
    for (std::size_t i = 0; i < count; ++i) {
      store(from[i].value, to + i * width);
      store(from[i].slope, slopes + i * width);
    }
  }

  /// Sums of one motion. The terms with operands of order k − 1 are added one by one, from `last`: a whole register of
  /// them cannot be loaded yet, because they were just stored one by one.
  template <class Last, class Sums>
  [[gnu::always_inline]] static void sums_of_one(const double* operands, std::size_t k, const Last& last, Sums& sums) {
    constexpr std::size_t lanes = series_lanes(info), count = S::series_sums.size();
    alignas(pack_alignment) double found[lanes + 8];
    sums_in_lanes<2>(operands, lanes, k, found);
    const double* const early = operands + series_operand_row(info, 1);
    for (std::size_t m = 0; m < count; ++m) sums[m] = found[m];
    if (k > 1) {
      for (std::size_t m = 0; m < count; ++m) sums[m] = fused(early[m], last[S::series_sums[m][1]], sums[m]);
    }
    if (k > 2) {
      for (std::size_t m = 0; m < count; ++m) sums[m] = fused(early[lanes + m], last[S::series_sums[m][0]], sums[m]);
    }
  }

  /// Sets `last` to the operands of order first − 1.
  template <class Last>
  static void found_before(const double* operands, std::size_t first, Last& last) {
    if (first == 1) return;
    const double* const row = operands + (first - 1) * series_operand_row(info, 1);
    for (std::size_t m = 0; m < S::series_sums.size(); ++m) {
      last[S::series_sums[m][0]] = row[m];
      last[S::series_sums[m][1]] = row[series_lanes(info) + m];
    }
  }
};

}  // namespace pendula::detail
