#pragma once

#include <array>
#include <cstddef>
#include <pendula/gauss/member_columns.hpp>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// The layout of stage values where several members are solved at once: a pack for each stage, with a member in each
/// lane. StagesInLanes is the layout of one motion.
template <int S, class Number>
struct MembersInLanes {
  using Num = Number;
  using L = ConstantOf<Num>;
  using Cell = Num;
  using Sum = L;
  static constexpr int stages = S, cells = S;
  static constexpr int together =
      S == 1 ? 1 : 2;  ///< stages that a sweep goes through at a time: two hide each other's latency

  template <int Count>
  struct Cells : std::array<Num, static_cast<std::size_t>(Count)> {
    const Num& operator[](int j) const { return this->data()[j]; }
    void set(int j, const Num& value) { this->data()[j] = value; }
  };
  using Row = Cells<S>;
  using Slot = Cells<1>;

  template <class T>
  static const T& spread(const T& x) {
    return x;
  }
  static const L& total(const L& sum) { return sum; }
  static const Num& of_stage(const Num& cell, int /*stage*/) { return cell; }
  static const Num& largest(const Num& cell, int /*stages*/) { return cell; }

  class Columns : public MemberColumns<S, L> {
    using Base = MemberColumns<S, L>;

   public:
    explicit Columns(Family /*gauss*/ = Family::gauss, int /*stages*/ = S) {}
    static constexpr int stages() { return S; }
    static constexpr int deepest() { return Base::most_depth; }

    const Columns& at_hand() const { return *this; }  // no copy: registers do not hold it all
    L weight(int j) const { return L(Base::b(j)); }
    L inverse_weight(int j) const { return L(Base::inverse_b(j)); }

    using History = std::array<const Row*, static_cast<std::size_t>(Base::most_depth)>;
    [[gnu::always_inline]] void extrapolate(const History& last, Row& next, bool times_h) const {
      typename Base::template HistoryOf<Num> bases;
      for (std::size_t d = 0; d < bases.size(); ++d) bases[d] = last[d];
      Base::template extrapolate<Num>(bases, next, times_h);
    }
  };
};

}  // namespace pendula
