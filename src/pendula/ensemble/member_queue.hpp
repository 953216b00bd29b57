#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <pendula/chain/chain_members.hpp>
#include <pendula/ensemble/chain_seats.hpp>
#include <pendula/ensemble/system_seats.hpp>
#include <pendula/explicit/chain_accelerations.hpp>
#include <pendula/explicit/explicit_steps.hpp>
#include <pendula/explicit/system_accelerations.hpp>
#include <pendula/gauss/members_stepper.hpp>
#include <pendula/gauss/system_members.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/step_rules.hpp>
#include <pendula/taylor/series_steps.hpp>
#include <pendula/taylor/taylor_steps.hpp>
#include <span>
#include <stdexcept>

namespace pendula {

/// Options of a MemberQueue.
struct QueueOptions {
  double step = 0;                ///< s; 0: adaptive steps of each member, by the tolerance
  double tolerance = 1e-9;        ///< of the motion, relative to its size, as RunOptions::tolerance
  double enough = 0;              ///< MembersStepperOptions; 0: round-off, or a part of the tolerance of adaptive steps
  std::int64_t energy_every = 0;  ///< steps between samples of the energy; 0: none
};

/// Moves the members of an ensemble to their ends by steps of a MembersStepper or ExplicitSteps, as many at once as a
/// register has lanes; `Seats` puts them into lanes and reads them. A lane whose member has reached its end takes the
/// next one, so that none is idle until the last have begun. The motion of a member depends on that member alone, to
/// the last bit.
///
/// A member that a fixed point cannot move ends where it is, with a status; the others go on.
template <class Stepper, class Seats = ChainSeats<Stepper>>
class MemberQueue {
 public:
  using L = typename Stepper::L;
  using Mask = typename L::Mask;
  using MemberType = typename Seats::MemberType;
  using Subject = typename Stepper::Subject;
  static constexpr int lanes = L::size, stages = Stepper::stages;

  /// `subject` is what members share: the number of links of chains, the table of the kernel of systems. Throws
  /// std::invalid_argument if a method without error estimate is given no step.
  MemberQueue(Subject subject, const QueueOptions& options)
      : options_(options),
        stepper_(subject, stepper_options(options)),
        controller_(options.tolerance),
        seats_(stepper_) {}
  MemberQueue(const MemberQueue&) = delete;
  MemberQueue& operator=(const MemberQueue&) = delete;

  /// `watch` sees every step from now on, and may end a member or all.
  void set_watch(MemberWatch& watch) {
    watch_ = &watch;
    if (watch.wants_steps()) seats_.show(view_);
    keeps_begin_ = watch.wants_looks();
  }

  /// Moves all members; ends[i] is the end of members[i]; false if the watch stopped it. Throws
  /// std::invalid_argument on another number of links, and unless there is an end for each member.
  bool run(std::span<const MemberType> members, std::span<MemberEnd> ends) {
    if (ends.size() != members.size()) throw std::invalid_argument("ensemble: expected an end for each member");
    members_ = members;
    ends_ = ends;
    next_ = 0;
    for (int lane = 0; lane < lanes; ++lane) refill(lane);
    begin();
    while (xsimd::any(running())) {
      step();
      if (watch_ != nullptr && watch_->stops()) return false;
    }
    return true;
  }

  /// Number of fixed-point iterations, each of all lanes at once.
  std::int64_t iterations() const requires(Stepper::is_implicit) { return stepper_.iterations(); }

 private:
  // The scale of the energy of a system is known only after the run: the largest |T| + |U|.
  static constexpr bool sums_energies = requires(const Stepper& stepper) { stepper.energy_sum(); };
  static constexpr bool may_be_stiff = requires(const Stepper& stepper) { stepper.chain().may_be_stiff(); };
  static constexpr double first_unsolved = 10, most_unsolved = 0.1;  // failed steps: in all, and per accepted step
  static constexpr double smallest_step = 1e-10;                     // relative to the time that is left

