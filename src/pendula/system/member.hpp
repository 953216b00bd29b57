#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <pendula/numeric/compensated.hpp>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace pendula {

/// The copyable state of a run: everything besides the model and the options that its next steps depend on. Two runs
/// with equal members continue identically, to the last bit.
struct Member {
  std::vector<double> numbers;

  /// Bitwise comparison.
  bool operator==(const Member& other) const {
    const auto bits = [](double number) { return std::bit_cast<std::uint64_t>(number); };
    return std::ranges::equal(numbers, other.numbers, {}, bits, bits);
  }
};

/// Visits the numbers of a member, to count, read or write them. A class with such numbers lists them once:
///   template <class Numbers> void member(Numbers& numbers) { numbers(first, second, …); }
class MemberNumbers {
 public:
  enum class Pass { count, read, write };

  /// `at` is where numbers are copied to (read) or from (write).
  explicit MemberNumbers(Pass pass, double* at = nullptr) : pass_(pass), at_(at) {}

  template <class... Values>
  void operator()(Values&... values) {
    (pass(values), ...);
  }

  /// Visits `count` numbers from `first` on.
  template <class Number>
  void range(Number* first, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) pass(first[k]);
  }

  std::size_t count() const { return count_; }

 private:
  template <class Number>
  requires std::is_arithmetic_v<Number> || std::is_enum_v<Number>
  void pass(Number& value) {
    if (pass_ == Pass::read) at_[count_] = static_cast<double>(value);
    if (pass_ == Pass::write) value = static_cast<Number>(at_[count_]);  // as a read stored it
    ++count_;
  }
  template <class Value, std::size_t size>
  void pass(std::array<Value, size>& values) {
    for (Value& value : values) pass(value);
  }
  template <class Value>
  void pass(std::vector<Value>& values) {
    for (Value& value : values) pass(value);
  }
  template <class Value, std::size_t size>
  void pass(Value (&values)[size]) {
    for (Value& value : values) pass(value);
  }
  template <class Value>
  void pass(Compensated<Value>& sum) {
    pass(sum.value);
    pass(sum.compensation);
  }
  template <class Matrix>
  requires requires(Matrix& matrix) { matrix.reshaped(); }
  void pass(Matrix& matrix) {
    for (double& value : matrix.reshaped()) pass(value);
  }
  template <class Part>
  requires requires(Part& part, MemberNumbers& numbers) { part.member(numbers); }
  void pass(Part& part) { part.member(*this); }

  Pass pass_;
  double* at_;
  std::size_t count_ = 0;
};

/// A copy of the member of `part`.
template <class Part>
Member member_of(Part& part) {
  MemberNumbers counted(MemberNumbers::Pass::count);
  part.member(counted);
  Member member{std::vector<double>(counted.count())};
  MemberNumbers read(MemberNumbers::Pass::read, member.numbers.data());
  part.member(read);
  return member;
}

/// Sets the numbers of `part` to those of `member`. Throws std::invalid_argument if their count differs.
template <class Part>
void become(Part& part, const Member& member) {
  MemberNumbers counted(MemberNumbers::Pass::count);
  part.member(counted);
  if (counted.count() != member.numbers.size()) {
    throw std::invalid_argument("member: expected " + std::to_string(counted.count()) +
                                " numbers for these options, got " + std::to_string(member.numbers.size()));
  }
  std::vector<double> numbers = member.numbers;
  MemberNumbers write(MemberNumbers::Pass::write, numbers.data());
  part.member(write);
}

}  // namespace pendula
