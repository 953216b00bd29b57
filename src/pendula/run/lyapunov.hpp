#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/schedule.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace pendula {

/// What is told of a spectrum on the way.
struct LyapunovProgress {
  double time = 0;            ///< s, since the start
  Eigen::VectorXd exponents;  ///< as they are so far, of all the time  [1/s]
};

struct LyapunovSpectrum {
  Eigen::VectorXd exponents;  ///< the leading ones, descending; of the time after the settling  [1/s]
  Eigen::VectorXd errors;     ///< of each  [1/s]; infinite where the run was too short to tell
  double sum = 0;             ///< of them; of a whole spectrum the mean divergence  [1/s]
  double duration = 0;        ///< s, that was run
  double ftle = 0;            ///< finite-time exponent of one tangent over all of that  [1/s]
  double megno = 0;           ///< mean exponential growth of nearby orbits: 2 where motion is regular, λ t/2 in chaos
  RunResult result;           ///< how the run ended
};

/// How one tangent that is never turned grows along a motion: what its FTLE and MEGNO (Cincotta, Simó 2000) are.
class TangentGrowth {
 public:
  /// By `growth`, a logarithm, in a step from `before` to `time` since the start.
  void follow(double growth, double before, double time) {
    // Of Y = 2/t ∫ s d ln|w|, where w grows by the same rate all through the step.
    const double rate = growth / (time - before);
    const double offset = weighted_ - rate * before * before / 2;
    integral_ += (before > 0 ? 2 * offset * std::log(time / before) : 0) + rate * (time * time - before * before) / 2;
    grown_ += growth;
    weighted_ += (before + time) / 2 * growth;
  }

  double grown() const { return grown_; }
  double megno(double time) const { return time > 0 ? integral_ / time : 0; }

 private:
  double grown_ = 0, weighted_ = 0, integral_ = 0;
};

/// What tangents have grown by until now and then, and the exponents that come of it.
class GrowthHistory {
 public:
  /// Of `count` tangents, from the time 0 on.
  explicit GrowthHistory(Eigen::Index count) : sums_(Eigen::VectorXd::Zero(count)) { entries_.push_back({0, sums_}); }

  /// Logarithms, since the last entry.
  void add(double time, const Eigen::VectorXd& grown) {
    sums_ += grown;
    entries_.push_back({time, sums_});
  }

  double last_time() const { return entries_.back().time; }
  std::size_t size() const { return entries_.size(); }
  /// Of the first entry after the start; 0 where there is none.
  double first_time() const { return entries_.size() < 2 ? 0 : entries_[1].time; }
  const Eigen::VectorXd& sums() const { return sums_; }

  /// Exponents and their errors, of the time from `from` on.
  ///
  /// Errors from means over blocks, of whichever number of blocks scatters most: blocks that are too short are alike by
  /// what they remember. Regular motions drift apart linearly, tangents of any motion swing by a factor: what a run of
  /// the time t cannot tell from zero is some 3/t.
  void average(double from, LyapunovSpectrum& spectrum) const {
    const double end = last_time(), span = end - from;
    spectrum.exponents = sums_;
    spectrum.errors = Eigen::VectorXd::Constant(sums_.size(), std::numeric_limits<double>::infinity());
    if (!(span > 0)) return;
    spectrum.exponents = (sums_at(end) - sums_at(from)) / span;
    Eigen::VectorXd worst = Eigen::VectorXd::Zero(sums_.size());
    for (const int blocks : {8, 16, 32}) {
      Eigen::VectorXd squares = Eigen::VectorXd::Zero(sums_.size());
      for (int k = 0; k < blocks; ++k) {
        Eigen::VectorXd gained = sums_at(from + span * (k + 1) / blocks);
        gained -= sums_at(from + span * k / blocks);
        for (Eigen::Index i = 0; i < gained.size(); ++i) {
          const double off = gained[i] * (blocks / span) - spectrum.exponents[i];
          squares[i] += off * off;
        }
      }
      for (Eigen::Index i = 0; i < worst.size(); ++i) {
        worst[i] = std::max(worst[i], squares[i] / (blocks * (blocks - 1)));
      }
    }
    for (Eigen::Index i = 0; i < worst.size(); ++i) spectrum.errors[i] = std::sqrt(worst[i] + 9 / (span * span));
  }

  /// Of the time, until tangents have found their directions.
  static constexpr double settling = 0.1;

 private:
  struct Entry {
    double time;
    Eigen::VectorXd logarithms;
  };

  Eigen::VectorXd sums_at(double time) const {
    const auto after = std::ranges::lower_bound(entries_, time, {}, &Entry::time);
    if (after == entries_.begin()) return after->logarithms;
    if (after == entries_.end()) return entries_.back().logarithms;
    const Entry& before = *(after - 1);
    const double part = (time - before.time) / (after->time - before.time);
    return before.logarithms + part * (after->logarithms - before.logarithms);
  }

  Eigen::VectorXd sums_;
  std::vector<Entry> entries_;
};

