#pragma once

#include <cstddef>
#include <memory>
#include <pendula/system/plain_system.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pendula {

/// A text of lines, and these of words with tabs between them, read from the first to the last. It may be damaged: what
/// is not as it should be is thrown as std::invalid_argument, with the number of the line.
class KernelText {
 public:
  /// The text has to outlive it.
  explicit KernelText(std::string_view text) : rest_(text) {}

  /// Goes to the next line, whose first word is its kind; whether there is one.
  bool next();
  std::string_view kind() const { return kind_; }

  /// Words of the line, one after the other.
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

/// What a kernel says of itself, line by line (pendula_codegen/system_info.py): SystemInfo, and what that points into.
class KernelDescription {
 public:
  KernelDescription() = default;
  KernelDescription(const KernelDescription&) = delete;
  KernelDescription& operator=(const KernelDescription&) = delete;

  /// Takes a line of `text`, whose words have to outlive this; false where it is of another kind.
  bool take(KernelText& text);

  /// Lives as long as this. Throws std::invalid_argument where something is missing.
  SystemInfo info() const;

 private:
  using Names = std::vector<std::string_view>;

  /// std::vector<bool> has no addresses.
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
  bool depends_on_time_ = false, constant_masses_ = false;
  Names coordinates_, coordinate_units_, parameters_, parameter_units_, inputs_, input_units_, points_;
  Flags is_angle_, is_periodic_, is_positive_, is_per_link_, argument_is_base_;
  std::vector<int> parameter_sizes_, point_sizes_;
  std::vector<double> parameter_defaults_;
};

}  // namespace pendula
