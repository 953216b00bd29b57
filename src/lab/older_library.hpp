#pragma once

// What this project uses of C++20 and the C++ library of emscripten 3.1.6 (libc++ 13) lacks. Included before all else
// where the laboratory is compiled; newer libraries have all of it themselves.
#ifdef __cplusplus
#include <version>
#if defined(_LIBCPP_VERSION) && _LIBCPP_VERSION < 15000
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <ranges>
#include <string>
#include <system_error>
#include <thread>
#include <type_traits>
#include <utility>

namespace std {

template <class To, class From>
constexpr To bit_cast(const From& from) noexcept {
  return __builtin_bit_cast(To, from);
}

// Of numbers in text this library has whole ones alone.
inline to_chars_result to_chars(char* first, char* last, double value, chars_format, int digits) {
  const int written = snprintf(first, static_cast<size_t>(last - first), "%.*g", digits, value);
  return {first + written, errc()};
}
inline to_chars_result to_chars(char* first, char* last, double value) {
  int digits = 1;
  while (digits < 17) {
    char text[32];
    snprintf(text, sizeof text, "%.*g", digits, value);
    if (strtod(text, nullptr) == value) break;
    ++digits;
  }
  return to_chars(first, last, value, chars_format::general, digits);
}
inline from_chars_result from_chars(const char* first, const char* last, double& value) {
  const string text(first, last);
  char* end = nullptr;
  const double read = strtod(text.c_str(), &end);
  if (end == text.c_str()) return {first, errc::invalid_argument};
  value = read;
  return {first + (end - text.c_str()), errc()};
}

// Only ever asked to begin with one thread, which is no thread of its own.
using jthread = thread;

namespace ranges {

template <class Range, class Out>
constexpr void copy(Range&& range, Out out) {
  std::copy(std::begin(range), std::end(range), out);
}
template <class Range, class Out>
constexpr void move(Range&& range, Out out) {
  std::move(std::begin(range), std::end(range), out);
}
template <class Range, class Out, class Function>
constexpr void transform(Range&& range, Out out, Function function) {
  std::transform(std::begin(range), std::end(range), out, function);
}
template <class A, class B, class Out, class Function>
constexpr void transform(A&& a, B&& b, Out out, Function function) {
  std::transform(std::begin(a), std::end(a), std::begin(b), out, function);
}
template <class A, class B, class Same = std::equal_to<>, class OfA = std::identity, class OfB = std::identity>
constexpr bool equal(const A& a, const B& b, Same same = {}, OfA of_a = {}, OfB of_b = {}) {
  return std::equal(std::begin(a), std::end(a), std::begin(b), std::end(b),
                    [&](const auto& x, const auto& y) { return invoke(same, invoke(of_a, x), invoke(of_b, y)); });
}
template <class Range, class Predicate>
constexpr bool all_of(Range&& range, Predicate predicate) {
  return std::all_of(std::begin(range), std::end(range), predicate);
}
template <class Range, class Predicate>
constexpr bool any_of(Range&& range, Predicate predicate) {
  return std::any_of(std::begin(range), std::end(range), predicate);
}
template <class Range, class Predicate>
constexpr bool none_of(Range&& range, Predicate predicate) {
  return std::none_of(std::begin(range), std::end(range), predicate);
}
template <class Range, class Predicate>
constexpr auto count_if(Range&& range, Predicate predicate) {
  return std::count_if(std::begin(range), std::end(range), predicate);
}
template <class Range, class Predicate>
constexpr auto find_if(Range&& range, Predicate predicate) {
  return std::find_if(std::begin(range), std::end(range), predicate);
}
template <class Range, class T, class Of = std::identity>
constexpr auto find(Range&& range, const T& value, Of of = {}) {
  return std::find_if(std::begin(range), std::end(range), [&](const auto& each) { return invoke(of, each) == value; });
}
template <class Range, class T, class Less = std::less<>, class Of = std::identity>
constexpr auto lower_bound(Range&& range, const T& value, Less before = {}, Of of = {}) {
  return std::lower_bound(std::begin(range), std::end(range), value,
                          [&](const auto& each, const T& x) { return invoke(before, invoke(of, each), x); });
}
template <class Range, class T, class Less = std::less<>, class Of = std::identity>
constexpr auto upper_bound(Range&& range, const T& value, Less before = {}, Of of = {}) {
  return std::upper_bound(std::begin(range), std::end(range), value,
                          [&](const T& x, const auto& each) { return invoke(before, x, invoke(of, each)); });
}
template <class Range, class Less = std::less<>, class Of = std::identity>
constexpr void sort(Range&& range, Less before = {}, Of of = {}) {
  std::sort(std::begin(range), std::end(range),
            [&](const auto& x, const auto& y) { return invoke(before, invoke(of, x), invoke(of, y)); });
}
template <class Range, class Place>
constexpr void nth_element(Range&& range, Place place) {
  std::nth_element(std::begin(range), place, std::end(range));
}
template <class Range>
constexpr bool is_sorted(Range&& range) {
  return std::is_sorted(std::begin(range), std::end(range));
}
template <class Range, class Less = std::less<>, class Of = std::identity>
constexpr auto max_element(Range&& range, Less before = {}, Of of = {}) {
  return std::max_element(std::begin(range), std::end(range),
                          [&](const auto& x, const auto& y) { return invoke(before, invoke(of, x), invoke(of, y)); });
}
template <class Range>
constexpr auto max(const Range& range) {
  return *std::max_element(std::begin(range), std::end(range));
}
template <class Range>
constexpr auto minmax(const Range& range) {
  const auto [least, most] = std::minmax_element(std::begin(range), std::end(range));
  return std::pair(*least, *most);
}

}  // namespace ranges
}  // namespace std

#endif
#endif
