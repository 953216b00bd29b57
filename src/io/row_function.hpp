#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <pendula/numeric/interval.hpp>
#include <pendula/numeric/reach.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/quantity.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <span>
#include <utility>
#include <vector>

#include "io/expression.hpp"

namespace pendula::io {

/// A function of the motion: an expression in the columns of its row.
class RowFunction : public Formula {
 public:
  RowFunction(std::shared_ptr<const Subject> subject, std::shared_ptr<Expression> expression, const Motion& start)
      : subject_(std::move(subject)), expression_(std::move(expression)), numbers_(columns().size()) {
    std::size_t of_motion = std::numeric_limits<std::size_t>::max();  // first column of points or energy
    for (const Quantity& quantity : subject_->quantities()) {
      if (quantity.is_observed()) of_motion = std::min(of_motion, quantity.first);
    }
    const auto is_observed = [&](std::size_t column) { return column >= of_motion; };
    observes_ = std::ranges::any_of(columns(), is_observed);
    has_time_ = std::ranges::find(columns(), time_column) != columns().end();
    reaches_.resize(columns().size());
    find_places(start);
  }

  double operator()(const Motion& motion) {
    if (can_enclose()) {
      for (std::size_t k = 0; k < numbers_.size(); ++k) numbers_[k] = at(places_[k], motion);
    } else {
      take_row(motion);
      for (std::size_t k = 0; k < numbers_.size(); ++k) numbers_[k] = row_[columns()[k]];
    }
    return (*expression_)(numbers_);
  }

  /// Whether `enclose` may be asked: it needs nothing but time, coordinates and rates.
  bool can_enclose() const { return places_.size() == columns().size(); }
  Interval enclose(const MotionRange& range) {
    for (std::size_t k = 0; k < reaches_.size(); ++k) {
      reaches_[k] = Reach({at(places_[k], range.least), at(places_[k], range.most)}, Interval::all());
    }
    const Reach found = (*expression_)(std::span<const Reach>(reaches_));
    return found.defined == Reach::Defined::everywhere ? found.value : Interval::all();
  }

  std::size_t size() const override { return columns().size() - (has_time_ ? 1 : 0); }

  void read(const Motion& motion, std::span<double> numbers) override {
    take_row(motion);
    auto number = numbers.begin();
    for (const std::size_t column : columns()) {
      if (column != time_column) *number++ = row_[column];
    }
  }

  double value(double time, std::span<const double> numbers) override {
    return (*expression_)(with_time(time, numbers, numbers_));
  }
  Reach reach(const Reach& time, std::span<const Reach> numbers) override {
    return (*expression_)(with_time(time, numbers, reaches_));
  }

 private:
  static constexpr std::size_t time_column = 0;

  const std::vector<std::size_t>& columns() const { return expression_->columns(); }

  /// The place of a number of a row in a motion.
  struct MotionIndex {
    enum class Of { time, coordinates, rates } of = Of::time;
    Eigen::Index index = 0;
  };
  static double at(const MotionIndex& place, const Motion& motion) {
    if (place.of == MotionIndex::Of::time) return motion.time;
    return (place.of == MotionIndex::Of::coordinates ? motion.q : motion.v)[place.index];
  }

  /// Finds the places of all numbers of the expression, or none if one of them is not part of a motion. It reads them
  /// off the row of a motion whose numbers are their own indices.
  void find_places(Motion motion) {
    const auto count = static_cast<double>(motion.q.size());
    motion.q.setLinSpaced(1, count);
    motion.v = -motion.q;
    row_.clear();
    subject_->append_row(motion, {}, row_);
    const std::vector<Quantity> quantities = subject_->quantities();
    for (const std::size_t column : columns()) {
      const auto quantity = std::ranges::find_if(quantities, [&](const Quantity& one) { return one.holds(column); });
      if (quantity->role > Role::rate) return places_.clear();
      const auto index = static_cast<Eigen::Index>(std::abs(row_[column])) - 1;
      places_.push_back(quantity->role == Role::time         ? MotionIndex{}
                        : quantity->role == Role::coordinate ? MotionIndex{MotionIndex::Of::coordinates, index}
                                                             : MotionIndex{MotionIndex::Of::rates, index});
    }
  }

  void take_row(const Motion& motion) {
    row_.clear();
    subject_->append_row(motion, observes_ ? subject_->observe(motion) : Observation(), row_);
  }

  /// Puts the time and the other numbers into `all`, in the order of columns.
  template <class Number>
  std::span<const Number> with_time(const Number& time, std::span<const Number> others, std::vector<Number>& all) {
    auto other = others.begin();
    for (std::size_t k = 0; k < all.size(); ++k) all[k] = columns()[k] == time_column ? time : *other++;
    return all;
  }

  std::shared_ptr<const Subject> subject_;
  std::shared_ptr<Expression> expression_;
  std::vector<double> row_, numbers_;  // all columns of a row; the columns of the expression
  std::vector<Reach> reaches_;
  bool observes_ = false;  // whether the expression needs energy or points, which cost more
  bool has_time_ = false;
  std::vector<MotionIndex> places_;  // of the columns; empty if a motion has not all of them
};

}  // namespace pendula::io
