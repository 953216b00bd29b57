#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <pendula/kernels/gauss_tableaux.hpp>
#include <span>
#include <vector>

namespace pendula {

namespace detail {

/// Legendre polynomials P_0 to P_n shifted to (0, 1), at x.
template <std::size_t n>
constexpr std::array<double, n + 1> legendre_polynomials(double x) {
  const double y = 2 * x - 1;
  std::array<double, n + 1> values{1, y};
  for (std::size_t m = 1; m < n; ++m) {
    const auto degree = static_cast<double>(m);
    values[m + 1] = ((2 * degree + 1) * y * values[m] - degree * values[m - 1]) / (degree + 1);
  }
  return values;
}

/// exp(−negligible_exponent) is negligible.
inline constexpr double negligible_exponent = 60;

}  // namespace detail

/// Checks whether forces change between the nodes of a step: a wall or a pulse narrower than their spacing is seen by
/// none of them.
///
/// The functions of a model change rapidly only near certain values of their arguments: exp, tanh and the like where
/// the argument crosses zero or has an extremum, powers and logarithms where the argument is smallest. The arguments
/// are smooth along the polynomial of a step, so that few samples locate such places; there, forces are integrated over
/// ever shorter intervals. "Share" is the fraction of the step that is done, 0 to 1.
class FieldLook {
 public:
  /// `nodes` of the method; `few` samples of the step are cheap enough for every step. `is_base` tells of each argument
  /// whether it is the base of a power. Changes of up to `smooth` from sample to sample, as `changes` measures them,
  /// are left to the error estimate of the step.
  FieldLook(int nodes, int few, std::span<const bool> is_base, double smooth = much)
      : is_base_(is_base.begin(), is_base.end()), smooth_(smooth), parts_(std::max(1, nodes / 2)) {
    if (is_base.empty()) return;
    few_ = spread(few - 1);
    samples_ = spread(std::max(least_intervals, 2 * nodes));
    places_.reserve(most_places);
  }

  /// A change from sample to sample that is not small.
  static constexpr double much = 0.5;

  /// Whether the model has functions that may change within a short time.
  bool has_to_look() const { return !is_base_.empty(); }

  /// Whether a few samples show that a function may change fast. arguments(shares, found) writes the arguments of the
  /// model's functions, (shares, arguments).
  template <class Arguments>
  bool may_find(Arguments&& arguments) {
    evaluate(few_, arguments, found_);
    for (std::size_t i = 1; i < few_.size(); ++i) {
      for (std::size_t a = 0; a < is_base_.size(); ++a) {
        if (changes(a, at(i - 1, a), at(i, a), smooth_)) return true;
      }
    }
    return false;
  }

  /// Searches for places where a function changes faster than the samples of the step show. Returns whether there are
  /// any; the functions below use them.
  template <class Arguments>
  bool finds(Arguments&& arguments) {
    places_.clear();
    evaluate(samples_, arguments, found_);
    for (std::size_t a = 0; a < is_base_.size(); ++a) {
      for (std::size_t i = 0; i < samples_.size(); ++i) look_at(a, i, arguments);
    }
    return !places_.empty();
  }

  /// Whether holds(share) is true at nodes that are dense around all found places.
  template <class Holds>
  bool holds_at_nodes(Holds&& holds) {
    find_borders();
    double before = 0;
    for (std::size_t i = 0; i <= borders_.size(); ++i) {
      const double here = i < borders_.size() ? std::clamp(borders_[i], 0.0, 1.0) : 1;
      if (!(here > before)) continue;
      for (const double node : Gauss::c) {
        if (!holds(before + node * (here - before))) return false;
      }
      before = here;
    }
    return true;
  }

  /// Integrals of several quantities over the step, with nodes that are dense around the found places; and what nodes
  /// about twice as dense as those of the method miss of them.
  ///   sums     ∫₀¹ quantity
  ///   moments  ∫₀¹ (1 − share) quantity: for accelerations, the displacement they cause
  ///   missed   the largest |∫ (quantity − polynomial through nodes)| from the start of a part of the step to anywhere
  ///            in it, over all parts
  struct Sums {
    std::span<double> sums, moments, missed;
  };

