#include <pendula/run/tangent_growth.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

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

}  // namespace pendula
