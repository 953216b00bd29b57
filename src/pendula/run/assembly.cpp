#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/assembly.hpp>
#include <pendula/system/system_model.hpp>
#include <random>

namespace pendula {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class Assembly {
 public:
  Assembly(const SystemSubject& system, Motion& start)
      : info_(system.info()),
        here_(SystemModel(system.table(), system.numbers().plain())),
        start_(start),
        values_(std::ssize(info_.constraints)),
        second_(values_.size()),
        slopes_(values_.size(), start.q.size()) {
    here_.set_time(start.time);
  }

  /// Newton's iteration with the least change of free coordinates; shorter where angles would turn far, or constraints
  /// get worse.
  std::string place(const std::vector<bool>& free) {
    constexpr int most = 100;
    went_straight_ = true;
    Eigen::VectorXd change = Eigen::VectorXd::Zero(start_.q.size());
    look(start_.q);
    double left = lacking();
    for (int correction = 0; correction < most && left > rounding; ++correction) {
      put(free, least(chosen(slopes_of_positions(), free), -values_), change);
      const double shorter = std::max(1.0, largest_turn(change) / farthest);
      change /= shorter;
      const Eigen::VectorXd before = start_.q;
      const double was = left;
      for (double part = 1; part > shortest; part /= 2) {
        look(before + part * change);
        left = lacking();
        if (!(left < was)) continue;
        start_.q = before + part * change;
        went_straight_ = went_straight_ && (part / shorter == 1 || left <= enough);
        break;
      }
      if (!(left < was)) break;  // it stays where it was
    }
    look(start_.q);
    return lacking() <= enough ? "" : left_over("", values_);
  }

  /// The nearest of the ways to close that place() finds. It goes straight to a near one. Where its corrections had to
  /// be shorter, another way may be nearer, or the only one: then it begins at other places, too, farther and farther
  /// off the guess, up to half a turn or as far as what was found.
  std::string place_nearest(const std::vector<bool>& free) {
    constexpr int tries = 256;
    const Eigen::VectorXd guess = start_.q;
    std::string left = place(free);
    if (left.empty() && went_straight_) return left;
    const Eigen::VectorXd sizes = sizes_about(guess);
    Eigen::VectorXd nearest = start_.q;
    double distance = left.empty() ? (nearest - guess).norm() : std::numeric_limits<double>::infinity();
    const auto comes_nearer = [&] {
      if (!place(free).empty()) return false;
      const double before = distance, found = (start_.q - guess).norm();
      if (!(found < before)) return false;
      nearest = start_.q;
      distance = found;
      return found < 0.99 * before;
    };
    std::mt19937 random(1);  // a scenario has one start
    for (int k = 1; k <= tries; ++k) {
      const double off = std::numbers::pi * k / tries;
      if (off > std::max(distance, (nearest - guess).cwiseQuotient(sizes).norm())) break;
      for (Eigen::Index i = 0; i < guess.size(); ++i) {
        const double share = 2 * static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 1;
        start_.q[i] = guess[i] + (free[static_cast<std::size_t>(i)] ? off * share * sizes[i] : 0);
      }
      // Where more is free than constraints need, whole curves of places close: half way back leads to a nearer one.
      while (comes_nearer()) start_.q = (guess + nearest) / 2;
    }
    start_.q = nearest;
    look(start_.q);
    return std::isfinite(distance) ? "" : left;
  }

  /// Minimises ½ vᵀ M v where (∂g/∂q) v + ∂g/∂t = 0.
  std::string move(const std::vector<bool>& free) {
    for (Eigen::Index k = 0; k < start_.v.size(); ++k) {
      if (free[static_cast<std::size_t>(k)]) start_.v[k] = 0;
    }
    return change_rates(free, start_.v);
  }

