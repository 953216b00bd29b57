#pragma once

namespace pendula {

/// What the stages of members' steps are predicted from: whether the last step was accepted, was solved only, or never
/// was.
template <class L>
struct LanePrediction {
  typename L::Mask follows, again, cold;
  L depth;  ///< how many steps of this size a step follows
};

}  // namespace pendula