  /// Computes these integrals. numbers(shares, found) writes the quantities, (shares, sums.size()).
  template <class Numbers>
  void sum(Numbers&& numbers, const Sums& into) {
    find_borders();
    for (const std::span<double> each : {into.sums, into.moments, into.missed}) {
      std::fill(each.begin(), each.end(), 0.0);
    }
    for (int part = 0; part < parts_; ++part) {
      const double from = static_cast<double>(part) / parts_, to = static_cast<double>(part + 1) / parts_;
      const auto first = std::upper_bound(borders_.begin(), borders_.end(), from);
      const auto last = std::lower_bound(first, borders_.end(), to);
      sum_part(from, to, {std::to_address(first), static_cast<std::size_t>(last - first)}, numbers, into);
    }
  }

 private:
  using Gauss = kernels::GaussTableau<8>;
  using Nodes = std::array<double, Gauss::stages>;

  /// Where a function changes rapidly, and the distance from there beyond which it hardly changes.
  struct RapidChange {
    double share, distance;
  };

  static constexpr int least_intervals = 8, sections = 7, most_rounds = 9;
  // Largest change of an argument from sample to sample that counts as flat; of the base of a power, relative to
  // itself.
  static constexpr double flat = 0.25;
  static constexpr double growth = 3;  // of the intervals' lengths, away from a place
  static constexpr std::size_t most_places = 64;

  static std::vector<double> spread(int intervals) {
    std::vector<double> shares;
    for (int i = 0; i <= intervals; ++i) shares.push_back(static_cast<double>(i) / intervals);
    return shares;
  }

  template <class Arguments>
  void evaluate(std::span<const double> shares, Arguments& arguments, std::vector<double>& found) {
    found.resize(shares.size() * is_base_.size());
    arguments(shares, found.data());
  }

  double at(std::size_t i, std::size_t a) const { return found_[i * is_base_.size() + a]; }

  bool changes(std::size_t a, double one, double other, double limit) const {
    const double size = is_base_[a] ? std::min(std::abs(one), std::abs(other)) : 1.0;
    return std::abs(one - other) > limit * size;
  }

  // Larger where a function is closer to its rapid change.
  double nearness(std::size_t a, double sign, double value) const {
    return is_base_[a] ? -std::abs(value) : sign * value;
  }

  template <class Arguments>
  void look_at(std::size_t a, std::size_t i, Arguments& arguments) {
    const std::size_t last = samples_.size() - 1;
    const double here = at(i, a), before = at(i - (i > 0), a), after = at(i + (i < last), a);
    if (i < last && (here < 0) != (after < 0) && changes(a, here, after, smooth_)) {
      zoom(a, 0, samples_[i], samples_[i + 1], arguments);
    }
    if (!changes(a, here, before, smooth_) && !changes(a, here, after, smooth_)) return;
    // By its curvature an argument may go further between samples than at them.
    const std::size_t middle = std::clamp(i, std::size_t{1}, last - 1);
    const double bend = std::abs(at(middle - 1, a) - 2 * at(middle, a) + at(middle + 1, a));
    const double reach = std::max(std::abs(here - before), std::abs(here - after)) + bend / 4;
    for (const double sign : {1.0, -1.0}) {
      const double near = nearness(a, sign, here);
      if (near < nearness(a, sign, before) || near < nearness(a, sign, after)) continue;
      if (!is_base_[a] && near + reach < -detail::negligible_exponent) continue;
      zoom(a, sign, samples_[i - (i > 0)], samples_[i + (i < last)], arguments);
      if (is_base_[a]) return;
    }
  }

  // Narrows an interval down to where an argument crosses zero (sign 0) or has an extremum.
  template <class Arguments>
  void zoom(std::size_t a, double sign, double from, double to, Arguments& arguments) {
    std::array<double, sections + 1> shares;
    for (int round = 1;; ++round) {
      const double distance = (to - from) / sections;
      for (int j = 0; j <= sections; ++j) shares[static_cast<std::size_t>(j)] = from + j * distance;
      evaluate(shares, arguments, near_);
      const auto value = [&](std::size_t j) { return near_[j * is_base_.size() + a]; };
      std::size_t best = 0, low, high;
      if (sign == 0) {
        while (best + 2 < shares.size() && (value(best) < 0) == (value(best + 1) < 0)) ++best;
        low = best;
        high = best + 1;
      } else {
        for (std::size_t j = 1; j < shares.size(); ++j) {
          if (nearness(a, sign, value(j)) > nearness(a, sign, value(best))) best = j;
        }
        low = best - (best > 0);
        high = best + (best + 1 < shares.size());
      }
      const bool is_flat = !changes(a, value(low), value(best), flat) && !changes(a, value(best), value(high), flat);
      if (is_flat || round == most_rounds) {
        const bool is_gone = sign != 0 && !is_base_[a] && nearness(a, sign, value(best)) < -detail::negligible_exponent;
        if (!is_gone) add({sign == 0 ? (shares[low] + shares[high]) / 2 : shares[best], distance});
        return;
      }
      from = shares[low];
      to = shares[high];
    }
  }

