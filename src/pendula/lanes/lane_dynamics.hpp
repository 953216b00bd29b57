#pragma once

#include <pendula/system/plain_system.hpp>

namespace pendula {

/// What a Gauss step has to know of a member where it starts.
struct LaneStart {
  double slowest_squared = 0;        ///< κ of the pace  [1/s²]
  double natural_speed_squared = 0;  ///< Pace::natural_speed_squared  [J]
  bool loaded = false;               ///< energy may come from outside, or go there
};

/// Several systems of one kernel, one in each lane: what a kernel is for the steppers of the compiled library, which
/// have no loop over stages of their own for each kernel. Numbers of all lanes lie side by side, those of a coordinate
/// after those of the one before, all of them aligned as LanePack wants it.
class LaneDynamics {
 public:
  LaneDynamics() = default;
  LaneDynamics(const LaneDynamics&) = delete;
  LaneDynamics& operator=(const LaneDynamics&) = delete;
  virtual ~LaneDynamics() = default;

  /// A library that was compiled for others moves nobody.
  virtual int lanes() const = 0;
  virtual int coordinates() const = 0;
  /// What kind of numbers coordinates are.
  virtual bool is_angle(int coordinate) const = 0;
  virtual bool of_one_unit(int coordinate, int other) const = 0;
  virtual bool is_periodic(int coordinate) const = 0;
  /// Whether the mass matrix is the same wherever they are.
  virtual bool constant_masses() const = 0;

  /// A member's numbers come into a lane.
  virtual void take(int lane, const PlainSystem& system) = 0;
  /// q̈ at the times (lanes), of q and q̇ (coordinates, lanes).
  virtual void accelerations(const double* times, const double* q, const double* v, double* a) = 0;
  /// The same, and its derivative along tangents (dq, dv) of the motions.
  virtual void variations(const double* times, const double* q, const double* v, const double* dq, const double* dv,
                          double* a, double* da) = 0;
  /// Highest frequency of what drives each of them  (lanes)  [rad/s].
  virtual void fastest_drives(double* frequencies) const = 0;
  /// Whether they depend on time in other ways.
  virtual bool depends_on_time() const = 0;
  /// What starts at q and v  (coordinates): its momenta there, and the largest pivots that its mass matrix has.
  virtual LaneStart start(const PlainSystem& system, double time, const double* q, const double* v, double* p,
                          double* pivots) const = 0;
  /// q̇ and ṗ of q and p.
  virtual void hamiltonian_form(const double* times, const double* q, const double* p, double* v, double* f) = 0;
  /// M  (coordinates, coordinates, lanes).
  virtual void masses(const double* times, const double* q, double* masses) = 0;
  /// What forces bring  (lanes)  [W].
  virtual void powers(const double* times, const double* q, const double* v, double* powers) = 0;
  /// T, and T + U  (lanes)  [J].
  virtual void energies(const double* times, const double* q, const double* v, double* kinetic, double* total) = 0;
};

}  // namespace pendula
