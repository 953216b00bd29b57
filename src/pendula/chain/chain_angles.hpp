#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/heading.hpp>
#include <pendula/numeric/long_real.hpp>
#include <vector>

namespace pendula {

/// The angles of a chain's links along a run that moves rods. Full turns, and the side on which a link passes a pole,
/// follow from the motion only.
template <class Space>
class ChainAngles {
  using Anchor = AngleAnchor<Space>;
  static constexpr auto dof = static_cast<std::size_t>(Space::dof);

 public:
  /// For rods of these lengths.
  template <class Lengths>
  explicit ChainAngles(const Lengths& lengths)
      : links_(static_cast<std::size_t>(lengths.size())),
        lengths_(lengths.begin(), lengths.end()),
        now_(links_),
        before_(now_) {}

  /// Starts with rods ξ_i = along(i) at angles q.
  template <class Along>
  void start(const double* q, Along along) {
    for (std::size_t i = 0; i < links_; ++i) {
      std::array<double, dof> angles;
      for (std::size_t a = 0; a < dof; ++a) angles[a] = q[entry(i, a)];
      now_[i].set(direction_of(along(static_cast<int>(i))), angles);
    }
    before_ = now_;
  }

  /// Call after a step in which no link has turned by half a turn or more. Rods were at ξ_i = along(i, share) when
  /// `share` of the step was done.
  template <class Along>
  void follow(Along along) {
    now_.swap(before_);
    for (std::size_t i = 0; i < links_; ++i) {
      now_[i] = before_[i];
      follow(static_cast<int>(i), 1, along, now_[i]);
    }
  }

  /// The angles and rates of link i, which is now at ξ and ξ̇.
  template <class Vector>
  void read(int i, const Vector& rod, const Vector& rate, double* q, double* v) const {
    write(at(i), now_[at(i)].angles(), rod, rate, q, v);
  }

  /// The same when `share` of the last step was done; `along` as for follow.
  template <class Along, class Vector>
  void read_within(int i, double share, Along along, const Vector& rod, const Vector& rate, double* q,
                   double* v) const {
    Anchor followed = before_[at(i)];
    follow(i, share, along, followed);
    write(at(i), followed.angles(), rod, rate, q, v);
  }

  /// The same for any ξ and ξ̇ of link i. q holds angles near it, and is replaced.
  template <class Vector>
  void read_near(int i, const Vector& rod, const Vector& rate, double* q, double* v) const {
    std::array<double, dof> near;
    for (std::size_t a = 0; a < dof; ++a) near[a] = q[entry(at(i), a)];
    write(at(i), near, rod, rate, q, v);
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    for (Anchor& anchor : now_) numbers(anchor);
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  std::size_t entry(std::size_t i, std::size_t a) const { return a * links_ + i; }

  // Takes the anchor from the start of the last step to where `share` of it was done.
  template <class Along>
  void follow(int i, double share, Along along, Anchor& anchor) const {
    const auto there = along(i, share);
    double squared = 0;
    for (std::size_t k = 0; k < there.size(); ++k) {
      const double moved = there[k] / lengths_[at(i)] - anchor.direction()[k];
      squared += moved * moved;
    }
    if (!(squared > anchor.reach_squared())) return;
    anchor.follow_path([&](double done) { return direction_of(along(i, done)); }, share);
  }

  template <class Vector>
  static auto direction_of(const Vector& rod) {
    typename Space::Link::template Cartesian<double> u;
    double squared = 0;
    for (const double x : rod) squared += x * x;
    const double inverse = 1 / std::sqrt(squared);
    for (std::size_t k = 0; k < u.size(); ++k) u[k] = inverse * rod[k];
    return u;
  }

  template <class Vector>
  void write(std::size_t i, const std::array<double, dof>& known, const Vector& rod, const Vector& rate, double* q,
             double* v) const {
    using Wide = LongReal;
    Wide squared = 0;
    for (const Wide x : rod) squared += x * x;
    const Wide inverse = 1 / std::sqrt(squared), length = lengths_[i];
    Heading<Space, Wide> heading;
    for (std::size_t k = 0; k < heading.u.size(); ++k) {
      heading.u[k] = inverse * rod[k];
      heading.u_dot[k] = rate[k] / length;
    }
    std::array<Wide, dof> near;
    for (std::size_t a = 0; a < dof; ++a) near[a] = known[a];
    const auto angles = user_angles(heading, near);
    for (std::size_t a = 0; a < dof; ++a) {
      q[entry(i, a)] = static_cast<double>(angles.q[a]);
      v[entry(i, a)] = static_cast<double>(angles.v[a]);
    }
  }

  std::size_t links_;
  std::vector<double> lengths_;
  std::vector<Anchor> now_, before_;  // before_: at the start of the last step
};

}  // namespace pendula
