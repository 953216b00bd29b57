// support/chain_tangents.hpp in the plane.

#include "support/chain_tangents.hpp"

namespace pendula::test {

INSTANTIATE_TYPED_TEST_SUITE_P(Planar, ChainTangents, TangentCases<Planar>, CaseName);

}  // namespace pendula::test
