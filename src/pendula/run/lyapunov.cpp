#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <pendula/run/library.hpp>
#include <pendula/run/lyapunov.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

void TangentGrowth::follow(double growth, double before, double time) {
  // Integrates Y = 2/t ∫ s d ln|w|, with a constant growth rate of w within the step.
  const double rate = growth / (time - before);
  const double offset = weighted_ - rate * before * before / 2;
  integral_ += (before > 0 ? 2 * offset * std::log(time / before) : 0) + rate * (time * time - before * before) / 2;
  grown_ += growth;
  weighted_ += (before + time) / 2 * growth;
}

void GrowthHistory::add(double time, const Eigen::VectorXd& grown) {
  sums_ += grown;
  entries_.push_back({time, sums_});
}

void GrowthHistory::average(double from, LyapunovSpectrum& spectrum) const {
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

Eigen::VectorXd GrowthHistory::sums_at(double time) const {
  const auto after = std::ranges::lower_bound(entries_, time, {}, &Entry::time);
  if (after == entries_.begin()) return after->logarithms;
  if (after == entries_.end()) return entries_.back().logarithms;
  const Entry& before = *(after - 1);
  const double part = (time - before.time) / (after->time - before.time);
  return before.logarithms + part * (after->logarithms - before.logarithms);
}

namespace {

constexpr double smallest = std::numeric_limits<double>::min();
// How much more the fastest tangent may grow than the slowest before they are made orthonormal; QR loses as many
// digits.
constexpr double parted = 1e3;

/// Scales of tangents, fixed at the start of a motion: the squared norm is an energy over a rate, Σ (m ω² δq² +
/// δp²/m)/ω. So neither units nor the sizes of masses matter, and exponents come in pairs.
struct TangentScale {
  Eigen::VectorXd rows;  ///< factors of the rows
  double rate = 1;       ///< initial rate of change of the motion  [1/s]
};

/// Finds the scales from the derivative of a tiny step, which `integrator` has taken afterwards; nothing if it fails.
/// `rows` as from Integrator::linearize.
std::optional<TangentScale> tangent_scale(Integrator& integrator, const Motion& start, int rows, double duration) {
  double h = std::max(1e-10 * duration, 1e-12 * std::abs(start.time));
  TangentScale scale{Eigen::VectorXd::Ones(rows), 1};
  // Relative to a radian, or to larger lengths.
  const Eigen::ArrayXd sizes = start.q.array().abs().max(1);
  const double turning = (start.v.array().abs() / sizes).maxCoeff();
  double pushed = 0;
  const auto goes = [&] {
    integrator.start(start);
    if (!(h > 0) || !integrator.step(h)) return false;
    pushed = ((integrator.state().v - start.v).array().abs() / sizes).maxCoeff() / h;
    return true;
  };
  if (!goes()) return {};
  if (integrator.conditions() > 0) {  // their impulses are rounding in a tiny step
    constexpr double part = 1e-4;
    const double rate = std::sqrt(std::max(turning * turning, pushed));
    h = rate * duration > part ? part / rate : duration;
    if (!goes()) return {};
  }
  const Eigen::Index half = rows / 2;
  // Momenta that move a coordinate: their inverse mass. In space a link has three components, one of which, along the
  // link, moves nothing; they share the largest.
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
  double loss = 0;  // decay rate of momenta by damping; the sum over a group, or over all that constraints mix, tells
                    // its number of directions
  for (Eigen::Index first = 0; first < half; first += group) {
    mobility.segment(first, group).setConstant(mobility.segment(first, group).maxCoeff());
  }
  const Eigen::Index together = integrator.conditions() > 0 ? half : group;
  for (Eigen::Index first = 0; first < half; first += together) {
    const double sum = kept.segment(first, together).sum(), whole = std::max(1.0, std::round(sum));
    loss = std::max(loss, std::abs(whole - sum) / (whole * h));
  }
  const Eigen::VectorXd lightness = mobility.cwiseSqrt();
  double swing = 0;  // squared, of one coordinate by a displacement of another
  pushed_columns(0, half, [&](Eigen::Index of, const auto& column) {
    const double push = column.tail(half).cwiseAbs().cwiseProduct(lightness).maxCoeff();
    swing = std::max(swing, push * lightness[of] / h);
  });
  const double squared = std::max({swing, pushed, turning * turning, loss * loss});
  if (std::isfinite(squared) && squared > 0) scale.rate = std::sqrt(squared);
  if (mobility.allFinite() && (mobility.array() > 0).all()) {
    scale.rows << (scale.rate / mobility.array()).sqrt(), (mobility.array() / scale.rate).sqrt();
  }
  return scale;
}

void sort(LyapunovSpectrum& spectrum) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(spectrum.exponents.size()));
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<Eigen::Index>(k);
  std::ranges::sort(order, std::greater<>(), [&](Eigen::Index k) { return std::pair(spectrum.exponents[k], -k); });
  spectrum.exponents = spectrum.exponents(order).eval();
  spectrum.errors = spectrum.errors(order).eval();
}

}  // namespace

