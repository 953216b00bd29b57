// support/chain_tangents.hpp in space.

#include "support/chain_tangents.hpp"

namespace pendula::test {

INSTANTIATE_TYPED_TEST_SUITE_P(Spatial, ChainTangents, TangentCases<Spatial>, CaseName);

}  // namespace pendula::test