  // An iteration error of a ten-thousandth of the tolerance does not show beside the error of a step.
  static typename Stepper::Options stepper_options(const QueueOptions& options) {
    if constexpr (Stepper::is_implicit) {
      typename Stepper::Options given;
      given.are_chosen = options.step == 0;
      if (given.are_chosen) given.enough = std::max(given.enough, 1e-4 * options.tolerance);
      if constexpr (requires { Stepper::Chain::most_iterations; }) {
        if (given.are_chosen && options.enough == 0) given.max_iterations = Stepper::Chain::most_iterations;
      }
      if (options.enough > 0) given.enough = options.enough;
      return given;
    } else {
      if (options.step == 0 && !Stepper::can_choose) {
        throw std::invalid_argument("ensemble: expected a step for a method that chooses none");
      }
      typename Stepper::Options given;
      if constexpr (requires { given.tolerance; }) given.tolerance = options.tolerance;
      return given;
    }
  }

  bool chooses() const { return Stepper::can_choose && options_.step == 0; }
  Mask running() const { return running_ > L(0.0); }

  // One step of all members.
  void step() {
    const L remaining = (end_ - time_.value) - time_.low;
    const L wanted = chooses() ? controller_.step(stepper_) : L(options_.step);
    const Mask is_cut = !detail::ends_before(wanted, remaining);
    const L h = select(running() & is_cut, remaining, wanted);
    const Mask found = stepper_.solve(time_.value, h, running() & (h > smallest_step * remaining));
    Mask good = found, wrong = found & !found;
    if (chooses()) good = controller_.accepts(found, h, stepper_);
    if constexpr (Stepper::is_implicit) {
      const Mask doubtful = good & stepper_.doubtful();
      if (xsimd::any(doubtful)) {
        wrong = accept_doubtful(good, doubtful);
      } else {
        accept(good);
      }
    } else {
      accept(good);
    }
    good = good & !wrong;
    const L begin = time_.value;
    const Twofold<L> later = exact_sum(begin, h);
    time_ = {select(good, later.value, time_.value), select(good, time_.low + later.low, time_.low)};
    steps_ = steps_ + select(good, L(1.0), L(0.0));
    attempts_ = select(good, L(0.0), attempts_);
    const Mask is_finished = show(good, begin, is_cut);
    if (options_.energy_every > 0) watch_energy(good & !is_finished);  // finished members ended within this step
    if (chooses()) controller_.move_on(good, h, stepper_);
    const Mask bad = running() & !good;
    if (xsimd::any(bad)) reject(bad, found & !wrong, h, remaining);
    const Mask over = good & (is_cut | is_finished);
    if (xsimd::any(over)) retire(over, Status::ok);
  }

  void accept(const Mask& good) {
    if constexpr (Stepper::is_implicit) {
      if (keeps_begin_) stepper_.chain().save();
    }
    stepper_.accept(good);
    seats_.follow(good, good & !good);
  }

  // Accepts good members, but of the doubtful ones only those whose energy balances: stages of the others solve the
  // equations, but are not those of the motion. Returns these others.
  Mask accept_doubtful(const Mask& good, const Mask& doubtful) {
    auto& chain = stepper_.chain();
    const L due = chain.energy_due();
    chain.save();
    stepper_.accept(good);
    const L after = chain.energy();
    const L bound = detail::largest_energy_defect * chain.energy_scale(due);
    const Mask wrong = doubtful & !(abs(after - due) <= bound);
    chain.restore(wrong);
    stepper_.forget(wrong);
    const Mask right = good & !wrong;
    seats_.follow(right, right & stepper_.turns_far());
    return wrong;
  }

  // Shows the step to the watch. Returns the members that the watch has finished.
  Mask show(const Mask& good, const L& begin, const Mask& is_cut) {
    if (!view_ || !xsimd::any(good)) return good & !good;
    view_->set(good, begin, select(is_cut, end_, time_.value));
    if constexpr (Stepper::has_tangent) view_->set_growth(stepper_.take_growth(good));
    watch_->after_step(*view_);
    return view_->finished();
  }