/// What tangents are measured by, of a motion's start and all along: Σ (m ω² δq² + δp²/m)/ω, an energy, so that neither
/// units nor the sizes of masses matter, and pairs of exponents stay pairs.
struct TangentScale {
  Eigen::VectorXd rows;  ///< that each is multiplied with
  double rate = 1;       ///< that the motion changes by where it starts, or what is beside it  [1/s]
};

/// From the derivative of a step that is next to nothing, which `integrator` then has taken; none where it cannot.
/// `rows` as Integrator::linearize tells.
inline std::optional<TangentScale> tangent_scale(Integrator& integrator, const Motion& start, int rows,
                                                 double duration) {
  const double h = std::max(1e-10 * duration, 1e-12 * std::abs(start.time));
  TangentScale scale{Eigen::VectorXd::Ones(rows), 1};
  integrator.start(start);
  if (!(h > 0) || !integrator.step(h)) return {};
  const Eigen::Index half = rows / 2;
  // Of a momentum's unit, what coordinates are moved by: the inverse mass; then the pushes of coordinates, which
  // compare by that. In space there are three a link, of which the one along it moves nothing.
  const Eigen::Index group = rows == 2 * start.q.size() ? 1 : 3;
  Eigen::VectorXd mobility(half), kept(half);
  const auto pushed_columns = [&](Eigen::Index begin, Eigen::Index end, auto take) {
    constexpr Eigen::Index at_once = 64;
    for (Eigen::Index first = begin; first < end; first += at_once) {
      Directions<> units = Directions<>::Zero(rows, std::min(at_once, end - first));
      for (Eigen::Index k = 0; k < units.cols(); ++k) units(first + k, k) = 1;
      integrator.push(units);
      for (Eigen::Index k = 0; k < units.cols(); ++k) take(first - begin + k, units.col(k));
    }
  };
  pushed_columns(half, rows, [&](Eigen::Index of, const auto& column) {
    mobility[of] = std::abs(column[of]) / h;
    kept[of] = column[half + of];
  });
  double loss = 0;  // of momenta, by damping; how many directions of a group there are, their sum tells
  for (Eigen::Index first = 0; first < half; first += group) {
    mobility.segment(first, group).setConstant(mobility.segment(first, group).maxCoeff());
    const double sum = kept.segment(first, group).sum(), whole = std::max(1.0, std::round(sum));
    loss = std::max(loss, std::abs(whole - sum) / (whole * h));
  }
  const Eigen::VectorXd lightness = mobility.cwiseSqrt();
  double swing = 0;  // squared, of one coordinate by another's push
  pushed_columns(0, half, [&](Eigen::Index of, const auto& column) {
    const double push = column.tail(half).cwiseAbs().cwiseProduct(lightness).maxCoeff();
    swing = std::max(swing, push * lightness[of] / h);
  });
  // Beside a radian; lengths that are larger beside themselves.
  const Eigen::ArrayXd sizes = start.q.array().abs().max(1);
  const Motion moved = integrator.state();
  const double turning = (start.v.array().abs() / sizes).maxCoeff();
  const double pushed = ((moved.v - start.v).array().abs() / sizes).maxCoeff() / h;
  const double squared = std::max({swing, pushed, turning * turning, loss * loss});
  if (std::isfinite(squared) && squared > 0) scale.rate = std::sqrt(squared);
  if (mobility.allFinite() && (mobility.array() > 0).all()) {
    scale.rows << (scale.rate / mobility.array()).sqrt(), (mobility.array() / scale.rate).sqrt();
  }
  return scale;
}

/// The leading Lyapunov exponents of a motion: tangents are pushed by the exact derivatives of its steps, and made
/// orthonormal again by QR before they fall into the leading directions (Benettin, Galgani, Giorgilli, Strelcyn 1980).
/// Steps may have any sizes. The first tangent is never turned, so that FTLE and MEGNO are read off it on the way.
///
/// It is a value: a copy, and the integrator's member of the same instant, are all that goes on from there.
class LyapunovTangents {
 public:
  /// `rows` as Integrator::linearize tells; the tangents are random, by `seed`.
  LyapunovTangents(int rows, int count, unsigned seed = 1) : tangents_(rows, count), history_(count) {
    std::mt19937 random(seed);
    for (Eigen::Index i = 0; i < tangents_.size(); ++i) {
      tangents_.data()[i] = static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 0.5;
    }
  }

  /// Tangents of the motion's start, measured by `scale`, which `integrator` has just made a step for. Without it they
  /// are whatever the first step makes of them, and what that adds to them is not known.
  void begin(Integrator& integrator, const TangentScale& scale) {
    scale_ = scale.rows;
    push(integrator);
    Eigen::VectorXd grown(tangents_.cols());
    library().make_orthonormal(tangents_.data(), tangents_.rows(), tangents_.cols(), grown.data());
    has_begun_ = true;
  }

  /// After a step of `integrator` to `time` since the start. Tells whether there is a new entry of the history.
  bool follow(Integrator& integrator, double time) {
    push(integrator);
    const double grown = std::log(tangents_.col(0).norm());
    if (has_begun_ || time_ > 0) first_.follow(grown - grown_, time_, time);
    grown_ = grown;
    time_ = time;
    if (time - history_.last_time() < interval_ && std::abs(grown_) < std::log(parted) / 2) return false;
    make_orthonormal();
    return counted() > 0;
  }

