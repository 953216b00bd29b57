#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/lobatto_nodes.hpp>
#include <pendula/gauss/stage_layout.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/general_inverse.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/constraint_forces.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

/// Constraints of a system in a step of a Gauss method: they hold at Lobatto nodes (LobattoNodes), by impulses there.
/// Of the last node, the impulse makes rates keep the constraints, too.
///
/// Constraints of rates, A v + b = 0, hold at the stages. What they lack is told as if they were of positions: as its
/// integral up to the Lobatto nodes, Σ_j r_kj h b_j (A V_j + b), which vanishes at all of them where it does at all
/// stages. If A v + b is the rate of a function that is linear in coordinates, these are the values of that function.
template <int Width>
class StageConstraints {
  static constexpr auto width = static_cast<std::size_t>(Width);
  using Rows = PackRows<width>;

 public:
  using L = typename LobattoNodes<Width>::L;
  using Columns = typename StagesInLanes<Eigen::Dynamic, double, Width>::Columns;
  /// Where increments (2 coordinates) lead from the start of a step.
  struct Way {
    const Compensated<double>* start;
    const double* increments;
    const Columns& columns;
    const SystemAt<Width>& stages;
  };

  StageConstraints(const SystemModel& model, int stages)
      : nodes_(stages),
        at_nodes_(model),
        here_(model),
        start_(model.info()),
        end_(model.info()),
        count_(start_.count()),
        coordinates_(model.coordinates()),
        impulses_(count_),
        pushes_(coordinates_),
        places_(coordinates_),
        still_(coordinates_),
        moving_(coordinates_),
        curvature_(coordinates_ * coordinates_),
        values_(count_),
        slopes_(count_ * coordinates_),
        rates_(2 * count_),
        by_place_(count_ * coordinates_),
        at_rest_(count_ * coordinates_),
        first_(count_),
        last_(count_),
        end_push_(coordinates_),
        room_(3 * coordinates_),
        start_place_(coordinates_),
        lacking_(count_ * nodes_.stages()),
        moved_(lacking_.size() * coordinates_),
        inverse_(lacking_.size() * lacking_.size()),
        masses_(static_cast<Eigen::Index>(coordinates_)),
        responses_(static_cast<Eigen::Index>(lacking_.size())) {
    for (const bool is_of_rates : model.info().constraint_is_of_rates) of_rates_ = of_rates_ || is_of_rates;
    if (!of_rates_) return;
    for (Rows* rows : {&stage_places_, &stage_rates_}) *rows = Rows(coordinates_);
    for (Rows* rows : {&stage_values_, &stage_second_}) *rows = Rows(count_);
    for (Rows* rows : {&stage_slopes_, &stage_by_place_}) *rows = Rows(count_ * coordinates_);
  }

  std::size_t count() const { return count_; }
  /// How many coordinates and rates follow from others by them, where a step began last.
  std::size_t conditions() {
    std::vector<double> inverse(count_ * count_);
    return start_.find_inverse_of_positions(inverse.data()) + start_.independent();
  }

  /// Adds to accelerations what constraints bring in a state.
  void accelerate(double time, const double* q, const double* v, double* a) {
    here_.set_time(time);
    start_.look(here_, q);
    start_.find(here_, q, v, a, first_.data());
    start_.move(first_.data(), a);
  }

  /// A step of h begins at q, v. Changes of coordinates are weighed.
  void prepare(double time, double h, const double* q, const double* v, const double* weights) {
    time_ = time;
    h_ = h;
    here_.set_time(time);
    start_.look(here_, q);
    std::copy_n(q, coordinates_, start_place_.begin());
    find_rounding(q, v, weights);
    at_nodes_.set_times([&](std::size_t k) { return time + h * nodes_.d(std::min(k + 1, nodes_.stages())); });
  }

