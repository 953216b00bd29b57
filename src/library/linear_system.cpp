#include <pendula/numeric/linear_system.hpp>

namespace pendula {

template class LinearSystem<Eigen::Dynamic>;

}  // namespace pendula
