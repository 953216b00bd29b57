#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <new>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/state.hpp>

namespace pendula {
namespace {

ChainParameters<Planar> two_links() {
  ChainParameters<Planar> parameters;
  parameters.masses = Eigen::Vector2d(1, 2);
  parameters.lengths = Eigen::Vector2d(1, 0.5);
  return parameters;
}

std::string error_of(const ChainParameters<Planar>& parameters) {
  try {
    const Chain<Planar> chain(parameters);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no error";
}

TEST(Chain, SumsTheMassBelowEachRod) {
  const Chain<Planar> chain(two_links());
  EXPECT_EQ(chain.links(), 2);
  EXPECT_EQ(chain.mass_below()[0], 3);
  EXPECT_EQ(chain.mass_below()[1], 2);
  EXPECT_FALSE(chain.loaded());
  EXPECT_FALSE(chain.driven());
}

TEST(Chain, AddsDrivesToTheConstantTorque) {
  auto parameters = two_links();
  parameters.torque = Eigen::RowVector2d(0.5, -1);
  parameters.drives.push_back({1, Eigen::Matrix<double, 1, 1>(2.0), 3.0, 0.4});
  const Chain<Planar> chain(parameters);
  Torque<Planar, 2> torque;
  chain.torque(0.7, torque);
  EXPECT_EQ(torque(0, 0), 0.5);
  EXPECT_NEAR(torque(0, 1), -1 + 2 * std::sin(3 * 0.7 + 0.4), 3e-15);  // measured 7e-16
  EXPECT_TRUE(chain.loaded());
  EXPECT_TRUE(chain.driven());
}

TEST(Chain, NamesWhatIsWrong) {
  auto parameters = two_links();
  parameters.masses[1] = -1;
  EXPECT_EQ(error_of(parameters), "chain: masses of link 2: expected a positive finite number, got -1.000000");
  parameters = two_links();
  parameters.lengths = Eigen::Vector3d::Ones();
  EXPECT_EQ(error_of(parameters), "chain: lengths: expected one entry for each of the 2 links, got 3");
  parameters = two_links();
  parameters.gravity = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(error_of(parameters), "chain: gravity: expected a finite number");
  parameters = two_links();
  parameters.damping = Eigen::Vector2d(0, -0.1);
  EXPECT_EQ(error_of(parameters), "chain: damping of link 2: expected a finite number, not negative, got -0.100000");
  parameters = two_links();
  parameters.drives.push_back({2, Eigen::Matrix<double, 1, 1>(2.0), 3.0, 0.4});
  EXPECT_EQ(error_of(parameters), "chain: drive: expected a link from 1 to 2, got 3");
  EXPECT_EQ(error_of({}), "chain: masses: expected at least one link, got none");
}

TEST(Chain, OfAFixedSizeHasNoLoadsWhereNothingIsSaidOfThem) {
  using Parameters = ChainParameters<Spatial, 2>;
  alignas(Parameters) std::array<unsigned char, sizeof(Parameters)> memory;
  memory.fill(0xff);  // what was there before
  auto* const parameters = new (memory.data()) Parameters;
  parameters->masses = parameters->lengths = Eigen::Vector2d(1, 2);
  EXPECT_FALSE((Chain<Spatial, 2>(*parameters).loaded()));
  parameters->~Parameters();
}

TEST(Chain, IsOneTemplateForFixedAndRunTimeSize) {
  ChainParameters<Spatial, 3> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector3d::Ones();
  parameters.damping.setZero();
  parameters.torque.setZero();
  const Chain<Spatial, 3> chain(parameters);
  EXPECT_EQ(chain.mass_below()[0], 3);
}

TEST(State, PutsThetaBeforePhi) {
  const auto state = State<Spatial>::from_angles(Eigen::Vector2d(1, 2), Eigen::Vector2d(3, 4));
  EXPECT_EQ(state.q, Eigen::Vector4d(1, 2, 3, 4));
  EXPECT_EQ(state.v, Eigen::Vector4d::Zero());
  EXPECT_EQ(Eigen::Vector2d(state.phi()), Eigen::Vector2d(3, 4));
  EXPECT_THROW(State<Spatial>::from_angles(Eigen::Vector2d(1, 2), Eigen::Vector3d(3, 4, 5)), std::invalid_argument);
  EXPECT_THROW(State<Planar>::from_angles(Eigen::Vector2d(1, 2), Eigen::Vector3d(3, 4, 5)), std::invalid_argument);
}

}  // namespace
}  // namespace pendula
