#pragma once

#include <cstddef>
#include <memory>
#include <pendula/system/plain_system.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pendula {

/// Reads a text line by line, and each line as words separated by tabs. The text may be damaged: errors are thrown as
/// std::invalid_argument with the line number.
class KernelText {
 public:
  /// `text` must outlive this object.
  explicit KernelText(std::string_view text) : rest_(text) {}

  /// Goes to the next line, whose first word is its kind. Returns whether there is one.
  bool next();
  std::string_view kind() const { return kind_; }

  /// Each of these reads the next word of the line.
  std::string_view word();
  int whole(int least, int most);
  double number();
  bool flag() { return whole(0, 1) == 1; }
  bool at_end() const { return words_.data() == nullptr; }

  [[noreturn]] void fail(const std::string& expected, std::string_view got) const;

 private:
  std::string_view rest_, kind_, words_;
  std::size_t line_ = 0;
};

/// The description of a kernel, read line by line (pendula_codegen/system_info.py): holds a SystemInfo and the memory
/// that it points into.
class KernelDescription {
 public:
  KernelDescription() = default;
  KernelDescription(const KernelDescription&) = delete;
  KernelDescription& operator=(const KernelDescription&) = delete;

  /// Takes the current line of `text`, whose words must outlive this object. Returns false if it is a line of another
  /// kind.
  bool take(KernelText& text);

  /// Valid as long as this object. Throws std::invalid_argument if something is missing.
  SystemInfo info() const;

 private:
  using Names = std::vector<std::string_view>;

  /// An array of flags with addresses, which std::vector<bool> does not have.
  class Flags {
   public:
    void push_back(bool flag);
    std::span<const bool> all() const { return {flags_.get(), count_}; }

   private:
    std::unique_ptr<bool[]> flags_;
    std::size_t count_ = 0;
  };

  std::string_view name_, model_;
  int links_ = 0;
  SeriesInfo series_;
  bool depends_on_time_ = false, constant_masses_ = false;
  Names coordinates_, coordinate_units_, parameters_, parameter_units_, inputs_, input_units_, points_, switches_,
      constraints_, constraint_units_, point_kinds_, connection_kinds_;
  Flags is_angle_, is_periodic_, is_positive_, is_per_link_, argument_is_base_, constraint_is_of_rates_;
  std::vector<int> parameter_sizes_, point_sizes_, connection_ends_;
  std::vector<double> parameter_defaults_;
  std::vector<SeriesSum> sums_;
};

}  // namespace pendula
