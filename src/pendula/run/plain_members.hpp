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

/// The steps that members in lanes have just taken, as those who watch them see them; q and v are all the angles and
/// their rates.
class MemberSteps {
 public:
  MemberSteps() = default;
  MemberSteps(const MemberSteps&) = delete;
  MemberSteps& operator=(const MemberSteps&) = delete;
  virtual ~MemberSteps() = default;

  virtual int lanes() const = 0;
  /// Whether the member in a lane has taken one.
  virtual bool took_step(int lane) const = 0;
  /// Its number, from 0 on, and the times that its step began and ended at  [s].
  virtual std::size_t member(int lane) const = 0;
  virtual double begin(int lane) const = 0;
  virtual double end(int lane) const = 0;

  /// Where it is now.
  virtual void state(int lane, double* q, double* v) = 0;
  /// Where it was when a share of the step was done, 0 to 1, by the polynomial through the step's stages: cheap where
  /// several lanes ask for the same share.
  virtual void glance(int lane, double share, double* q, double* v) = 0;
  /// The same at the full order of the method, for a watch that wants looks; false where such a step is not found.
  virtual bool look(int lane, double share, double* q, double* v) = 0;
  /// The logarithm of how its tangent has grown in the step; 0 where members are moved without.
  virtual double growth(int lane) const = 0;
  /// Its motion is over, whatever its time.
  virtual void finish(int lane) = 0;
};

/// Who watches members while they are moved.
class MemberWatch {
 public:
  MemberWatch() = default;
  MemberWatch(const MemberWatch&) = delete;
  MemberWatch& operator=(const MemberWatch&) = delete;
  virtual ~MemberWatch() = default;

  /// Whether to look into steps at all: `after_step` is called for those of all lanes together.
  virtual bool wants_steps() const = 0;
  /// Whether it will ask for states of full order within steps (MemberSteps::look).
  virtual bool wants_looks() const = 0;
  virtual void after_step(MemberSteps& steps) = 0;
  /// Whether to leave off; asked after every step.
  virtual bool stops() = 0;
};

/// A member of an ensemble: a chain (PlainChain) or a system of a generated kernel (PlainSystem), where it starts, and
/// when it ends. Plain numbers cross from a program to the compiled library (library.hpp); the caller owns what is
/// pointed at.
template <class Model>
struct PlainMember {
  Model model;
  double start, end;    ///< s
  const double *q, *v;  ///< (coordinates)
};

/// What became of it.
struct MemberEnd {
  double *q, *v;               ///< (coordinates), of the caller, written
  double time = 0;             ///< s
  Status status = Status::ok;  ///< otherwise the last accepted step ended here, and a stepper of one motion may go on
  std::int64_t steps = 0;      ///< accepted ones
  std::int64_t rejected_steps = 0;
  double energy_error = 0;  ///< the largest |H − H_0| at every so many steps  [J]
  double energy_sum = 0;    ///< of systems, the largest |T| + |U| there  [J]
};

/// Moves chains of one number of links, a member in each lane; `every` how many steps from one look at the energy to
/// the next. What becomes of a member depends on that member alone, to the last bit. False where `watch` made it leave
/// off.
using MoveMembers = bool(const RunOptions& options, std::int64_t every,
                         std::span<const PlainMember<PlainChain>> members, std::span<MemberEnd> ends,
                         MemberWatch& watch);

/// The same of systems of one kernel.
using MoveSystemMembers = bool(const SystemTable& table, const RunOptions& options, std::int64_t every,
                               std::span<const PlainMember<PlainSystem>> members, std::span<MemberEnd> ends,
                               MemberWatch& watch);

}  // namespace pendula
