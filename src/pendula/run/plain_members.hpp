#pragma once

#include <cstddef>
#include <cstdint>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>
#include <span>

namespace pendula {

/// The steps that members in lanes have just taken, as a MemberWatch sees them. q and v are all the coordinates and
/// their rates.
class MemberSteps {
 public:
  MemberSteps() = default;
  MemberSteps(const MemberSteps&) = delete;
  MemberSteps& operator=(const MemberSteps&) = delete;
  virtual ~MemberSteps() = default;

  virtual int lanes() const = 0;
  /// Whether the member in a lane has taken a step.
  virtual bool took_step(int lane) const = 0;
  /// Index of the member, and the times at which its step began and ended  [s].
  virtual std::size_t member(int lane) const = 0;
  virtual double begin(int lane) const = 0;
  virtual double end(int lane) const = 0;

  /// The current state of the member.
  virtual void state(int lane, double* q, double* v) = 0;
  /// The state at the fraction `share` of the step, 0 to 1, by dense output; cheap if several lanes ask for the same
  /// share.
  virtual void at(int lane, double share, double* q, double* v) = 0;
  /// The same at the full order of the method, for a watch with wants_looks; false if the step there fails.
  virtual bool at_full_order(int lane, double share, double* q, double* v) = 0;
  /// Logarithm of the growth of the member's tangent in the step; 0 if members have no tangents.
  virtual double growth(int lane) const = 0;
  /// Ends the motion of the member now.
  virtual void finish(int lane) = 0;
};

/// Watches members while they are moved.
class MemberWatch {
 public:
  MemberWatch() = default;
  MemberWatch(const MemberWatch&) = delete;
  MemberWatch& operator=(const MemberWatch&) = delete;
  virtual ~MemberWatch() = default;

  /// Whether `after_step` is to be called after each step, which all lanes take together.
  virtual bool wants_steps() const = 0;
  /// Whether `after_step` will ask for states at full order within steps (MemberSteps::at_full_order).
  virtual bool wants_looks() const = 0;
  virtual void after_step(MemberSteps& steps) = 0;
  /// Whether to stop; asked after every step.
  virtual bool stops() = 0;
};

/// A member of an ensemble as plain numbers, which cross from a program to the compiled library (library.hpp): a chain
/// (PlainChain) or a system of a generated kernel (PlainSystem), its start, and when it ends. The memory belongs to the
/// caller.
template <class Model>
struct PlainMember {
  Model model;
  double start, end;    ///< s
  const double *q, *v;  ///< (coordinates)
};

/// The result for a member.
struct MemberEnd {
  double *q, *v;               ///< (coordinates); memory of the caller, written
  double time = 0;             ///< s
  Status status = Status::ok;  ///< if not ok, the last accepted step ended here, and a stepper of one motion may go on
  std::int64_t steps = 0;      ///< accepted steps
  std::int64_t rejected_steps = 0;
  double energy_error = 0;  ///< the largest |H − H_0|, sampled regularly  [J]
  double energy_sum = 0;    ///< systems: the largest |T| + |U|, sampled likewise  [J]
};

/// Moves chains with the same number of links, one member in each lane. The energy is sampled every `every` steps. The
/// result for a member depends on that member alone, to the last bit. Returns false if `watch` stopped it.
using MoveMembers = bool(const RunOptions& options, std::int64_t every,
                         std::span<const PlainMember<PlainChain>> members, std::span<MemberEnd> ends,
                         MemberWatch& watch);

/// The same for systems of one kernel.
using MoveSystemMembers = bool(const SystemTable& table, const RunOptions& options, std::int64_t every,
                               std::span<const PlainMember<PlainSystem>> members, std::span<MemberEnd> ends,
                               MemberWatch& watch);

}  // namespace pendula
