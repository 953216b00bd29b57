#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <pendula/system/interpreted_kernel.hpp>
#include <pendula/system/kernel_text.hpp>
#include <pendula/system/program_operations.hpp>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

namespace pendula {
namespace {

/// Number of rows of an array.
enum class Rows {
  none,
  one,
  coordinates,
  square,
  parameters,
  inputs,
  components,
  arguments,
  switches,
  constraints,
  constraint_slopes,
  state,
  order,
  sums,
  kept,
  operands
};

struct Array {
  std::string_view name;
  Rows rows = Rows::none;
};

/// A function as the generator names it, and its arrays: first `taken` inputs, then the outputs.
struct Signature {
  std::string_view name;
  std::size_t taken;
  std::array<Array, 11> arrays;
};

constexpr std::array<Array, 3> conditions = {
    {{"parameters", Rows::parameters}, {"times", Rows::one}, {"inputs", Rows::inputs}}};

constexpr Array q{"q", Rows::coordinates}, v{"v", Rows::coordinates}, a{"a", Rows::coordinates},
    p{"p", Rows::coordinates}, f{"f", Rows::coordinates}, E{"E", Rows::coordinates};

/// In the order of Program::functions.
constexpr std::array<Signature, Program::many + Program::plain + Program::series> signatures = {{
    {"hamiltonian_form", 2, {q, p, v, f}},
    {"momentum_form", 2, {q, v, p, f}},
    {"momentum_form_with_jacobians",
     2,
     {q, v, p, f, {"p_D_q", Rows::square}, {"p_D_v", Rows::square}, {"f_D_q", Rows::square}, {"f_D_v", Rows::square}}},
    {"residual_with_jacobians",
     3,
     {q, v, a, E, {"E_D_q", Rows::square}, {"E_D_v", Rows::square}, {"E_D_a", Rows::square}}},
    {"momentum_from_velocity", 2, {q, v, p}},
    {"velocity_from_momentum", 2, {q, p, v}},
    {"acceleration", 2, {q, v, a}},
    {"mass_matrix", 1, {q, {"M", Rows::square}}},
    {"energies", 2, {q, v, {"kinetic", Rows::one}, {"total", Rows::one}}},
    {"power", 2, {q, v, {"P", Rows::one}}},
    {"acceleration_along",
     4,
     {q, v, {"dq", Rows::coordinates}, {"dv", Rows::coordinates}, a, {"da", Rows::coordinates}}},
    {"momentum_form_along",
     4,
     {{{"d_parameters", Rows::parameters},
       {"d_inputs", Rows::inputs},
       q,
       v,
       {"dp", Rows::coordinates},
       {"df", Rows::coordinates}}}},
    {"call_arguments", 2, {q, v, {"found", Rows::arguments}}},
    {"constraints", 1, {q, {"g", Rows::constraints}, {"g_D_q", Rows::constraint_slopes}}},
    {"constraint_rates", 2, {q, v, {"g_dot", Rows::constraints}, {"g_ddot", Rows::constraints}}},
    {"constraint_rate_slopes", 2, {q, v, {"g_dot_D_q", Rows::constraint_slopes}}},
    {"constraints_along",
     2,
     {{{"d_parameters", Rows::parameters}, q, {"dg", Rows::constraints}, {"d_g_D_q", Rows::constraint_slopes}}}},
    {"constraint_rates_along",
     5,
     {{{"d_parameters", Rows::parameters},
       {"dq", Rows::coordinates},
       {"dv", Rows::coordinates},
       q,
       v,
       {"d_g_dot", Rows::constraints},
       {"d_g_ddot", Rows::constraints}}}},
    {"series_start_along",
     5,
     {{{"unit", Rows::one},
       {"state", Rows::state},
       {"d_parameters", Rows::parameters},
       {"d_inputs", Rows::inputs},
       {"d_state", Rows::state},
       {"next", Rows::state},
       {"kept", Rows::kept},
       {"d_next", Rows::state},
       {"d_kept", Rows::kept}}}},
    {"series_next_along",
     7,
     {{{"order", Rows::order},
       {"state", Rows::state},
       {"kept", Rows::kept},
       {"sums", Rows::sums},
       {"d_state", Rows::state},
       {"d_kept", Rows::kept},
       {"d_sums", Rows::sums},
       {"next", Rows::state},
       {"operands", Rows::operands},
       {"d_next", Rows::state},
       {"d_operands", Rows::operands}}}},
    {"residual", 3, {q, v, a, E}},
    {"positions", 1, {q, {"r", Rows::components}}},
    {"velocities", 2, {q, v, {"r_dot", Rows::components}}},
    {"switches", 2, {q, v, {"g", Rows::switches}}},
    {"series_start", 2, {{{"unit", Rows::one}, {"state", Rows::state}, {"next", Rows::state}, {"kept", Rows::kept}}}},
    {"series_next",
     4,
     {{{"order", Rows::order},
       {"state", Rows::state},
       {"kept", Rows::kept},
       {"sums", Rows::sums},
       {"next", Rows::state},
       {"operands", Rows::operands}}}},
}};

constexpr int longest_run = 65535;
constexpr int most_registers = 65535, most_unknowns = 361;  // whose lower triangle fits into the registers

/// An array of a function: its name and its number of rows.
struct Given {
  std::string_view name;
  std::size_t rows;
};

void end_line(KernelText& text) {
  if (!text.at_end()) text.fail("the end of the line", text.word());
}

/// A function of the program, and the memory that it refers to.
class OwnedFunction {
 public:
  /// Reads the function, from the line that begins it up to the line that begins the next one. `taken` are its input
  /// arrays, `given` its output arrays.
  void read(KernelText& text, const std::vector<Given>& taken, const std::vector<Given>& given) {
    registers_ = text.whole(1, most_registers);
    end_line(text);
    std::vector<std::vector<bool>> missing(given.size());
    std::ranges::transform(given, missing.begin(),
                           [](const Given& array) { return std::vector<bool>(array.rows, true); });
    while (text.next() && text.kind() != "function" && text.kind() != "end") {
      if (text.kind() == "read") {
        reads_.push_back(move(text, taken));
      } else if (text.kind() == "number") {
        const std::uint16_t to = place(text);
        numbers_.push_back({to, text.number()});
      } else if (text.kind() == "write") {
        ProgramMove found = move(text, given);
        missing[found.array][found.row] = false;
        found.array = static_cast<std::uint16_t>(found.array + taken.size());
        writes_.push_back(found);
      } else {
        take_operation(text);
      }
      end_line(text);
    }
    for (const auto& rows : missing) {
      if (std::ranges::find(rows, true) != rows.end()) text.fail("a write to every row of every output", text.kind());
    }
    code_.push_back(end_of_code);
  }

