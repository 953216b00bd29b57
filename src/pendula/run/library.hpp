#pragma once

#include <cstddef>
#include <memory>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/program.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <string_view>

namespace pendula {

/// What the compiled library offers for chains of one space.
struct SpaceLibrary {
  /// As make_integrator, of integrator.hpp.
  std::unique_ptr<PlainIntegrator> (*make_integrator)(const PlainChain&, const RunOptions&);
  /// The fixed-n kernels of this build, by number of links.
  std::span<const SystemTable* const> kernels;
  /// Members in lanes; nullptr for methods and stages that move them one by one.
  MoveMembers* (*lanes)(const RunOptions&);
  /// The same with a tangent of each; nullptr for methods that have none.
  MoveMembers* (*tangent_lanes)(const RunOptions&);
};

/// The compiled library for one instruction set. There are several in one file, each compiled for itself; all that
/// passes between them and a program is what is in here: numbers, pointers to them, classes of nothing but virtual
/// functions. So it does not matter how either was compiled. (How Eigen's vectors lie in memory and who may free them
/// depends on flags such as -mavx.)
struct Library {
  std::string_view instruction_set;  ///< "sse2", "avx2" or "avx512"; "baseline" where there is one only
  SpaceLibrary planar, spatial;
  std::span<const SystemTable* const> systems;  ///< kernels of this build that are no chains
  /// Every method over these, and over any other kernel; `parts` is what failures name, 0 for the coordinates. Throws
  /// as make_integrator.
  std::unique_ptr<PlainIntegrator> (*make_system_integrator)(const SystemTable&, const PlainSystem&, const RunOptions&,
                                                             int parts);
  /// Members of these, and of any other kernel, in lanes; nullptr for methods that move them one by one.
  MoveSystemMembers* (*system_lanes)(const RunOptions&);
  /// The same with a tangent of each; nullptr for methods that have none.
  MoveSystemMembers* (*system_tangent_lanes)(const RunOptions&);
  /// Makes directions, (rows, count) numbers row by row, an orthonormal basis of what the first of them span, for any
  /// number of them; `lengths`, (count), gets |R_kk| of the QR decomposition, by Householder reflections.
  void (*make_orthonormal)(double* directions, std::ptrdiff_t rows, std::ptrdiff_t count, double* lengths);
  /// Functions of kernels that are no code but programs (system/interpreted_kernel.hpp).
  const ProgramInterpreter* interpreter;
};

/// The library for the best instruction set that this processor has, or for the lesser one that the environment
/// variable PENDULA_ARCH asks for, which is read once. Throws std::invalid_argument where PENDULA_ARCH names none of
/// this build, or one that the processor lacks; std::runtime_error where the processor has none of this build.
const Library& library();

/// The instruction set without which a processor runs nothing of this build; empty where it runs on all of its kind.
std::string_view needed_instruction_set();

/// Its part for one space.
template <class Space>
const SpaceLibrary& library_of() {
  return Space::dof == 1 ? library().planar : library().spatial;
}

}  // namespace pendula
