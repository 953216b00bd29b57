#pragma once

#include <Eigen/Core>
#include <pendula/numeric/linear_system.hpp>

namespace pendula::detail {

/// The linear system of one Newton iteration: one block row and column a stage.
template <int Block, int S>
class StageSystem : public LinearSystem<S == Eigen::Dynamic ? Eigen::Dynamic : Block * S> {
  using Base = LinearSystem<S == Eigen::Dynamic ? Eigen::Dynamic : Block * S>;

 public:
  explicit StageSystem(int stages) : Base(Block * stages) {}

  auto block(int i, int j) { return this->matrix.template block<Block, Block>(Block * i, Block * j); }
  auto residual(int i) { return this->right.template segment<Block>(Block * i); }
  auto correction(int i) const { return this->solution.template segment<Block>(Block * i); }
};

}  // namespace pendula::detail