  /// Impulses as at the start of the step, for accelerations a without constraints.
  void start_cold(const double* q, const double* v, const double* a) {
    start_.find(here_, q, v, a, first_.data());
    for (std::size_t i = 0; i < count_; ++i) {
      std::fill_n(impulses_[i], width, 0.0);  // where an iteration has failed, nothing is left of it
      for (std::size_t k = 0; k < nodes_.stages(); ++k) impulses_[i][k] = h_ * nodes_.w(k) * first_[i];
    }
  }
  /// Impulses that continue those of the last step (LobattoNodes::predict_at).
  void predict(double from, double ratio) {
    nodes_.predict_at(from, ratio);
    for (std::size_t i = 0; i < count_; ++i) nodes_.predicted(impulses_[i]).store(impulses_[i]);
  }
  /// Finds what these push on the way that increments are predicted to lead  (2 coordinates).
  void set_out(const Way& way) {
    look(way);
    push();
    find_inverse();
  }

  /// What impulses add to the momentum of coordinate k at the stages, and increments that would add it.
  L pushed(std::size_t k) const { return nodes_.pushed(pushes_[k]); }
  L as_increments(std::size_t k) const { return nodes_.as_increments(pushes_[k]); }

  /// Corrects the impulses by what constraints lack where increments lead to.
  void correct(const Way& way) {
    look(way);
    const std::size_t all = count_ * nodes_.stages();
    for (std::size_t k = 0; k < nodes_.stages(); ++k) {
      for (std::size_t i = 0; i < count_; ++i) lacking_[k * count_ + i] = values_[i][k] / h_;
    }
    for (std::size_t m = 0; m < nodes_.stages(); ++m) {
      for (std::size_t j = 0; j < count_; ++j) {
        const double* const row = inverse_.data() + (m * count_ + j) * all;
        double sum = 0;
        for (std::size_t at = 0; at < all; ++at) sum += row[at] * lacking_[at];
        impulses_[j][m] -= sum;
      }
    }
    push();
  }

  // --- For Newton ---

  /// Looks at constraints where increments lead.
  void follow(const Way& way) {
    look(way);
    push();
  }
  /// The same, with what the following derivatives need.
  void linearize(const Way& way) {
    follow(way);
    find_curvature();
    if (of_rates_) find_slopes_at_stages(way);
  }
  /// What constraint i lacks at the nodes 1 … s, and its derivative by an increment of coordinate k at stage j.
  L lacking(std::size_t i) const { return fma(L(softness(i)), L::load(impulses_[i]), L::load(values_[i])); }
  L lacking_by(const Columns& columns, std::size_t i, std::size_t k, std::size_t j) const {
    if (is_of_rates(i)) return lacking_by_rates(columns, i * coordinates_ + k, j);
    return L::load(slopes_[i * coordinates_ + k]) * nodes_.reach(j);
  }
  /// The derivative of pushed(k) by the impulse of constraint i at node m.
  L pushed_by(std::size_t k, std::size_t i, std::size_t m) const { return L(slope(m, i, k)) * nodes_.push(m); }
  /// The derivative of pushed(k) by an increment of coordinate l at stage j, which moves nodes.
  L pushed_by_increment(std::size_t k, std::size_t l, std::size_t j) const {
    alignas(pack_alignment) double numbers[width] = {};
    const double* const curved = curvature_[k * coordinates_ + l];
    for (std::size_t m = 1; m < nodes_.stages(); ++m) numbers[m] = curved[m - 1] * nodes_.reach(j, m);
    return nodes_.pushed(numbers);
  }
  /// How far constraint i gives way to its impulse: where constraints follow from others, so much that Newton's matrix
  /// is regular, and impulses that do nothing stay small.
  double softness(std::size_t i) const {
    if (!start_.depend()) return 0;
    double sum = 0;
    for (std::size_t k = 0; k < coordinates_; ++k) sum += start_.slope(i, k) * start_.moved(i, k);
    return softest * h_ * sum;
  }
  void correct(std::size_t i, std::size_t node, double by) { impulses_[i][node] -= by; }

  // --- For the derivative of a step that is solved and finished, after linearize ---

