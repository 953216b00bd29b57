#pragma once

#include <Eigen/Core>
#include <pendula/numeric/linear_system.hpp>

namespace pendula::detail {

/// The linear system of one Newton iteration: one block row and column a stage.
template <int Block>
class StageSystem : public LinearSystem {
 public:
  explicit StageSystem(int stages) : LinearSystem(Block * stages) {}

  auto block(int i, int j) { return matrix.block<Block, Block>(Block * i, Block * j); }
  auto residual(int i) { return right.segment<Block>(Block * i); }
  auto correction(int i) const { return solution.segment<Block>(Block * i); }
};

}  // namespace pendula::detail
