// Where the bobs of a linkage are at given times, by equations and variables that pendula does not use: Cartesian
// coordinates in 80-bit numbers, accelerations from the constraints differentiated twice, by extrapolation of the
// midpoint rule (odeint) or of the linearly implicit Euler rule. Every step ends on the constraints again.
//
// usage: linkage_reference METHOD TOLERANCE LIMIT DISTURBANCE states < numbers > numbers
//
// LIMIT bounds the evaluations of the equations (exit status 3 beyond), DISTURBANCE moves the start. Numbers in, as
// linkages.py writes them: axes, bobs, gravity, damping; per bob its mass, place and velocity; number of hooks; per
// hook its place and amplitude, then frequency and phase; number of bars; per bar two ends (hooks count after bobs) and
// the squared length; number of lines; per line a bob, a direction across it, and their product; number of times,
// times. Rows of long doubles out, one a time: places, velocities, time.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <journey.hpp>

namespace reference {
namespace {

using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using Column = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

struct Hook {
  Column at, amplitude;
  Real frequency = 0, phase = 0;

  /// The place, or its derivative of an order, at a time.
  Column derivative(Real time, int order) const {
    const Real turned = frequency * time + phase;
    if (order == 0) return at + amplitude * std::sin(turned);
    if (order == 1) return amplitude * (frequency * std::cos(turned));
    return amplitude * (-frequency * frequency * std::sin(turned));
  }
};

struct Bar {
  std::size_t one, other;
  Real squared;
};

struct Line {
  std::size_t bob;
  Column across;
  Real off;
};

struct Linkage {
  Eigen::Index axes = 0;
  std::size_t bobs = 0;
  Real gravity = 0, damping = 0;
  std::vector<Real> masses, times;
  std::vector<Hook> hooks;
  std::vector<Bar> bars;
  std::vector<Line> lines;
  State start;

  Eigen::Index coordinates() const { return axes * static_cast<Eigen::Index>(bobs); }
  Eigen::Index constraints() const { return static_cast<Eigen::Index>(bars.size() + lines.size()); }
};

Column next_column(Eigen::Index size) {
  Column column(size);
  for (Real& one : column) one = next();
  return column;
}

Linkage read_linkage() {
  Linkage linkage;
  linkage.axes = static_cast<Eigen::Index>(count());
  linkage.bobs = count();
  linkage.gravity = next();
  linkage.damping = next();
  const Eigen::Index n = linkage.coordinates();
  linkage.start.resize(static_cast<std::size_t>(2 * n) + 1);
  for (Eigen::Index bob = 0; bob < static_cast<Eigen::Index>(linkage.bobs); ++bob) {
    linkage.masses.push_back(next());
    for (const Eigen::Index part : {Eigen::Index{0}, n}) {
      for (Eigen::Index axis = 0; axis < linkage.axes; ++axis) {
        linkage.start[static_cast<std::size_t>(part + bob * linkage.axes + axis)] = next();
      }
    }
  }
  for (std::size_t left = count(); left-- > 0;) {
    Hook hook{next_column(linkage.axes), next_column(linkage.axes)};
    hook.frequency = next();
    hook.phase = next();
    linkage.hooks.push_back(hook);
  }
  for (std::size_t left = count(); left-- > 0;) {
    const std::size_t one = count(), other = count();
    linkage.bars.push_back({one, other, next()});
  }
  for (std::size_t left = count(); left-- > 0;) {
    const std::size_t bob = count();
    const Column across = next_column(linkage.axes);
    linkage.lines.push_back({bob, across, next()});
  }
  for (std::size_t left = count(); left-- > 0;) linkage.times.push_back(next());
  return linkage;
}

/// Moves a linkage, as Journey asks for it.
class Motion {
 public:
  explicit Motion(Linkage linkage) : linkage_(std::move(linkage)), inverse_(linkage_.coordinates()) {
    for (std::size_t bob = 0; bob < linkage_.bobs; ++bob) {
      inverse_.segment(static_cast<Eigen::Index>(bob) * linkage_.axes, linkage_.axes)
          .setConstant(1 / linkage_.masses[bob]);
    }
  }

