#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/heading.hpp>
#include <pendula/ensemble/step_sight.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/run/plain_members.hpp>
#include <vector>

namespace pendula {

/// The last steps of members in lanes in the user's coordinates: angles of chains, coordinates of systems. A state that
/// several lanes ask for is found for all of them the first time. `Turns` is TurnCounter of chains.
template <class Space, class L, class Turns>
class MemberView : public MemberSteps {
  static constexpr std::size_t D = Space::dimension;

 public:
  using Mask = typename L::Mask;
  using Sight = StepSight<L, D>;

  MemberView(Sight& sight, const Turns& turns)
      : sight_(sight),
        turns_(turns),
        now_(coordinates()),
        views_(most_views, View(coordinates())),
        parts_(to_size(sight.count())),
        on_the_way_(parts_) {}

  /// These members have taken steps.
  void set(const Mask& took, const L& begin, const L& end) {
    select(took, L(1.0), L(0.0)).store(took_);
    begin.store(begin_);
    end.store(end_);
    for (double& finished : finished_) finished = 0;
    now_.share = nothing;
    for (View& view : views_) view.share = nothing;
  }
  /// Logarithms of the growth of their tangents.
  void set_growth(const L& growth) { growth.store(growth_); }
  void seat(int lane, std::size_t member) { members_[lane] = member; }
  Mask finished() const { return L::load(finished_) > L(0.0); }

  int lanes() const override { return L::size; }
  bool took_step(int lane) const override { return took_[lane] != 0; }
  std::size_t member(int lane) const override { return members_[lane]; }
  double begin(int lane) const override { return begin_[lane]; }
  double end(int lane) const override { return end_[lane]; }
  void finish(int lane) override { finished_[lane] = 1; }
  double growth(int lane) const override { return growth_[lane]; }

  void state(int lane, double* q, double* v) override {
    look_now();
    now_.read(lane, q, v);
  }

  void at(int lane, double share, double* q, double* v) override {
    look_now();
    view_at(share).read(lane, q, v);
  }

  bool at_full_order(int lane, double share, double* q, double* v) override {
    look_now();
    const L begin = L::load(begin_);
    if (!sight_.at_full_order(lane, begin, L::load(end_) - begin, share, parts_)) return false;
    View& view = views_.back();  // the view that was filled last
    view.share = nothing;
    write(share, view);
    view.read(lane, q, v);
    return true;
  }

 private:
  static constexpr double nothing = -1;
  static constexpr std::size_t most_views = 10;
  static constexpr auto width = L::width, dof = static_cast<std::size_t>(Space::dof);
  using Vector = std::array<L, D>;

  /// Coordinates and rates of all members at one share of their steps, lane after lane.
  struct View {
    explicit View(std::size_t coordinates) : q(coordinates), v(coordinates) {}

    void read(int lane, double* to_q, double* to_v) const {
      for (std::size_t k = 0; k < q.size(); ++k) {
        to_q[k] = q[k].numbers[lane];
        to_v[k] = v[k].numbers[lane];
      }
    }

    struct Numbers {
      alignas(pack_alignment) double numbers[width];
    };
    double share = nothing;
    std::vector<Numbers> q, v;
  };

  static std::size_t to_size(int i) { return static_cast<std::size_t>(i); }
  std::size_t coordinates() const { return dof * to_size(sight_.count()); }
  std::size_t entry(std::size_t i, std::size_t a) const { return a * to_size(sight_.count()) + i; }

  void look_now() {
    if (now_.share != nothing) return;
    now_.share = 1;
    sight_.now(parts_);
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const auto& [place, rate] = parts_[i];
      if constexpr (D == 1) {
        store(i, place[0], rate[0], now_);
      } else if constexpr (D == 2) {
        store(i, turns_.angles(static_cast<int>(i)), turning(place, rate), now_);
      } else {
        write_angles(
            i, [&](int lane, const auto&) { return turns_.angles(lane, static_cast<int>(i)); }, now_);
      }
    }
  }

  const View& view_at(double share) {
    std::size_t k = 0;
    while (k + 1 < most_views && views_[k].share != share && views_[k].share != nothing) ++k;
    View& view = views_[k];
    if (view.share == share) return view;
    view.share = share;
    sight_.at(share, parts_);
    write(share, view);
    return view;
  }

  // Writes the coordinates of `parts_`, which are those at `share` of the step.
  void write(double share, View& view) {
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const auto& [place, rate] = parts_[i];
      if constexpr (D == 1) {
        store(i, place[0], rate[0], view);
      } else if constexpr (D == 2) {
        store(i, Turns::near(place, L::load(now_.q[i].numbers)), turning(place, rate), view);
      } else {
        write_angles(
            i, [&](int lane, const auto& u) { return angles_near(lane, i, u, share); }, view);
      }
    }
  }

  static void store(std::size_t i, const L& q, const L& v, View& view) {
    q.store(view.q[i].numbers);
    v.store(view.v[i].numbers);
  }

  // θ̇ of a rod in the plane.
  static L turning(const Vector& rod, const Vector& rate) {
    const L square = fma(rod[0], rod[0], rod[1] * rod[1]);
    return fma(rod[0], rate[1], -(rod[1] * rate[0])) / square;
  }

  template <class Near>
  void write_angles(std::size_t i, Near near, View& view) const {
    const auto& [rod, rate] = parts_[i];
    alignas(pack_alignment) double along[D][width], moving[D][width];
    L square(0.0);
    for (const L& x : rod) square = fma(x, x, square);
    const L inverse = L(1.0) / sqrt(square);
    for (std::size_t k = 0; k < D; ++k) {
      (rod[k] * inverse).store(along[k]);
      (rate[k] * inverse).store(moving[k]);
    }
    for (int lane = 0; lane < L::size; ++lane) {
      if (!took_step(lane)) continue;
      Heading<Space> heading;
      for (std::size_t k = 0; k < D; ++k) {
        heading.u[k] = along[k][lane];
        heading.u_dot[k] = moving[k][lane];
      }
      const auto angles = user_angles(heading, near(lane, heading.u));
      for (std::size_t a = 0; a < dof; ++a) {
        view.q[entry(i, a)].numbers[lane] = angles.q[a];
        view.v[entry(i, a)].numbers[lane] = angles.v[a];
      }
    }
  }

  // Angles near those of u, the direction of a link at a share of its step: the angles at the end of the step or, if
  // the link may have passed a pole, those found by following it back from there.
  std::array<double, 2> angles_near(int lane, std::size_t i, const std::array<double, D>& u,
                                    double share) requires(D == 3) {
    const auto direction_at = [&](double back) {
      back == 0 ? sight_.now(on_the_way_) : sight_.at(1 - back, on_the_way_);
      return direction_of(on_the_way_[i].place, lane);
    };
    AngleAnchor<Space> anchor;
    anchor.set(direction_at(0), {now_.q[entry(i, 0)].numbers[lane], now_.q[entry(i, 1)].numbers[lane]});
    if (anchor.leaves(u)) anchor.follow_path(direction_at, 1 - share);
    return anchor.angles();
  }

  Sight& sight_;
  const Turns& turns_;
  alignas(pack_alignment) double took_[width] = {}, begin_[width] = {}, end_[width] = {}, finished_[width] = {};
  alignas(pack_alignment) double growth_[width] = {};
  std::size_t members_[width] = {};
  View now_;  // the state
  std::vector<View> views_;
  typename Sight::Parts parts_, on_the_way_;
};

}  // namespace pendula