  /// Minimises ½ dᵀ M d of changes d of the free rates, of which `known` are part.
  std::string change_rates(const std::vector<bool>& free, const Eigen::VectorXd& known) {
    Matrix mass(start_.q.size(), start_.q.size());
    here_(&SystemFunctions::mass_matrix, start_.q.data(), mass.data());
    const Eigen::VectorXd rates = rates_of(start_.v);
    const Matrix slopes = chosen(slopes_, free);
    const Eigen::Index count = slopes.cols(), all = count + slopes.rows();
    Matrix equations = Matrix::Zero(all, all);
    Eigen::VectorXd right(all);
    equations.topLeftCorner(count, count) = chosen(Matrix(chosen(mass, free).transpose()), free);
    equations.topRightCorner(count, slopes.rows()) = slopes.transpose();
    equations.bottomLeftCorner(slopes.rows(), count) = slopes;
    right.head(count) = -chosen(mass, free).transpose() * known;
    right.tail(slopes.rows()) = -rates;
    Eigen::VectorXd change = Eigen::VectorXd::Zero(start_.v.size());
    put(free, least(equations, right).head(count), change);
    start_.v += change;
    const Eigen::VectorXd left = rates_of(start_.v);
    for (Eigen::Index i = 0; i < left.size(); ++i) {
      const double size = slopes_.row(i).transpose().cwiseProduct(start_.v).cwiseAbs().sum() +
                          at_rest * (size_of(i) + slopes_.row(i).cwiseAbs().sum() * start_.v.cwiseAbs().maxCoeff());
      if (!(std::abs(left[i]) <= enough * size) && left[i] != 0) return left_over("rate of ", left);
    }
    return "";
  }

  int independent(double least) {
    look(start_.q);
    Matrix scaled = slopes_;
    for (Eigen::Index i = 0; i < scaled.rows(); ++i) {
      const double size = scaled.row(i).norm();
      if (size > 0) scaled.row(i) /= size;
    }
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factors;
    factors.setThreshold(least);
    factors.compute(scaled);
    return static_cast<int>(factors.rank());
  }

 private:
  static constexpr double rounding = 1e-15, enough = 1e-11, shortest = 1e-6;
  static constexpr double farthest = 0.3;  // rad a correction
  static constexpr double at_rest = 1e-3;  // of the size of coordinates a second: rounding moves them, too

  void look(const Eigen::VectorXd& q) {
    here_(&SystemFunctions::constraints, q.data(), values_.data(), slopes_.data());
  }
  /// Constraints of rates leave places as they are.
  Matrix slopes_of_positions() const {
    Matrix slopes = slopes_;
    for (Eigen::Index i = 0; i < slopes.rows(); ++i) {
      if (info_.constraint_is_of_rates[static_cast<std::size_t>(i)]) slopes.row(i).setZero();
    }
    return slopes;
  }
  Eigen::VectorXd rates_of(const Eigen::VectorXd& v) {
    Eigen::VectorXd rates(values_.size());
    here_(&SystemFunctions::constraint_rates, start_.q.data(), v.data(), rates.data(), second_.data());
    return rates;
  }

  /// 1 for angles; for other coordinates the largest of their unit, of a guess and of where it led.
  Eigen::VectorXd sizes_about(const Eigen::VectorXd& guess) const {
    const Eigen::VectorXd largest = guess.cwiseAbs().cwiseMax(start_.q.cwiseAbs());
    Eigen::VectorXd sizes = Eigen::VectorXd::Ones(guess.size());
    for (std::size_t i = 0; i < info_.coordinates.size(); ++i) {
      double size = 0;
      for (std::size_t k = 0; k < info_.coordinates.size() && !info_.is_angle[i]; ++k) {
        if (info_.coordinate_units[k] != info_.coordinate_units[i]) continue;
        size = std::max(size, largest[static_cast<Eigen::Index>(k)]);
      }
      if (size > 0) sizes[static_cast<Eigen::Index>(i)] = size;
    }
    return sizes;
  }