  Real longest(const State&) const { return 0.2L; }
  void pass(const State&, const State&) {}
  std::vector<Real> row(const State& now, const State&) const { return now; }
  void print(const State&) const {}

  void equations(const State& y, State& dy) const {
    const Eigen::Index n = linkage_.coordinates();
    const Column q = part(y, 0), v = part(y, 1);
    Column free = -linkage_.damping * v.cwiseProduct(inverse_);
    for (Eigen::Index k = linkage_.axes - 1; k < n; k += linkage_.axes) free[k] -= linkage_.gravity;
    const Real time = y.back();
    const Matrix G = slopes(q, time);
    Column bend = G * free;
    for (std::size_t k = 0; k < linkage_.bars.size(); ++k) {
      const Bar& bar = linkage_.bars[k];
      const Column apart = end(bar.one, q, time, 0) - end(bar.other, q, time, 0);
      const Column parting = end(bar.one, v, time, 1) - end(bar.other, v, time, 1);
      Column hauled = Column::Zero(linkage_.axes);
      for (const auto& [which, sign] : {std::pair(bar.one, Real(1)), {bar.other, Real(-1)}}) {
        if (which >= linkage_.bobs) hauled += sign * linkage_.hooks[which - linkage_.bobs].derivative(time, 2);
      }
      bend[static_cast<Eigen::Index>(k)] += 2 * (parting.squaredNorm() + apart.dot(hauled));
    }
    const Column a = free - push(G, bend);
    dy.resize(y.size());
    std::copy(v.begin(), v.end(), dy.begin());
    std::copy(a.begin(), a.end(), dy.begin() + n);
    dy.back() = 1;
  }

  /// The nearest state that is on the constraints.
  void project(State& y) const {
    const Real time = y.back();
    Column q = part(y, 0), v = part(y, 1);
    for (int round = 0; round < 20; ++round) {
      const Column step = push(slopes(q, time), defects(q, time));
      q -= step;
      if (step.cwiseAbs().maxCoeff() < 1e-18L) break;
    }
    const Matrix G = slopes(q, time);
    Column off = G * v;
    for (std::size_t k = 0; k < linkage_.bars.size(); ++k) {
      const Bar& bar = linkage_.bars[k];
      const Column apart = end(bar.one, q, time, 0) - end(bar.other, q, time, 0);
      const Column parting = end(bar.one, v, time, 1) - end(bar.other, v, time, 1);
      off[static_cast<Eigen::Index>(k)] = 2 * apart.dot(parting);
    }
    v -= push(G, off);
    std::copy(q.begin(), q.end(), y.begin());
    std::copy(v.begin(), v.end(), y.begin() + linkage_.coordinates());
  }

 private:
  Column part(const State& y, Eigen::Index which) const {
    return Eigen::Map<const Column>(y.data() + which * linkage_.coordinates(), linkage_.coordinates());
  }

  /// Of an end of a bar, from the places or velocities of all bobs.
  Column end(std::size_t which, const Column& of_bobs, Real time, int order) const {
    if (which >= linkage_.bobs) return linkage_.hooks[which - linkage_.bobs].derivative(time, order);
    return of_bobs.segment(static_cast<Eigen::Index>(which) * linkage_.axes, linkage_.axes);
  }

  Column defects(const Column& q, Real time) const {
    Column found(linkage_.constraints());
    Eigen::Index row = 0;
    for (const Bar& bar : linkage_.bars) {
      found[row++] = (end(bar.one, q, time, 0) - end(bar.other, q, time, 0)).squaredNorm() - bar.squared;
    }
    for (const Line& line : linkage_.lines) found[row++] = line.across.dot(end(line.bob, q, time, 0)) - line.off;
    return found;
  }