  /// The impulses at the nodes 0 … s − 1, and at the end; and coordinates at the nodes 1 … s.
  double impulse(std::size_t i, std::size_t node) const { return impulses_[i][node]; }
  std::span<const double> impulses_at_end() const { return last_; }
  double place(std::size_t k, std::size_t node) const { return places_[k][node - 1]; }
  double time_of(std::size_t node) const { return time_ + h_ * nodes_.d(node); }
  /// What a push at a node adds to momenta at the stages.
  L push(std::size_t node) const { return nodes_.push(node); }
  /// What pushes coordinate k at the nodes 0 … s − 1 changes by, where coordinate l at the start does, and everything
  /// with it. `at_start` is Σ_i J_i ∂²g_i/∂q_k ∂q_l at node 0.
  struct ByStart {
    L pushed;         ///< at the stages
    double together;  ///< at the end
  };
  ByStart pushed_by_start(std::size_t k, std::size_t l, double at_start) const {
    alignas(pack_alignment) double numbers[width] = {};
    numbers[0] = at_start;
    for (std::size_t m = 1; m < nodes_.stages(); ++m) numbers[m] = curvature_[k * coordinates_ + l][m - 1];
    return {nodes_.pushed(numbers), total(numbers)};
  }
  /// The same at the end, by an increment of coordinate l at stage j.
  double pushed_by_increment_together(std::size_t k, std::size_t l, std::size_t j) const {
    double sum = 0;
    for (std::size_t m = 1; m < nodes_.stages(); ++m)
      sum += curvature_[k * coordinates_ + l][m - 1] * nodes_.reach(j, m);
    return sum;
  }
  /// The slope of constraint i by coordinate k at a node; at the nodes 1 … s.
  double slope(std::size_t node, std::size_t i, std::size_t k) const {
    return node == 0 ? start_.slope(i, k) : slopes_[i * coordinates_ + k][node - 1];
  }
  /// What constraint i lacks at the nodes 1 … s, by coordinate k at the start, which moves all stages and nodes.
  L lacking_by_start(const Columns& columns, std::size_t i, std::size_t k) const {
    const std::size_t at = i * coordinates_ + k;
    if (!is_of_rates(i)) return L::load(slopes_[at]);
    alignas(pack_alignment) double numbers[width] = {};
    for (std::size_t j = 0; j < nodes_.stages(); ++j) numbers[j] = columns.hb(j) * stage_by_place_[at][j];
    return nodes_.reached(numbers, L(0.0));
  }
  /// How far an increment of stage j moves a node from 1 on.
  double reach(std::size_t j, std::size_t node) const { return nodes_.reach(j, node); }

  /// What rounding of coordinates, by way of the constraints, makes of increments; as changes are weighed.
  double rounding() const { return rounding_; }

  /// Finds the impulse at the end of the solved step, which the momenta reach without it from `start`  (2 coordinates).
  void finish(const Compensated<double>* start, const double* increments) {
    double *const q = room_.data(), *const p = q + coordinates_, *const v = p + coordinates_;
    for (std::size_t k = 0; k < coordinates_; ++k) {
      end_push_[k] = total(pushes_[k]);
      q[k] = end(start[k], increments + k * width, 0);
    }
    here_.set_time(time_ + h_);
    end_.look(here_, q);
    std::fill(last_.begin(), last_.end(), 0.0);
    for (int correction = 0; correction < 2; ++correction) {
      for (std::size_t k = 0; k < coordinates_; ++k) {
        const std::size_t momentum = coordinates_ + k;
        p[k] = end(start[momentum], increments + momentum * width, end_push_[k]);
      }
      here_(&SystemFunctions::velocity_from_momentum, q, p, v);
      end_.stop(here_, q, v, first_.data());
      for (std::size_t i = 0; i < count_; ++i) {
        last_[i] += first_[i];
        for (std::size_t k = 0; k < coordinates_; ++k) end_push_[k] += end_.slope(i, k) * first_[i];
      }
    }
  }