  void watch_energy(const Mask& good) {
    since_look_ = since_look_ + select(good, L(1.0), L(0.0));
    const Mask due = good & (since_look_ >= L(static_cast<double>(options_.energy_every)));
    if (!xsimd::any(due)) return;
    since_look_ = select(due, L(0.0), since_look_);
    energy_error_ = select(due, max(energy_error_, abs(stepper_.chain().energy() - energy_)), energy_error_);
    watch_energy_sum(due);
  }

  void watch_energy_sum(const Mask& due) {
    if constexpr (sums_energies) energy_sum_ = select(due, max(energy_sum_, stepper_.energy_sum()), energy_sum_);
  }

  // Rejected members try a shorter step or give up; where the step was solved, its error has set the next one.
  void reject(const Mask& bad, const Mask& solved, const L& h, const L& remaining) {
    attempts_ = attempts_ + select(bad, L(1.0), L(0.0));
    rejected_ = rejected_ + select(bad, L(1.0), L(0.0));
    Mask lost = bad;
    if (chooses()) {
      controller_.shrink(bad & !solved, h, L(0.5));
      lost = bad & ((attempts_ >= L(detail::most_attempts_in_lanes)) | !(h > smallest_step * remaining) |
                    is_stiff(bad & !solved));
    }
    if (xsimd::any(lost)) retire(lost, Status::not_converged);
  }

  // Members whose fixed points have failed so often that convergence limits their steps, not the error. Run alone, by
  // Newton's iteration, they take less time.
  Mask is_stiff([[maybe_unused]] const Mask& unsolved) {
    if constexpr (may_be_stiff) {
      const Mask counted = unsolved & stepper_.chain().may_be_stiff();
      unsolved_ = unsolved_ + select(counted, L(1.0), L(0.0));
      return counted & (unsolved_ > fma(L(most_unsolved), steps_, L(first_unsolved)));
    }
    return unsolved & !unsolved;
  }

  void retire(const Mask& which, Status status) {
    alignas(pack_alignment) double is_over[L::width];
    select(which, L(1.0), L(0.0)).store(is_over);
    for (int lane = 0; lane < lanes; ++lane) {
      if (is_over[lane] == 0) continue;
      write_end(lane, status);
      refill(lane);
    }
    begin();
  }

  void write_end(int lane, Status status) {
    MemberEnd& end = ends_[static_cast<std::size_t>(member_[lane])];
    end.status = status;
    end.steps = static_cast<std::int64_t>(steps_[lane]);
    end.rejected_steps = static_cast<std::int64_t>(rejected_[lane]);
    end.energy_error = energy_error_[lane];
    end.energy_sum = energy_sum_[lane];
    end.time = status == Status::ok ? end_[lane] : time_.value[lane];
    seats_.read(lane, end.q, end.v);
  }

  // Seats the next member in a free lane; members that end where they start are skipped.
  void refill(int lane) {
    running_.set(lane, 0);
    while (next_ < members_.size()) {
      const std::size_t member = next_++;
      const MemberType& next = members_[member];
      seats_.require(next, member);
      ends_[member] = {.q = ends_[member].q, .v = ends_[member].v, .time = next.start};
      if (!(next.end > next.start)) {
        std::copy_n(next.q, seats_.coordinates(), ends_[member].q);
        std::copy_n(next.v, seats_.coordinates(), ends_[member].v);
        continue;
      }
      take(lane, member, next);
      return;
    }
  }

  void take(int lane, std::size_t member, const MemberType& next) {
    seats_.take(lane, next);
    member_[lane] = static_cast<std::ptrdiff_t>(member);
    time_.value.set(lane, next.start);
    end_.set(lane, next.end);
    for (L* zero :
         {&time_.low, &steps_, &rejected_, &unsolved_, &attempts_, &since_look_, &energy_error_, &energy_sum_})
      zero->set(lane, 0);
    if (view_) view_->seat(lane, member);
    running_.set(lane, 1);
    begins_.set(lane, 1);
  }

