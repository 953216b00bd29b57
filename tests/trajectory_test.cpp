#include "io/trajectory.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <pendula/chain/state.hpp>
#include <pendula/run/chain_subject.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "io/errors.hpp"

namespace pendula::io {
namespace {

/// A file name of its own for each test, gone when the test is over.
class ScratchFile {
 public:
  ScratchFile()
      : path_(std::filesystem::temp_directory_path() /
              (std::string("pendula_") + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" +
               std::to_string(std::random_device()()) + ".csv")) {}
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  ~ScratchFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }

  const std::filesystem::path& path() const { return path_; }

  std::vector<std::string> lines() const {
    std::ifstream stream(path_);
    std::vector<std::string> lines;
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
  }

 private:
  std::filesystem::path path_;
};

std::vector<double> numbers_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<double> numbers;
  for (std::string cell; std::getline(stream, cell, ',');) numbers.push_back(std::strtod(cell.c_str(), nullptr));
  return numbers;
}

State<Spatial> spatial_state() {
  State<Spatial> state;
  state.time = 0.1;
  state.q = Eigen::Vector4d(1, 2, 3, 4);  // θ_1 θ_2 φ_1 φ_2
  state.v = Eigen::Vector4d(5, 6, 7, 8);
  return state;
}

template <class Space>
ChainSubject<Space> subject_of(int links) {
  ChainParameters<Space> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(links);
  return ChainSubject<Space>(Chain<Space>(parameters));
}

template <class Space>
std::string header(int links) {
  std::string text;
  append_header(text, subject_of<Space>(links).columns());
  return text;
}

/// A row of two links in space that ends in `energy`.
std::vector<double> row_of(double energy) {
  std::vector<double> row(15, 1.0 / 3);
  row.push_back(energy);
  return row;
}

TEST(Trajectory, HeaderNamesEveryColumn) {
  EXPECT_EQ(header<Planar>(2), "t,theta_1,theta_dot_1,theta_2,theta_dot_2,x_1,y_1,x_2,y_2,energy\n");
  EXPECT_EQ(header<Spatial>(2),
            "t,theta_1,phi_1,theta_dot_1,phi_dot_1,theta_2,phi_2,theta_dot_2,phi_dot_2,"
            "x_1,y_1,z_1,x_2,y_2,z_2,energy\n");
}

TEST(Trajectory, RowsFollowTheHeader) {
  const Observation seen{Eigen::VectorXd::LinSpaced(6, 9, 14), 0, 15};
  std::vector<double> row;
  subject_of<Spatial>(2).append_row(spatial_state(), seen, row);
  std::string text;
  append_row(text, row);
  EXPECT_EQ(text, "0.10000000000000001,1,3,5,7,2,4,6,8,9,10,11,12,13,14,15\n");
}

TEST(Trajectory, EveryDoubleIsReadBackAsItIs) {
  const std::vector<double> values = {1.0 / 3, -1e-300, 4.9e-324, 1.7976931348623157e308, -0.0, 2.0 / 7 * 1e17};
  for (const double value : values) {
    std::string text;
    append_row(text, std::vector<double>(6, value));
    const std::vector<double> read = numbers_of(text);
    ASSERT_EQ(read.size(), 6u);
    for (const double number : read) {
      EXPECT_EQ(number, value);
      EXPECT_EQ(std::signbit(number), std::signbit(value));
    }
  }
}

TEST(Trajectory, FileHoldsHeaderAndRows) {
  const ScratchFile scratch;
  TrajectoryFile file(scratch.path(), subject_of<Spatial>(2).columns());
  for (int i = 0; i < 3; ++i) file.write(row_of(i));
  file.finish();
  EXPECT_EQ(file.rows(), 3);
  const std::vector<std::string> lines = scratch.lines();
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_EQ(lines[0] + "\n", header<Spatial>(2));
  EXPECT_EQ(numbers_of(lines[3]).back(), 2);
}

TEST(Trajectory, ManyRowsGoThroughManyBlocks) {
  const ScratchFile scratch;
  TrajectoryFile file(scratch.path(), subject_of<Spatial>(2).columns());
  for (int i = 0; i < 5000; ++i) file.write(row_of(i));
  file.finish();
  const std::vector<std::string> lines = scratch.lines();
  ASSERT_EQ(lines.size(), 5001u);
  for (int i = 0; i < 5000; ++i) ASSERT_EQ(numbers_of(lines[static_cast<std::size_t>(i) + 1]).back(), i);
}

TEST(Trajectory, RowsSurviveAnExceptionThatEndsTheRun) {
  const ScratchFile scratch;
  try {
    TrajectoryFile file(scratch.path(), subject_of<Spatial>(2).columns());
    file.write(row_of(0));
    throw std::runtime_error("a run that fails");
  } catch (const std::runtime_error&) {
    EXPECT_EQ(scratch.lines().size(), 2u);
  }
}

TEST(Trajectory, AFileThatCannotBeOpenedIsAnInputError) {
  try {
    TrajectoryFile("no/such/folder/out.csv", subject_of<Planar>(1).columns());
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "no/such/folder/out.csv: expected a file that can be written, got: no/such/folder/ does not exist");
  }
}

#ifdef __linux__
TEST(Trajectory, AFullDiskIsAnOutputError) {
  const auto fill = [&](int rows) {
    TrajectoryFile file("/dev/full", subject_of<Planar>(1).columns());
    for (int i = 0; i < rows; ++i) file.write(std::vector<double>(6, 0.0));
    file.finish();
  };
  EXPECT_THROW(fill(0), OutputError);       // seen when closing
  EXPECT_THROW(fill(100000), OutputError);  // seen on the way
}
#endif

}  // namespace
}  // namespace pendula::io