  /// Makes the last entry of the history.
  void finish() {
    if (time_ > history_.last_time()) make_orthonormal();
  }

  LyapunovProgress progress() const { return {time_, (history_.sums() / std::max(counted(), smallest)).eval()}; }

  /// The spectrum, when all is done.
  LyapunovSpectrum spectrum() const {
    LyapunovSpectrum spectrum;
    spectrum.duration = time_;
    spectrum.ftle = first_.grown() / std::max(counted(), smallest);
    spectrum.megno = first_.megno(time_);
    history_.average(std::max(GrowthHistory::settling * time_, has_begun_ ? 0 : history_.first_time()), spectrum);
    sort(spectrum);
    spectrum.sum = spectrum.exponents.sum();
    return spectrum;
  }

 private:
  static constexpr double smallest = std::numeric_limits<double>::min();
  // How much more the fastest tangent may have grown than the slowest: what QR tells has as many digits less.
  static constexpr double parted = 1e3;

  // Of tangents that have not begun only directions are kept of the first step, which takes them into the tangent
  // space.
  double counted() const {
    if (has_begun_) return time_;
    return history_.size() < 2 ? 0 : time_ - history_.first_time();
  }

  void push(Integrator& integrator) {
    if (scale_.size() > 0) tangents_.array().colwise() /= scale_.array();
    integrator.push(tangents_);
    if (scale_.size() > 0) tangents_.array().colwise() *= scale_.array();
  }

  void make_orthonormal() {
    const double span = time_ - history_.last_time();
    Eigen::VectorXd grown(tangents_.cols());
    library().make_orthonormal(tangents_.data(), tangents_.rows(), tangents_.cols(), grown.data());
    grown = grown.array().max(smallest).log().matrix().eval();
    if (has_begun_ || history_.size() > 1) {
      const double parting = std::max(grown.maxCoeff() - grown.minCoeff(), grown.cwiseAbs().maxCoeff());
      interval_ = span * std::clamp(std::log(parted) / std::max(parting, smallest), 0.25, 2.0);
    } else {
      grown.setZero();
    }
    history_.add(time_, grown);
    grown_ = 0;
  }

  static void sort(LyapunovSpectrum& spectrum) {
    std::vector<Eigen::Index> order(static_cast<std::size_t>(spectrum.exponents.size()));
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<Eigen::Index>(k);
    std::ranges::sort(order, std::greater<>(), [&](Eigen::Index k) { return std::pair(spectrum.exponents[k], -k); });
    spectrum.exponents = spectrum.exponents(order).eval();
    spectrum.errors = spectrum.errors(order).eval();
  }

  Directions<> tangents_;
  Eigen::VectorXd scale_;  // TangentScale::rows; none where they are measured as they are
  bool has_begun_ = false;
  GrowthHistory history_;
  TangentGrowth first_;
  double time_ = 0, interval_ = 0;
  double grown_ = 0;  // logarithm of the first tangent's length
};

/// Runs `integrator` from `start` over `duration` in steps of at most `step`, which may be infinite where it chooses
/// them, and finds the `count` leading exponents
/// of the motion, 0 for all. Calls on_way(const LyapunovProgress&) where tangents were made orthonormal; bool stop() is
/// asked after every step. Throws std::invalid_argument where there are not so many exponents, and for methods whose
/// steps have no derivative.
template <class OnWay, class Stop>
LyapunovSpectrum find_lyapunov_spectrum(Integrator& integrator, const Motion& start, double step, double duration,
                                        int count, OnWay on_way, const Stop& stop) {
  const int all = 2 * static_cast<int>(start.q.size());
  if (count < 0 || count > all) {
    throw std::invalid_argument("count: expected 1 to " + std::to_string(all) + " exponents, got " +
                                std::to_string(count));
  }
  const int rows = integrator.linearize();
  LyapunovTangents tangents(rows, count == 0 ? all : count);
  const std::optional<TangentScale> scale = tangent_scale(integrator, start, rows, duration);
  if (scale) tangents.begin(integrator, *scale);
  Schedule schedule;
  // Steps that follow the motion are as long as they like where that has come to rest; tangents have not.
  if (scale && std::isinf(step)) step = std::min(2.0, integrator.resolved_decay(1e-6)) / scale->rate;
  schedule.step = step;
  schedule.duration = duration;
  schedule.every = std::numeric_limits<std::int64_t>::max();
  double before = start.time;
  const auto follow = [&] {
    if (integrator.time() != before && tangents.follow(integrator, integrator.time() - start.time)) {
      on_way(tangents.progress());
    }
    before = integrator.time();
    return stop();
  };
  const RunResult result = simulate(
      integrator, start, schedule, [](const Motion&) {}, follow);
  tangents.finish();
  LyapunovSpectrum spectrum = tangents.spectrum();
  spectrum.result = result;
  return spectrum;
}

}  // namespace pendula