  // Starts the controller and the energy record of members that were just seated.
  void begin() {
    const Mask begins = begins_ > L(0.0);
    begins_ = L(0.0);
    if (chooses()) controller_.start(begins, stepper_);
    if (options_.energy_every == 0) return;
    energy_ = select(begins, stepper_.chain().energy(), energy_);
    watch_energy_sum(begins);
  }

  QueueOptions options_;
  Stepper stepper_;
  typename Stepper::Controller controller_;
  Seats seats_;
  std::span<const MemberType> members_;
  std::span<MemberEnd> ends_;
  std::size_t next_ = 0;
  std::ptrdiff_t member_[L::width] = {};
  Twofold<L> time_{L(0.0), L(0.0)};
  L end_{0.0}, running_{0.0}, begins_{0.0};
  L steps_{0.0}, rejected_{0.0}, unsolved_{0.0}, attempts_{0.0};
  L energy_{0.0}, energy_error_{0.0}, energy_sum_{0.0}, since_look_{0.0};
  MemberWatch* watch_ = nullptr;
  bool keeps_begin_ = false;  // whether the start of the last step is kept, for states within it
  std::optional<typename Seats::View> view_;
};

/// Gauss steps of S stages, of chains of N links.
template <class Space, int S, int N = Eigen::Dynamic, class Register = MemberRegister>
using GaussLanes = MemberQueue<MembersStepper<ChainMembers<Space, S, N, Register>>>;

/// The same with a tangent of each member, whose growth the watch gets.
template <class Space, int S, int N = Eigen::Dynamic, class Register = MemberRegister>
using GaussTangentLanes = MemberQueue<MembersStepper<ChainMembers<Space, S, N, Register, true>>>;

/// Explicit steps of chains.
template <class Space, class Method, int N = Eigen::Dynamic, class Register = MemberRegister>
using ExplicitLanes = MemberQueue<ExplicitSteps<ChainAccelerations<Space, N, LanePack<Register>>, Method>>;

/// The same with a tangent of each member.
template <class Space, class Method, int N = Eigen::Dynamic, class Register = MemberRegister>
using TangentLanes = MemberQueue<ExplicitSteps<ChainAccelerations<Space, N, LanePack<Register>, true>, Method>>;

/// Taylor series of chains without loads.
template <class Space, int N = Eigen::Dynamic, class Register = MemberRegister>
using TaylorLanes = MemberQueue<TaylorSteps<ChainAccelerations<Space, N, LanePack<Register>>>>;

/// The same with a tangent of each member.
template <class Space, int N = Eigen::Dynamic, class Register = MemberRegister>
using TaylorTangentLanes = MemberQueue<TaylorSteps<ChainAccelerations<Space, N, LanePack<Register>, true>>>;

/// Explicit steps of systems of one kernel (MemberSystems).
template <class Method, class Register = MemberRegister>
using SystemLanes = MemberQueue<ExplicitSteps<SystemAccelerations<LanePack<Register>>, Method>,
                                SystemSeats<ExplicitSteps<SystemAccelerations<LanePack<Register>>, Method>>>;

/// Taylor series of systems.
template <class Register = MemberRegister>
using SystemSeriesLanes = MemberQueue<SeriesSteps<LanePack<Register>>, SystemSeats<SeriesSteps<LanePack<Register>>>>;

/// Gauss steps of S stages, of systems.
template <int S, class Register = MemberRegister>
using GaussSystemLanes =
    MemberQueue<MembersStepper<SystemMembers<S, Register>>, SystemSeats<MembersStepper<SystemMembers<S, Register>>>>;

/// The same with a tangent of each member.
template <int S, class Register = MemberRegister>
using GaussSystemTangentLanes = MemberQueue<MembersStepper<SystemMembers<S, Register, true>>,
                                            SystemSeats<MembersStepper<SystemMembers<S, Register, true>>>>;

/// Explicit steps of systems, with a tangent of each member.
template <class Method, class Register = MemberRegister>
using SystemTangentLanes =
    MemberQueue<ExplicitSteps<SystemAccelerations<LanePack<Register>, true>, Method>,
                SystemSeats<ExplicitSteps<SystemAccelerations<LanePack<Register>, true>, Method>>>;

}  // namespace pendula
