#pragma once

namespace pendula {

/// A sum carried as value + compensation, so that many small steps lose nothing to rounding (Kahan–Neumaier).
/// T is a number, or an Eigen vector: every component is its own sum.
template <class T>
struct Compensated {
  T value;
  T compensation;  ///< what value is short of, below its last bit

  void assign(const T& exact) {
    value = exact;
    compensation = exact;
    compensation -= exact;  // zero of the same size
  }

  /// Adds an increment; what does not fit into value goes into the compensation.
  void add(const T& increment) {
    const T wanted = compensation + increment;
    const T sum = value + wanted;
    const T kept = sum - value;
    compensation = (value - (sum - kept)) + (wanted - kept);
    value = sum;
  }
};

}  // namespace pendula