LyapunovTangents::LyapunovTangents(int rows, int count, unsigned seed) : tangents_(rows, count), history_(count) {
  std::mt19937 random(seed);
  for (Eigen::Index i = 0; i < tangents_.size(); ++i) {
    tangents_.data()[i] = static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 0.5;
  }
}

void LyapunovTangents::begin(Integrator& integrator, const Eigen::VectorXd& scale) {
  scale_ = scale;
  push(integrator);
  Eigen::VectorXd grown(tangents_.cols());
  library<Orthonormalizer>().make_orthonormal(tangents_.data(), tangents_.rows(), tangents_.cols(), grown.data());
  has_begun_ = true;
}

bool LyapunovTangents::follow(Integrator& integrator, double time) {
  push(integrator);
  const double grown = std::log(tangents_.col(0).norm());
  if (has_begun_ || time_ > 0) first_.follow(grown - grown_, time_, time);
  grown_ = grown;
  time_ = time;
  if (time - history_.last_time() < interval_ && std::abs(grown_) < std::log(parted) / 2) return false;
  make_orthonormal();
  return counted() > 0;
}

bool LyapunovTangents::finish() {
  if (!(time_ > history_.last_time())) return false;
  make_orthonormal();
  return counted() > 0;
}

LyapunovProgress LyapunovTangents::progress() const {
  return {time_, (history_.sums() / std::max(counted(), smallest)).eval()};
}

LyapunovSpectrum LyapunovTangents::spectrum() const {
  LyapunovSpectrum spectrum;
  spectrum.duration = time_;
  spectrum.ftle = first_.grown() / std::max(counted(), smallest);
  spectrum.megno = first_.megno(time_);
  spectrum.since = std::max(GrowthHistory::settling * time_, has_begun_ ? 0 : history_.first_time());
  history_.average(spectrum.since, spectrum);
  sort(spectrum);
  spectrum.sum = spectrum.exponents.sum();
  return spectrum;
}

// Until tangents have begun, the first step only takes them into the tangent space: their growth in it does not count.
double LyapunovTangents::counted() const {
  if (has_begun_) return time_;
  return history_.size() < 2 ? 0 : time_ - history_.first_time();
}

void LyapunovTangents::push(Integrator& integrator) {
  if (scale_.size() > 0) tangents_.array().colwise() /= scale_.array();
  integrator.push(tangents_);
  if (scale_.size() > 0) tangents_.array().colwise() *= scale_.array();
}

void LyapunovTangents::make_orthonormal() {
  const double span = time_ - history_.last_time();
  Eigen::VectorXd grown(tangents_.cols());
  library<Orthonormalizer>().make_orthonormal(tangents_.data(), tangents_.rows(), tangents_.cols(), grown.data());
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

LyapunovRun find_lyapunov_spectrum(Integrator& integrator, const Motion& start, double step, double duration, int count,
                                   const std::function<void(const LyapunovProgress&)>& on_way,
                                   const std::function<bool()>& stop) {
  integrator.start(start);
  const int all = 2 * static_cast<int>(start.q.size()) - integrator.conditions();
  if (count < 0 || count > all) {
    throw std::invalid_argument("count: expected 1 to " + std::to_string(all) + " exponents, got " +
                                std::to_string(count));
  }
  const int rows = integrator.linearize();
  LyapunovTangents tangents(rows, count == 0 ? all : count);
  const std::optional<TangentScale> scale = tangent_scale(integrator, start, rows, duration);
  if (scale) tangents.begin(integrator, scale->rows);
  Schedule schedule;
  // At rest, steps that follow the motion become arbitrarily long; tangents still need to be resolved.
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
  if (tangents.finish()) on_way(tangents.progress());
  return {tangents.spectrum(), result};
}

}  // namespace pendula