  /// Valid as long as this object.
  ProgramFunction function() const { return {static_cast<std::size_t>(registers_), reads_, writes_, numbers_, code_}; }

 private:
  /// Reads the index of the first of `count` consecutive registers.
  std::uint16_t place(KernelText& text, int count = 1) const {
    return static_cast<std::uint16_t>(text.whole(0, registers_ - count));
  }

  ProgramMove move(KernelText& text, const std::vector<Given>& arrays) const {
    const std::uint16_t at = place(text);
    const std::string_view name = text.word();
    const auto array = std::ranges::find(arrays, name, &Given::name);
    if (array == arrays.end() || array->rows == 0) text.fail("an array of this function", name);
    const int row = text.whole(0, static_cast<int>(array->rows) - 1);
    return {at, static_cast<std::uint16_t>(array - arrays.begin()), static_cast<std::uint32_t>(row)};
  }

  void take_operation(KernelText& text) {
    const auto* known = std::ranges::find(operation_names, text.kind(), &OperationName::name);
    if (known == operation_names.end()) text.fail("an operation", text.kind());
    const auto operation = static_cast<std::uint16_t>(known - operation_names.begin());
    if (known->registers == 0) return take_system(text, operation);
    if (!run_ || code_[*run_] != operation || code_[*run_ + 1] > longest_run - known->registers) {
      run_ = code_.size();
      code_.insert(code_.end(), {operation, 0});
    }
    for (int k = 0; k < known->registers; ++k, ++code_[*run_ + 1]) code_.push_back(place(text));
  }

  void take_system(KernelText& text, std::uint16_t operation) {
    const bool factors = text.kind() == "factor";
    const int size = text.whole(1, most_unknowns), entries = size * (size + 1) / 2;
    run_.reset();
    code_.insert(code_.end(), {operation, static_cast<std::uint16_t>(size)});
    code_.push_back(place(text, factors ? entries : size));
    if (!factors) code_.push_back(place(text, entries));
    for (int k = 0; k < (factors ? entries : size); ++k) code_.push_back(place(text));
  }

  int registers_ = 0;
  std::optional<std::size_t> run_;  // where the last run of one operation begins, if it may be extended
  std::vector<ProgramMove> reads_, writes_;
  std::vector<ProgramNumber> numbers_;
  std::vector<std::uint16_t> code_;
};

/// An interpreted kernel, and the memory that its table points into.
class OwnedKernel {
 public:
  OwnedKernel(std::string text, const ProgramInterpreter& interpreter) : text_(std::move(text)) {
    KernelText lines(text_);
    if (!lines.next() || lines.kind() != "program") lines.fail("a program", lines.kind());
    lines.whole(system_interface, system_interface);
    end_line(lines);
    while (lines.next() && description_.take(lines)) {
    }
    const SystemInfo info = description_.info();
    program_.coordinates = info.coordinates.size();
    program_.inputs = info.inputs.size();
    program_.series_info = info.series;
    program_.sums = info.series_sums;
    while (lines.kind() == "function") read_function(lines, info);
    if (lines.kind() != "end") lines.fail("a function or the end", lines.kind());
    if (lines.next()) lines.fail("nothing after the end", lines.kind());
    table_ = {
        info, &program_, interpreter.of_1, interpreter.of_2, interpreter.of_4, interpreter.of_8, interpreter.plain};
    require_all(lines);
  }