  /// The largest value of a constraint at the end of the finished step, and the largest rate.
  std::pair<double, double> errors() const {
    double place = 0, rate = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      place = std::max(place, std::abs(end_.value(i)));
      rate = std::max(rate, std::abs(end_.rate(i)));
    }
    return {place, rate};
  }

  /// What all impulses of the finished step add to momenta  (coordinates).
  std::span<const double> end_pushes() const { return end_push_; }

  /// Energy that constraints which move bring in the finished step  [J].
  double work(const Compensated<double>* start) {
    double *const q = room_.data(), *const still = q + coordinates_;
    for (std::size_t k = 0; k < coordinates_; ++k) {
      q[k] = start[k].value;
      still[k] = 0;
    }
    here_.set_time(time_);
    start_.stop(here_, q, still, first_.data());
    at_nodes_(&SystemFunctions::constraint_rates, places_[0], still_[0], rates_[0], rates_[count_]);
    double work = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double* const moved = rates_[i];
      work -= impulses_[i][0] * start_.rate(i) + last_[i] * moved[nodes_.stages() - 1];
      for (std::size_t node = 1; node < nodes_.stages(); ++node) work -= impulses_[i][node] * moved[node - 1];
    }
    return work;
  }

  /// Throws std::invalid_argument unless a state keeps the constraints.
  void require(double time, const double* q, const double* v) {
    here_.set_time(time);
    start_.look(here_, q);
    start_.stop(here_, q, v, first_.data());
    for (std::size_t i = 0; i < count_; ++i) {
      double speed = at_rest * size(i, q);
      const double fastest = at_rest * fastest_of(v);  // which leaves its rounding in the others
      for (std::size_t k = 0; k < coordinates_; ++k) speed += std::abs(start_.slope(i, k)) * (std::abs(v[k]) + fastest);
      require(i, "0", start_.value(i), size(i, q));
      require(i, "a rate of 0", start_.rate(i), speed);
    }
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    for (std::size_t i = 0; i < count_; ++i) numbers.range(impulses_[i], nodes_.stages());
  }

 private:
  static double total(const double* numbers) {
    double sum = 0;
    for (std::size_t k = 0; k < width; ++k) sum += numbers[k];
    return sum;
  }
  static double end(const Compensated<double>& start, const double* increments, double more) {
    return start.value + (start.compensation + (total(increments) + more));
  }

  double fastest_of(const double* v) const {
    double most = 0;
    for (std::size_t k = 0; k < coordinates_; ++k) most = std::max(most, std::abs(v[k]));
    return most;
  }

  bool is_of_rates(std::size_t i) const { return of_rates_ && at_nodes_.model().info().constraint_is_of_rates[i]; }

  // Coordinates and constraints at the nodes.
  void look(const Way& way) {
    for (std::size_t k = 0; k < coordinates_; ++k) {
      const Compensated<double>& start = way.start[k];
      (L(start.value) + nodes_.reached(way.increments + k * width, L(start.compensation))).store(places_[k]);
    }
    at_nodes_(&SystemFunctions::constraints, places_[0], values_[0], slopes_[0]);
    if (of_rates_) look_at_stages(way);
  }

  // What constraints of rates lack.
  void look_at_stages(const Way& way) {
    for (std::size_t k = 0; k < coordinates_; ++k) {
      const double* const moved = way.increments + k * width;
      const Compensated<double>& start = way.start[k];
      (L(start.value) + way.columns.integral(moved, L(start.compensation))).store(stage_places_[k]);
      for (std::size_t j = 0; j < nodes_.stages(); ++j) stage_rates_[k][j] = moved[j] / way.columns.hb(j);
    }
    way.stages(&SystemFunctions::constraint_rates, stage_places_[0], stage_rates_[0], stage_values_[0],
               stage_second_[0]);
    for (std::size_t i = 0; i < count_; ++i) {
      if (!is_of_rates(i)) continue;
      for (std::size_t j = 0; j < nodes_.stages(); ++j) stage_values_[i][j] *= way.columns.hb(j);
      nodes_.reached(stage_values_[i], L(0.0)).store(values_[i]);
    }
  }
  void find_slopes_at_stages(const Way& way) {
    way.stages(&SystemFunctions::constraints, stage_places_[0], stage_second_[0], stage_slopes_[0]);
    way.stages(&SystemFunctions::constraint_rate_slopes, stage_places_[0], stage_rates_[0], stage_by_place_[0]);
  }
  L lacking_by_rates(const Columns& columns, std::size_t at, std::size_t j) const {
    alignas(pack_alignment) double numbers[width] = {};
    for (std::size_t n = 0; n < nodes_.stages(); ++n) {
      numbers[n] = columns.hb(n) * stage_by_place_[at][n] * columns.m(n, j);
    }
    numbers[j] += stage_slopes_[at][j];
    return nodes_.reached(numbers, L(0.0));
  }

  void find_rounding(const double* q, const double* v, const double* weights) {
    for (std::size_t i = 0; i < count_; ++i) first_[i] = is_of_rates(i) ? way_of(i, v) : size(i, q);
    rounding_ = 0;
    double most = 0;
    for (std::size_t k = 0; k < coordinates_; ++k) {
      double sum = 0;
      for (std::size_t i = 0; i < count_; ++i) {
        for (std::size_t j = 0; j < count_; ++j) {
          sum += std::abs(start_.moved(i, k) * start_.inverse(i, j)) * first_[j];
        }
      }
      rounding_ = std::max(rounding_, weights[k] * sum);
      most = std::max(most, weights[k] * size_of(q, k));
    }
    rounding_ *= roundings * nodes_.gain() * std::numeric_limits<double>::epsilon();
    rounding_ = std::min(rounding_, largest_rounding * most);
  }

  // What coordinates as large as these bring to a constraint.
  double size(std::size_t which, const double* q) const {
    double sum = 0;
    for (std::size_t k = 0; k < coordinates_; ++k) sum += std::abs(start_.slope(which, k)) * size_of(q, k);
    return sum;
  }
  // What goes by in a step of a constraint of rates.
  double way_of(std::size_t which, const double* v) const {
    double sum = 0;
    for (std::size_t k = 0; k < coordinates_; ++k) sum += std::abs(start_.slope(which, k) * v[k]);
    return std::abs(h_) * sum;
  }
  double size_of(const double* q, std::size_t k) const {
    return std::max(std::abs(q[k]), at_nodes_.model().info().is_angle[k] ? 1.0 : 0.0);
  }

  // How constraints at the nodes respond to impulses at others, with the slopes that are predicted there, and the
  // masses in the middle; inverted.
  void find_inverse() {
    const std::size_t stages = nodes_.stages(), all = count_ * stages, middle = stages / 2;
    for (std::size_t k = 0; k < coordinates_; ++k) {
      room_[k] = middle == 0 ? start_place_[k] : places_[k][middle - 1];
    }
    here_.set_time(time_ + h_ * nodes_.d(middle));
    here_(&SystemFunctions::mass_matrix, room_.data(), masses_.matrix.data());
    for (std::size_t m = 0; m < stages; ++m) {
      for (std::size_t j = 0; j < count_; ++j) {
        for (std::size_t k = 0; k < coordinates_; ++k) moved_[(m * count_ + j) * coordinates_ + k] = slope(m, j, k);
      }
    }
    masses_.solve(moved_.data(), static_cast<Eigen::Index>(all));
    for (std::size_t n = 0; n < stages; ++n) {
      for (std::size_t i = 0; i < count_; ++i) {
        for (std::size_t m = 0; m < stages; ++m) {
          for (std::size_t j = 0; j < count_; ++j) {
            const double* const moved = moved_.data() + (m * count_ + j) * coordinates_;
            double sum = 0;
            for (std::size_t k = 0; k < coordinates_; ++k) sum += slope(n + 1, i, k) * moved[k];
            // Transposed: of the inverse, rows are asked for.
            responses_.matrix(static_cast<Eigen::Index>(m * count_ + j), static_cast<Eigen::Index>(n * count_ + i)) =
                nodes_.response(n, m) * sum;
          }
        }
      }
    }
    responses_.find(inverse_.data());
  }

  // Σ_i J_i ∂G_ik/∂q_l at the nodes 1 … s − 1: dg/dt is linear in rates.
  void find_curvature() {
    for (std::size_t k = 0; k < coordinates_; ++k) std::fill_n(moving_[k], width, 0.0);
    at_nodes_(&SystemFunctions::constraint_rate_slopes, places_[0], moving_[0], at_rest_[0]);
    for (std::size_t k = 0; k < coordinates_; ++k) {
      std::fill_n(moving_[k], width, 1.0);
      at_nodes_(&SystemFunctions::constraint_rate_slopes, places_[0], moving_[0], by_place_[0]);
      std::fill_n(moving_[k], width, 0.0);
      for (std::size_t l = 0; l < coordinates_; ++l) {
        double* const curved = curvature_[k * coordinates_ + l];
        std::fill_n(curved, width, 0.0);
        for (std::size_t i = 0; i < count_; ++i) {
          const std::size_t at = i * coordinates_ + l;
          for (std::size_t m = 1; m < nodes_.stages(); ++m) {
            curved[m - 1] += impulses_[i][m] * (by_place_[at][m - 1] - at_rest_[at][m - 1]);
          }
        }
      }
    }
  }

  // What impulses push, by slopes at the nodes.
  void push() {
    for (std::size_t k = 0; k < coordinates_; ++k) {
      double* const pushed = pushes_[k];
      std::fill_n(pushed, width, 0.0);
      for (std::size_t i = 0; i < count_; ++i) {
        const double* const slopes = slopes_[i * coordinates_ + k];
        pushed[0] += start_.slope(i, k) * impulses_[i][0];
        for (std::size_t node = 1; node < nodes_.stages(); ++node)
          pushed[node] += slopes[node - 1] * impulses_[i][node];
      }
    }
  }

  void require(std::size_t which, const char* expected, double got, double size) const {
    if (std::abs(got) <= kept * size || got == 0) return;
    std::ostringstream text;
    text << expected << " at the start, got " << got;
    fail(which, text.str());
  }
  [[noreturn]] void fail(std::size_t which, const std::string& what) const {
    throw std::invalid_argument("constraint " + std::string(at_nodes_.model().info().constraints[which]) +
                                ": expected " + what);
  }

  static constexpr double roundings = 4;             // of a sum
  static constexpr double largest_rounding = 1e-12;  // of coordinates, where constraints nearly depend on one another
  static constexpr double softest = 1e-13;           // relative to how far impulses would move it without constraints
  static constexpr double kept = 1e-10;              // by a start, relative to what coordinates and rates are
  static constexpr double at_rest = 1e-4;            // of coordinates a second: rounding moves them, too

  LobattoNodes<Width> nodes_;
  SystemAt<Width> at_nodes_;
  SystemAt<1> here_;
  ConstraintForces start_, end_;
  std::size_t count_, coordinates_;
  Rows impulses_;                 // h w λ at the nodes 0 … s − 1, of the last step that was tried
  Rows pushes_;                   // what they push
  Rows places_, still_, moving_;  // at the nodes 1 … s
  Rows curvature_;                // there, of what impulses push
  Rows values_, slopes_, rates_;  // of the constraints there
  Rows by_place_, at_rest_;       // ∂(dg/dt)/∂q
  bool of_rates_ = false;         // whether some are
  Rows stage_places_, stage_rates_, stage_values_, stage_second_, stage_slopes_, stage_by_place_;  // at the stages
  std::vector<double> first_, last_, end_push_, room_, start_place_;
  std::vector<double> lacking_, moved_, inverse_;
  LinearSystem masses_;
  GeneralInverse responses_;
  double time_ = 0, h_ = 0, rounding_ = 0;
};

}  // namespace pendula
