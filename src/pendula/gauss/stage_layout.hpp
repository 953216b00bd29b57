#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <pendula/gauss/stage_columns.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/written_out.hpp>

namespace pendula {

/// The layout of stage values where one motion is solved: all stages of a number in one pack. MembersInLanes is the
/// layout of several members. A Row is one number at all stages; it is made of cells, which loops take one by one.
/// Where S is Eigen::Dynamic, the number of stages is given at run time, at most Width; the rest of a row is zero.
template <int S, class Real, int Width = lanes_for<Real>(S)>
struct StagesInLanes {
  using Num = Real;
  using L = Pack<Width, RegisterFor<Width, Real>>;
  using Cell = L;
  using Sum = L;  ///< of what the cells of a row add up to
  static constexpr int stages = S, cells = 1;
  static constexpr int together = 1;  ///< cells that a sweep goes through at a time
  static constexpr auto Z = static_cast<std::size_t>(Width);

  class Row {
    static constexpr std::size_t alignment =
        std::min(pack_alignment, std::max(alignof(Real), std::bit_floor(Z * sizeof(Real))));

   public:
    L operator[](int /*cell*/) const { return L::load(x_); }
    void set(int /*cell*/, const L& value) { value.store(x_); }
    const Real* numbers() const { return x_; }
    Real* numbers() { return x_; }

   private:
    alignas(alignment) Real x_[Z]{};
  };
  using Slot = Row;  ///< room for one cell

  static L spread(const Real& x) { return L(x); }  ///< the same number at all stages

  /// Σ of what is stored at the stages.
  static Real total(const Real* x) {
    constexpr std::size_t summed = S == Eigen::Dynamic ? Z : static_cast<std::size_t>(S);
    Real total = x[0];
    for (std::size_t j = 1; j < summed; ++j) total += x[j];
    return total;
  }
  static Real total(const L& sum) { return total(Stored(sum).x); }

  /// The number of one stage in a cell, and the largest of all.
  static Real of_stage(const L& cell, int stage) { return Stored(cell).x[stage]; }
  static Real largest(const L& cell, int count) {
    const Stored stored(cell);
    return *std::max_element(stored.x, stored.x + count);
  }

  class Columns : public detail::StageColumns<S, Real, Width> {
    using Base = detail::StageColumns<S, Real, Width>;
    static constexpr bool is_fixed = S != Eigen::Dynamic;

   public:
    /// Most steps that a prediction is made from. It pays with few stages, whose steps are short.
    static constexpr int most_depth = (is_fixed ? S <= 3 : Width <= 4) && sizeof(Real) >= sizeof(double) ? 8 : 1;
    int deepest() const { return Base::stages() <= 3 ? most_depth : 1; }

    explicit Columns(Family family = Family::gauss, int count = S) : Base(family, count) {
      for (int j = 0; j < count; ++j) weights_[j] = Base::b(static_cast<std::size_t>(j));
      for (int j = 0; j < count; ++j) inverse_weights_[j] = 1 / weights_[j];
    }

    void prepare(const Real& h) { Base::prepare(h, Real(0)); }

    /// As MemberColumns::predict_at.
    void predict_at(const Real& from, const Real& ratio, const Real& depth) {
      ratio_ = ratio;
      depth_ = static_cast<int>(depth);
      if (is_deep()) {
        if (depth_ == weighed_) return;
        weighed_ = depth_;
        Real weight(-1);  // of a polynomial of degree depth − 1: ±binomial coefficients
        for (int d = 0; d < depth_; ++d) {
          weight = weight * Real(d - depth_) / Real(d + 1);
          across_[static_cast<std::size_t>(d)] = L(weight);
        }
      } else if (from != from_ || ratio != made_for_) {
        Base::predict_at(from_ = from, made_for_ = ratio);
      }
    }

    /// What sweeps need at every link, copied to registers: a compiler must assume that stores to stages change the
    /// columns.
    class AtHand {
     public:
      explicit AtHand(const Columns& columns)
          : hb_(columns.Base::hb()), hc_(columns.Base::hc()), hc_low_(columns.Base::hc_low()) {
        for (std::size_t j = 0; j < S; ++j) m_[j] = columns.Base::column(j);
      }
      const L& hb(int /*cell*/) const { return hb_; }
      const L& hc(int /*cell*/) const { return hc_; }
      const L& hc_low(int /*cell*/) const { return hc_low_; }
      /// start + Σ_j m_ij x_j for all i, x times h b.
      [[gnu::always_inline]] void integrate(const Row& x, const Real& start, Row& integral) const {
        integral.set(0, this->integral(x.numbers(), L(start)));
      }
      [[gnu::always_inline]] L integral(const Real* x, const L& start) const {
        L even = fma(L(x[0]), m_[0], start);
        if constexpr (S > 1) {
          L odd = L(x[1]) * m_[1];
          detail::unrolled<S - 2>([&](auto j) PENDULA_WRITTEN_OUT {
            L& sum = j % 2 == 0 ? even : odd;
            constexpr std::size_t column = static_cast<std::size_t>(j) + 2;
            sum = fma(L(x[column]), m_[column], sum);
          });
          even = even + odd;
        }
        return even;
      }

     private:
      std::array<L, static_cast<std::size_t>(S)> m_;
      L hb_, hc_, hc_low_;
    };
    AtHand at_hand() const requires is_fixed { return AtHand(*this); }

    /// The same where the number of stages is given at run time: registers would not hold the columns.
    class Reference {
     public:
      explicit Reference(const Columns& columns) : columns_(columns) {}
      L hb(int /*cell*/) const { return columns_.Base::hb(); }
      void integrate(const Row& x, const Real& start, Row& integral) const {
        integral.set(0, columns_.integral(x.numbers(), L(start)));
      }

     private:
      const Columns& columns_;
    };
    Reference at_hand() const requires(!is_fixed) { return Reference(*this); }

    /// b, and 1/b.
    L weight(int /*cell*/) const { return L::load(weights_); }
    L inverse_weight(int /*cell*/) const { return L::load(inverse_weights_); }

    /// The stages of the last steps, the newest first; either all of them hold the factor h, or none.
    using History = std::array<const Row*, static_cast<std::size_t>(most_depth)>;
    [[gnu::always_inline]] void extrapolate(const History& last, Row& next, bool times_h) const {
      if (is_deep()) {
        L sum = across_[0] * (*last[0])[0];
        for (std::size_t d = 1; d < static_cast<std::size_t>(depth_); ++d) sum = fma(across_[d], (*last[d])[0], sum);
        next.set(0, sum);
        return;
      }
      const L value = Base::extrapolated(last[0]->numbers());
      next.set(0, times_h ? L(ratio_) * value : value);
    }

    /// The mean over a step of the function with these stage values.
    Real mean(const Row& x) const { return StagesInLanes::total(weight(0) * x[0]); }
    static Real total(const Row& x) { return StagesInLanes::total(x.numbers()); }

   private:
    bool is_deep() const { return most_depth > 1 && depth_ > (is_fixed ? S : Base::stages()); }

    Real from_{1}, made_for_{1}, ratio_{1};
    int depth_ = 1, weighed_ = 0;  // steps that predictions are made from, now and when `across_` was computed
    std::array<L, static_cast<std::size_t>(most_depth)> across_;
    alignas(pack_alignment) Real weights_[Z]{};
    alignas(pack_alignment) Real inverse_weights_[Z]{};
  };

 private:
  struct Stored {
    explicit Stored(const L& cell) { cell.store(x); }
    alignas(pack_alignment) Real x[Z];
  };
};

}  // namespace pendula