  const SystemTable& table() const { return table_; }

 private:
  void read_function(KernelText& lines, const SystemInfo& info) {
    const std::string_view name = lines.word();
    const auto* signature = std::ranges::find(signatures, name, &Signature::name);
    if (signature == signatures.end()) lines.fail("a function that kernels have", name);
    std::vector<Given> taken, given;
    for (const Array& array : conditions) taken.push_back({array.name, count(array.rows, info)});
    for (std::size_t k = 0; k < signature->arrays.size() && signature->arrays[k].rows != Rows::none; ++k) {
      const Array& array = signature->arrays[k];
      (k < signature->taken ? taken : given).push_back({array.name, count(array.rows, info)});
    }
    const auto which = static_cast<std::size_t>(signature - signatures.begin());
    if (!program_.functions[which].code.empty()) lines.fail("a function that is not defined yet", name);
    functions_[which].read(lines, taken, given);
    program_.functions[which] = functions_[which].function();
  }

  static std::size_t count(Rows rows, const SystemInfo& info) {
    const auto total = [](std::span<const int> sizes) {
      return static_cast<std::size_t>(std::accumulate(sizes.begin(), sizes.end(), 0));
    };
    const std::size_t n = info.coordinates.size();
    switch (rows) {
      case Rows::none:
        return 0;
      case Rows::one:
        return 1;
      case Rows::coordinates:
        return n;
      case Rows::square:
        return n * n;
      case Rows::parameters:
        return total(info.parameter_sizes);
      case Rows::inputs:
        return info.inputs.size();
      case Rows::components:
        return total(info.point_sizes);
      case Rows::arguments:
        return info.argument_is_base.size();
      case Rows::switches:
        return info.switches.size();
      case Rows::constraints:
        return info.constraints.size();
      case Rows::constraint_slopes:
        return info.constraints.size() * n;
      case Rows::state:
        return 2 * n;
      case Rows::order:
        return 4;
      case Rows::sums:
        return static_cast<std::size_t>(info.series.sums);
      case Rows::kept:
        return static_cast<std::size_t>(info.series.kept);
      case Rows::operands:
        return static_cast<std::size_t>(info.series.operands);
    }
    return 0;
  }

  static bool is_of_tangents(std::size_t which) {
    return which == Program::series_start_along || which == Program::series_next_along;
  }

  /// Requires every function, except those of tangents along series, which models of many coordinates lack, and those
  /// that return something the model does not have; these must be missing.
  void require_all(const KernelText& lines) {
    const SystemInfo& info = table_.info;
    for (std::size_t k = 0; k < signatures.size(); ++k) {
      const Signature& signature = signatures[k];
      const bool wanted = count(signature.arrays[signature.taken].rows, info) > 0;
      const bool there = !program_.functions[k].code.empty();
      if (is_of_tangents(k) && !there) continue;
      if (wanted != there) lines.fail((wanted ? "" : "no ") + std::string(signature.name), wanted ? "none" : "one");
    }
    const bool lacks_tangents = program_.functions[Program::series_start_along].code.empty() ||
                                program_.functions[Program::series_next_along].code.empty();
    for (SystemFunctions* of : {&table_.of_1, &table_.of_2, &table_.of_4, &table_.of_8}) {
      if (lacks_tangents) of->series_start_along = nullptr, of->series_next_along = nullptr;
      if (info.argument_is_base.empty()) of->call_arguments = nullptr;
      if (!info.constraints.empty()) continue;
      of->constraints = nullptr, of->constraint_rates = nullptr, of->constraint_rate_slopes = nullptr;
      of->constraints_along = nullptr, of->constraint_rates_along = nullptr;
    }
    if (info.switches.empty()) table_.plain.switches = nullptr;
    if (info.points.empty()) table_.plain.positions = nullptr, table_.plain.velocities = nullptr;
  }

  std::string text_;
  KernelDescription description_;
  std::array<OwnedFunction, signatures.size()> functions_;
  Program program_;
  SystemTable table_;
};

}  // namespace

std::shared_ptr<const SystemTable> table_of(std::string text, const ProgramInterpreter& interpreter) {
  const auto kernel = std::make_shared<const OwnedKernel>(std::move(text), interpreter);
  return {kernel, &kernel->table()};
}

}  // namespace pendula
