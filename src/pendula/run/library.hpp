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
#include <type_traits>

namespace pendula {

struct Planar;
struct Spatial;

// The parts of the compiled library. One more part is `const ProgramInterpreter*`, the functions of interpreted kernels
// (system/interpreted_kernel.hpp). The linker leaves out parts that a program does not ask for (-Wl,--gc-sections).
//
// A program contains several copies of each part, compiled with different flags. Only what is declared here passes
// between the copies and the program: numbers, pointers to numbers, and classes with nothing but virtual functions.
// Their layout does not depend on flags; the memory layout of Eigen's vectors, and who may free them, does (-mavx).

/// Every method for chains of one space.
template <class Space>
struct ChainMaker {
  /// As make_integrator of integrator.hpp.
  std::unique_ptr<PlainIntegrator> (*make_integrator)(const PlainChain&, const RunOptions&);
};

/// Every method for any kernel.
struct SystemMaker {
  /// `parts` is the number of parts that failures name, 0 for the coordinates. Throws as make_integrator.
  std::unique_ptr<PlainIntegrator> (*make_integrator)(const SystemTable&, const PlainSystem&, const RunOptions&,
                                                      int parts);
};

/// The kernels of this build: of chains of one space, by number of links, or of `Models`.
template <class Kind>
struct KernelList {
  std::span<const SystemTable* const> tables;
};
struct Models;

/// What moves members of ensembles in lanes: chains of one space, or, for `Models`, systems of any kernel.
template <class Kind>
struct LaneMovers {
  using Move = std::conditional_t<std::is_same_v<Kind, Models>, MoveSystemMembers, MoveMembers>;
  /// nullptr for methods and stages that move members one by one.
  Move* (*plain)(const RunOptions&);
  /// The same with a tangent of each member; nullptr for methods that have none.
  Move* (*with_tangents)(const RunOptions&);
};

struct Orthonormalizer {
  /// Replaces directions, (rows, count) numbers row by row, by an orthonormal basis such that the first k span the same
  /// space as before, for every k. `lengths`, (count), is set to |R_kk| of the QR decomposition, by Householder
  /// reflections.
  void (*make_orthonormal)(double* directions, std::ptrdiff_t rows, std::ptrdiff_t count, double* lengths);
};

/// A part of the library for the best instruction set of this processor, or for the lesser one that the environment
/// variable PENDULA_ARCH asks for, which is read once. Throws std::invalid_argument if PENDULA_ARCH names none of this
/// build, or one that the processor lacks; std::runtime_error if the processor supports none of this build.
template <class Part>
Part library();

/// The instruction set of these parts: "sse2", "avx2" or "avx512"; "baseline" if the build has only one.
std::string_view instruction_set();

/// The instruction set that a processor needs to run this build; empty if every processor of its kind can.
std::string_view needed_instruction_set();

/// The fixed-n kernel of this build for a chain; nullptr if there is none.
template <class Space>
const SystemTable* kernel_of(int links) {
  for (const SystemTable* kernel : library<KernelList<Space>>().tables) {
    if (kernel->info.links == links) return kernel;
  }
  return nullptr;
}

/// The kernel whose Taylor series a chain moves by; nullptr where it moves by the series of rods. Those need no kernel
/// and take less time in lanes, but they take no loads.
template <class Space>
const SystemTable* series_kernel(int links, bool is_loaded, bool in_lanes) {
  const SystemTable* const kernel = kernel_of<Space>(links);
  return kernel != nullptr && kernel->of_1.series_next != nullptr && (is_loaded || !in_lanes) ? kernel : nullptr;
}

}  // namespace pendula
