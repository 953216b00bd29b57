#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <pendula/chain/heading.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/run/plain_members.hpp>
#include <vector>

namespace pendula {

/// Looks into the last steps of all members of a MembersStepper or ExplicitSteps at once, and hands out what it sees of
/// one. What several lanes ask for is found for all of them the first time. `Turns` is as TurnCounter; coordinates of
/// systems, of one dimension, are what they are.
template <class Stepper, class Turns>
class MemberView : public MemberSteps {
 public:
  using Space = typename Stepper::SpaceType;
  using L = typename Stepper::L;
  using Mask = typename L::Mask;
  using Vector = typename Stepper::Chain::Vector;

  MemberView(Stepper& stepper, const Turns& turns)
      : stepper_(stepper),
        chain_(stepper.chain()),
        turns_(turns),
        now_(coordinates()),
        views_(most_views, View(coordinates())),
        moving_(D == 3 ? at(stepper.chain().links()) : 0) {}

  /// These members have taken steps.
  void set(const Mask& took, const L& begin, const L& end) {
    select(took, L(1.0), L(0.0)).store(took_);
    begin.store(begin_);
    end.store(end_);
    for (double& finished : finished_) finished = 0;
    now_.share = nothing;
    for (View& view : views_) view.share = nothing;
  }
  /// What their tangents have grown by, as logarithms.
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

  void glance(int lane, double share, double* q, double* v) override {
    look_now();
    view_at(share).read(lane, q, v);
  }

  bool look(int lane, double share, double* q, double* v) override {
    look_now();
    View& view = views_.back();  // of what was glanced at last
    view.share = nothing;
    if constexpr (!Stepper::is_implicit) {
      write([&](auto visit) { chain_.for_each_look(share, visit); }, share, view);
    } else if constexpr (!Stepper::has_tangent) {
      if (!step_again(lane, share)) return false;
      auto& there = again_->chain();
      const auto each = [&](auto visit) {
        there.for_each_rate([&](int i, const Vector& rate, const L&) { visit(i, there.along(i), rate); });
      };
      write(each, share, view);
    }
    view.read(lane, q, v);
    return true;
  }

 private:
  static constexpr double nothing = -1;
  static constexpr std::size_t most_views = 10;
  static constexpr auto width = L::width, dof = static_cast<std::size_t>(Space::dof);
  static constexpr std::size_t D = Space::dimension;

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

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  std::size_t coordinates() const { return dof * static_cast<std::size_t>(chain_.links()); }
  std::size_t entry(int i, std::size_t a) const {
    return a * static_cast<std::size_t>(chain_.links()) + static_cast<std::size_t>(i);
  }

  void look_now() {
    if (now_.share != nothing) return;
    now_.share = 1;
    chain_.for_each_rate([&](int i, const Vector& rate, const L&) {
      if constexpr (D == 1) {
        chain_.along(i)[0].store(now_.q[entry(i, 0)].numbers);
        rate[0].store(now_.v[entry(i, 0)].numbers);
      } else if constexpr (D == 2) {
        turns_.angles(i).store(now_.q[entry(i, 0)].numbers);
        turning(chain_.along(i), rate).store(now_.v[entry(i, 0)].numbers);
      } else {
        write_angles(
            i, chain_.along(i), rate, [&](int lane, const auto&) { return turns_.angles(lane, i); }, now_);
      }
    });
  }

  const View& view_at(double share) {
    std::size_t k = 0;
    while (k + 1 < most_views && views_[k].share != share && views_[k].share != nothing) ++k;
    View& view = views_[k];
    if (view.share == share) return view;
    view.share = share;
    write([&](auto visit) { chain_.for_each_glance(share, visit); }, share, view);
    return view;
  }

  // A share of the last step of one member: a step of its own, from where that one began.
  bool step_again(int lane, double share) requires Stepper::is_implicit {
    again_.emplace(stepper_);
    again_->go_back();
    L wanted(0.0);
    wanted.set(lane, 1);
    const L begin = L::load(begin_), h = share * (L::load(end_) - begin);
    const Mask found = again_->solve(begin, h, wanted > L(0.0));
    again_->accept(found);
    return xsimd::any(found);
  }

  // Coordinates and rates of each(visit(i, rod, rate)), which are at a share of the step.
  template <class Each>
  void write(Each each, double share, View& view) {
    if constexpr (D == 1) {
      each([&](int i, const Vector& q, const Vector& v) {
        q[0].store(view.q[entry(i, 0)].numbers);
        v[0].store(view.v[entry(i, 0)].numbers);
      });
    } else if constexpr (D == 2) {
      each([&](int i, const Vector& rod, const Vector& rate) {
        const std::size_t k = entry(i, 0);
        Turns::near(rod, L::load(now_.q[k].numbers)).store(view.q[k].numbers);
        turning(rod, rate).store(view.v[k].numbers);
      });
    } else {
      each([&](int i, const Vector& rod, const Vector& rate) { moving_[at(i)] = {rod, rate}; });
      for (int i = 0; i < chain_.links(); ++i) {
        const auto near = [&](int lane, const auto& u) { return angles_near(lane, i, u, share); };
        write_angles(i, moving_[at(i)].rod, moving_[at(i)].rate, near, view);
      }
    }
  }

  // θ̇ of a rod in the plane.
  static L turning(const Vector& rod, const Vector& rate) {
    const L square = fma(rod[0], rod[0], rod[1] * rod[1]);
    return fma(rod[0], rate[1], -(rod[1] * rate[0])) / square;
  }

  template <class Near>
  void write_angles(int i, const Vector& rod, const Vector& rate, Near near, View& view) const {
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

  // Angles of a moment before u, which a link points to at a share of its step: those at the end of the step, or on the
  // way back from there, where the link may have come by a pole.
  std::array<double, 2> angles_near(int lane, int i, const std::array<double, D>& u, double share) requires(D == 3) {
    AngleAnchor<Space> anchor;
    anchor.set(direction_of(chain_.along(i), lane),
               {now_.q[entry(i, 0)].numbers[lane], now_.q[entry(i, 1)].numbers[lane]});
    if (anchor.leaves(u)) {
      const auto direction_at = [&](double back) {
        std::array<double, D> on_the_way;
        chain_.for_each_glance(1 - back, [&](int link, const Vector& rod, const Vector&) {
          if (link == i) on_the_way = direction_of(rod, lane);
        });
        return on_the_way;
      };
      anchor.follow_path(direction_at, 1 - share);
    }
    return anchor.angles();
  }

  struct Moving {
    Vector rod, rate;
  };

  Stepper& stepper_;
  typename Stepper::Chain& chain_;
  const Turns& turns_;
  alignas(pack_alignment) double took_[width] = {}, begin_[width] = {}, end_[width] = {}, finished_[width] = {};
  alignas(pack_alignment) double growth_[width] = {};
  std::size_t members_[width] = {};
  View now_;  // the state
  std::vector<View> views_;
  std::vector<Moving> moving_;  // in space, the links where a view is made
  std::optional<Stepper> again_;
};

}  // namespace pendula