  void add(const RapidChange& place) {
    const auto is_known = [&](const RapidChange& known) {
      return std::abs(known.share - place.share) <= place.distance / 2 && known.distance <= 2 * place.distance;
    };
    if (places_.size() < most_places && std::none_of(places_.begin(), places_.end(), is_known)) {
      places_.push_back(place);
    }
  }

  // Interval borders around every place, spaced more widely further away from it.
  void find_borders() {
    borders_.clear();
    for (const RapidChange& place : places_) {
      borders_.push_back(place.share);
      for (double away = place.distance; away < 0.5 / parts_; away *= growth) {
        borders_.push_back(place.share - away);
        borders_.push_back(place.share + away);
      }
    }
    std::sort(borders_.begin(), borders_.end());
  }

  template <class Numbers>
  void evaluate_at_nodes(double from, double length, Numbers& numbers, std::vector<double>& found, std::size_t count) {
    Nodes shares;
    for (std::size_t j = 0; j < shares.size(); ++j) shares[j] = from + Gauss::c[j] * length;
    found.resize(shares.size() * count);
    numbers(std::span<const double>(shares), found.data());
  }

  template <class Numbers>
  void sum_part(double from, double to, std::span<const double> borders, Numbers& numbers, const Sums& into) {
    const std::size_t count = into.sums.size();
    evaluate_at_nodes(from, to - from, numbers, found_, count);
    here_.assign(count, 0.0);
    most_.assign(count, 0.0);
    double before = from;
    for (std::size_t i = 0; i <= borders.size(); ++i) {
      const double here = i < borders.size() ? borders[i] : to;
      const bool is_whole = borders.empty();
      if (!is_whole) evaluate_at_nodes(before, here - before, numbers, near_, count);
      const std::vector<double>& found = is_whole ? found_ : near_;
      const Nodes weights = sums_of_polynomials((here - from) / (to - from));
      for (std::size_t k = 0; k < count; ++k) {
        double by_nodes = 0;
        for (std::size_t j = 0; j < weights.size(); ++j) {
          const double part = Gauss::b[j] * (here - before) * found[j * count + k];
          here_[k] += part;
          into.moments[k] += part * (1 - before - Gauss::c[j] * (here - before));
          by_nodes += weights[j] * (to - from) * found_[j * count + k];
        }
        const double off = std::abs(here_[k] - by_nodes);
        if (!(off <= most_[k]) && !is_whole) most_[k] = off;
      }
      before = here;
    }
    for (std::size_t k = 0; k < count; ++k) {
      into.sums[k] += here_[k];
      into.missed[k] += most_[k];
    }
  }

  // ∫₀ˣ of each Lagrange polynomial of the Gauss nodes.
  static Nodes sums_of_polynomials(double x) {
    const auto values = detail::legendre_polynomials<Gauss::stages>(x);
    Nodes sums{};
    for (std::size_t j = 0; j < sums.size(); ++j) {
      for (std::size_t m = 0; m < sums.size(); ++m) {
        const double sum = m == 0 ? 2 * x : (values[m + 1] - values[m - 1]) / static_cast<double>(2 * m + 1);
        sums[j] += Gauss::b[j] * at_nodes[j][m] * static_cast<double>(2 * m + 1) * sum / 2;
      }
    }
    return sums;
  }

  static constexpr std::array<std::array<double, Gauss::stages + 1>, Gauss::stages> at_nodes = [] {
    std::array<std::array<double, Gauss::stages + 1>, Gauss::stages> values{};
    for (std::size_t j = 0; j < values.size(); ++j)
      values[j] = detail::legendre_polynomials<Gauss::stages>(Gauss::c[j]);
    return values;
  }();

  std::vector<bool> is_base_;
  double smooth_;
  int parts_;
  std::vector<double> few_, samples_, found_, near_, borders_, here_, most_;
  std::vector<RapidChange> places_;
};

}  // namespace pendula