  double largest_turn(const Eigen::VectorXd& change) const {
    double most = 0;
    for (Eigen::Index k = 0; k < change.size(); ++k) {
      if (info_.is_angle[static_cast<std::size_t>(k)]) most = std::max(most, std::abs(change[k]));
    }
    return most;
  }

  /// The largest value of a constraint, relative to what coordinates as large as these bring.
  double lacking() const {
    double most = 0;
    for (Eigen::Index i = 0; i < values_.size(); ++i) {
      const double size = size_of(i), left = std::abs(values_[i]);
      if (left != 0 || std::isnan(size)) most = std::max(most, size > 0 ? left / size : 1.0);
      if (std::isnan(left)) return left;
    }
    return most;
  }

  double size_of(Eigen::Index i) const {
    double size = 0;
    for (Eigen::Index k = 0; k < start_.q.size(); ++k) {
      const double angle = info_.is_angle[static_cast<std::size_t>(k)] ? 1 : 0;
      size += std::abs(slopes_(i, k)) * std::max(std::abs(start_.q[k]), angle);
    }
    return size;
  }

  static Matrix chosen(const Matrix& of, const std::vector<bool>& free) {
    Matrix columns(of.rows(), std::count(free.begin(), free.end(), true));
    Eigen::Index next = 0;
    for (Eigen::Index k = 0; k < of.cols(); ++k) {
      if (free[static_cast<std::size_t>(k)]) columns.col(next++) = of.col(k);
    }
    return columns;
  }
  static void put(const std::vector<bool>& free, const Eigen::VectorXd& numbers, Eigen::VectorXd& to) {
    Eigen::Index next = 0;
    for (Eigen::Index k = 0; k < to.size(); ++k) {
      if (free[static_cast<std::size_t>(k)]) to[k] = numbers[next++];
    }
  }
  static Eigen::VectorXd least(const Matrix& equations, const Eigen::VectorXd& right) {
    if (equations.cols() == 0) return {};
    return Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>(equations).solve(right);
  }

  std::string left_over(const std::string& what, const Eigen::VectorXd& left) const {
    std::string text;
    for (Eigen::Index i = 0; i < left.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      const bool is_of_rates = info_.constraint_is_of_rates[k];
      if (is_of_rates && what.empty()) continue;  // places do not matter to it
      text += (text.empty() ? "" : ", ") + rounded(left[i], 3) + " " + std::string(info_.constraint_units[k]) +
              (what.empty() || is_of_rates ? "" : "/s") + " in the " + (is_of_rates ? "" : what) +
              std::string(info_.constraints[k]);
    }
    return text;
  }

  const SystemInfo& info_;
  SystemAt<1> here_;
  Motion& start_;
  Eigen::VectorXd values_, second_;
  Matrix slopes_;
  bool went_straight_ = true;  ///< whether no correction of place() was shorter than Newton's
};

}  // namespace

void SystemSubject::close(Motion& state) const {
  bring_back(*this, std::vector<bool>(info().coordinates.size(), true), state);
}

std::string bring_back(const SystemSubject& system, const std::vector<bool>& free, Motion& motion) {
  if (system.info().constraints.empty()) return {};
  Assembly assembly(system, motion);
  std::string left = assembly.place(free);
  if (!left.empty()) return left;
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(motion.v.size());
  return assembly.change_rates(std::vector<bool>(free.size(), true), none);
}

int independent_constraints(const SystemSubject& system, Motion state, double least) {
  return system.info().constraints.empty() ? 0 : Assembly(system, state).independent(least);
}

std::string assemble(const SystemSubject& system, const FreeNumbers& free, Motion& start) {
  if (system.info().constraints.empty()) return {};
  Assembly assembly(system, start);
  std::string left = assembly.place_nearest(free.coordinates);
  return left.empty() ? assembly.move(free.rates) : left;
}

}  // namespace pendula