  Matrix slopes(const Column& q, Real time) const {
    Matrix found = Matrix::Zero(linkage_.constraints(), linkage_.coordinates());
    Eigen::Index row = 0;
    const auto add = [&](std::size_t bob, const Column& slope) {
      if (bob < linkage_.bobs) {
        found.row(row).segment(static_cast<Eigen::Index>(bob) * linkage_.axes, linkage_.axes) += slope.transpose();
      }
    };
    for (const Bar& bar : linkage_.bars) {
      const Column apart = end(bar.one, q, time, 0) - end(bar.other, q, time, 0);
      add(bar.one, 2 * apart);
      add(bar.other, -2 * apart);
      ++row;
    }
    for (const Line& line : linkage_.lines) {
      add(line.bob, line.across);
      ++row;
    }
    return found;
  }

  /// M⁻¹ Gᵀ λ with G M⁻¹ Gᵀ λ = wanted, of a G whose rows may depend on one another: Cholesky's factors, the largest
  /// pivots first, as far as there are any.
  Column push(const Matrix& G, const Column& wanted) const {
    const Matrix weighted = G * inverse_.asDiagonal();
    Matrix K = weighted * G.transpose();
    const Eigen::Index m = K.rows();
    const Real least = K.diagonal().maxCoeff() * 1e-14L;
    std::vector<Eigen::Index> order(static_cast<std::size_t>(m));
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<Eigen::Index>(k);
    Column right = wanted;
    Eigen::Index rank = 0;
    for (; rank < m; ++rank) {
      Eigen::Index best = 0;
      const Real pivot = K.diagonal().tail(m - rank).maxCoeff(&best);
      if (!(pivot > least)) break;
      best += rank;
      K.row(rank).swap(K.row(best));
      K.col(rank).swap(K.col(best));
      std::swap(right[rank], right[best]);
      std::swap(order[static_cast<std::size_t>(rank)], order[static_cast<std::size_t>(best)]);
      const Eigen::Index left = m - rank - 1;
      const Column factors = K.col(rank).tail(left) / pivot;
      right.tail(left) -= factors * right[rank];
      K.bottomRightCorner(left, left) -= factors * K.row(rank).tail(left);
    }
    Column lambda = Column::Zero(m);
    for (Eigen::Index k = rank; k-- > 0;) {
      Real sum = right[k];
      for (Eigen::Index j = k + 1; j < rank; ++j) sum -= K(k, j) * lambda[order[static_cast<std::size_t>(j)]];
      lambda[order[static_cast<std::size_t>(k)]] = sum / K(k, k);
    }
    return weighted.transpose() * lambda;
  }

  Linkage linkage_;
  Column inverse_;  // of the mass of each coordinate
};

int answer(Linkage linkage, const std::string& method, Real tolerance, Real limit, Real disturbance) {
  State start = linkage.start;
  start.back() = 0;
  for (std::size_t k = 0; k + 1 < start.size(); ++k) {
    start[k] += disturbance * std::cos(Real(1.7) * Real(k) + Real(0.3));
  }
  const std::vector<Real> times = linkage.times;
  const Motion motion(std::move(linkage));
  motion.project(start);
  Journey<Motion> journey(motion, start, times, limit);
  const auto equations = [&](const State& y, State& dy) { motion.equations(y, dy); };
  const auto differentiate = [&](const State& y, auto& jacobian) { by_differences(equations, y, jacobian); };
  return travel(journey, method, tolerance, Telling::states, equations, differentiate);
}

}  // namespace
}  // namespace reference

int main(int count, char** words) {
  if (count != 6) {
    std::cerr << "usage: linkage_reference METHOD TOLERANCE LIMIT DISTURBANCE states < numbers > numbers\n";
    return 2;
  }
  const auto number = [&](int k) { return std::strtold(words[k], nullptr); };
  return reference::answer(reference::read_linkage(), words[1], number(2), number(3), number(4));
}
