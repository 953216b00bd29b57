#pragma once

#include <array>
#include <cstddef>
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
      : chain_(stepper.chain()), turns_(turns), now_(coordinates()), views_(most_views, View(coordinates())) {}

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
    if constexpr (Stepper::is_implicit) return MemberSteps::look(lane, share, q, v);
    look_now();
    look_again(share).read(lane, q, v);
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
        const auto anchored = [&](int lane) { return turns_.angles(lane, i); };
        write_angles(i, chain_.along(i), rate, anchored, now_);
      }
    });
  }

  const View& view_at(double share) {
    std::size_t k = 0;
    while (k + 1 < most_views && views_[k].share != share && views_[k].share != nothing) ++k;
    View& view = views_[k];
    if (view.share == share) return view;
    view.share = share;
    chain_.for_each_glance(share, writer(view));
    return view;
  }

  const View& look_again(double share) {
    View& view = views_.back();  // of what was glanced at last
    view.share = nothing;
    if constexpr (!Stepper::is_implicit) chain_.for_each_look(share, writer(view));
    return view;
  }

  auto writer(View& view) const {
    return [this, &view](int i, const Vector& rod, const Vector& rate) {
      const std::size_t first = entry(i, 0);
      if constexpr (D == 1) {
        rod[0].store(view.q[first].numbers);
        rate[0].store(view.v[first].numbers);
      } else if constexpr (D == 2) {
        Turns::near(rod, L::load(now_.q[first].numbers)).store(view.q[first].numbers);
        turning(rod, rate).store(view.v[first].numbers);
      } else {
        const auto now = [&](int lane) {
          return std::array{now_.q[first].numbers[lane], now_.q[entry(i, 1)].numbers[lane]};
        };
        write_angles(i, rod, rate, now, view);
      }
    };
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
      const auto angles = user_angles(heading, near(lane));
      for (std::size_t a = 0; a < dof; ++a) {
        view.q[entry(i, a)].numbers[lane] = angles.q[a];
        view.v[entry(i, a)].numbers[lane] = angles.v[a];
      }
    }
  }

  typename Stepper::Chain& chain_;
  const Turns& turns_;
  alignas(pack_alignment) double took_[width] = {}, begin_[width] = {}, end_[width] = {}, finished_[width] = {};
  alignas(pack_alignment) double growth_[width] = {};
  std::size_t members_[width] = {};
  View now_;  // the state
  std::vector<View> views_;
};

}  // namespace pendula
