#include "io/summary.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/run_record.hpp>
#include <set>
#include <string>
#include <vector>

namespace pendula::io {
namespace {

using nlohmann::json;

template <class Space>
Chain<Space> chain_of_two(double gravity) {
  ChainParameters<Space> parameters;
  parameters.masses = Eigen::Vector2d(1, 2);
  parameters.lengths = Eigen::Vector2d(0.5, 1.5);
  parameters.gravity = gravity;
  return Chain<Space>(parameters);
}

Chain<Spatial> spatial_chain() {
  return chain_of_two<Spatial>(9.81);
}

Chain<Planar> planar_chain(double gravity) {
  return chain_of_two<Planar>(gravity);
}

State<Spatial> spatial_state() {
  State<Spatial> state;
  state.time = 1.0 / 3;
  state.q = Eigen::Vector4d(0.1, 0.2, 0.3, 0.4);
  state.v = Eigen::Vector4d(1, 2, 3, 4);
  return state;
}

/// A run as it could have been.
Summary summary_of_a_run() {
  const Chain<Spatial> chain = spatial_chain();
  Summary summary;
  summary.model = model_summary("run.toml", chain, std::nullopt);
  summary.description = {"dense", "newton", "spatial_2"};
  summary.asked.duration = 10;
  summary.asked.every = 5;
  summary.statistics = {1000, 2, 3000};
  summary.stepping_seconds = 0.25;
  summary.energy_error = {-1.5, 100, 1e-12};
  summary.energy_final = -1.25;
  summary.shown = {"x_2", "y_2", "z_2"};
  summary.final = snapshot(chain, spatial_state());
  summary.rows = 201;
  return summary;
}

TEST(Summary, JsonHasTheKeysOfTheInterface) {
  const json read = json::parse(to_json(summary_of_a_run()));
  EXPECT_EQ(read.at("space"), "spatial");
  EXPECT_EQ(read.at("links"), 2);
  EXPECT_EQ(read.at("method"), "gauss");
  EXPECT_EQ(read.at("stages"), 2);
  EXPECT_EQ(read.at("form"), "momentum");
  EXPECT_EQ(read.at("solver"), "dense");
  EXPECT_EQ(read.at("iteration"), "newton");
  EXPECT_EQ(read.at("kernel"), "spatial_2");
  EXPECT_EQ(read.at("step"), 1e-3);
  EXPECT_EQ(read.at("duration"), 10);
  EXPECT_EQ(read.at("steps"), 1000);
  EXPECT_EQ(read.at("rejected_steps"), 2);
  EXPECT_EQ(read.at("newton_iterations"), 3000);
  EXPECT_EQ(read.at("energy_initial"), -1.5);
  EXPECT_EQ(read.at("energy_final"), -1.25);
  EXPECT_EQ(read.at("energy_error_max"), 1e-12);
  EXPECT_EQ(read.at("wall_seconds"), 0.25);
  EXPECT_EQ(read.at("outcome"), json({{"status", "ok"}}));
  EXPECT_EQ(read.at("tolerance"), nullptr);
  EXPECT_EQ(read.at("natural_units"), nullptr);
  EXPECT_EQ(read.at("trajectory"), nullptr);
}

TEST(Summary, JsonHoldsTheFinalStateToTheLastBit) {
  const json final = json::parse(to_json(summary_of_a_run())).at("final");
  const State<Spatial> state = spatial_state();
  EXPECT_EQ(final.at("t"), state.time);
  EXPECT_EQ(final.at("theta"), json({0.1, 0.2}));
  EXPECT_EQ(final.at("phi"), json({0.3, 0.4}));
  EXPECT_EQ(final.at("theta_dot"), json({1.0, 2.0}));
  EXPECT_EQ(final.at("phi_dot"), json({3.0, 4.0}));
  const auto bobs = bob_positions(spatial_chain(), state);
  const auto velocities = bob_velocities(spatial_chain(), state);
  for (int i = 0; i < 2; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(final.at("bobs").at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(axis)), bobs(axis, i));
      EXPECT_EQ(final.at("velocities").at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(axis)),
                velocities(axis, i));
    }
  }
}

TEST(Summary, PlanarStatesHaveNoPhi) {
  Summary summary = summary_of_a_run();
  const Chain<Planar> chain = planar_chain(9.81);
  summary.final = snapshot(chain, State<Planar>::from_angles(Eigen::Vector2d(0.1, 0.2)));
  const json final = json::parse(to_json(summary)).at("final");
  std::set<std::string> keys;
  for (const auto& [key, value] : final.items()) keys.insert(key);
  EXPECT_EQ(keys, (std::set<std::string>{"t", "q", "v", "points", "theta", "theta_dot", "bobs", "velocities"}));
  EXPECT_EQ(final.at("q"), json({{"theta_1", final.at("theta").at(0)}, {"theta_2", final.at("theta").at(1)}}));
  EXPECT_EQ(final.at("points").at("bob_2"), final.at("bobs").at(1));
  EXPECT_EQ(final.at("bobs").at(0).size(), 2u);
}

TEST(Summary, WhatDoesNotApplyIsNull) {
  Summary summary = summary_of_a_run();
  summary.options.method = Method::dopri5;
  summary.description = {"", "", ""};
  const json read = json::parse(to_json(summary));
  for (const char* key : {"stages", "form", "solver", "iteration", "kernel", "step"}) {
    EXPECT_EQ(read.at(key), nullptr) << key;
  }
  EXPECT_EQ(read.at("tolerance"), 1e-9);
}

TEST(Summary, NumbersThatAreNotFiniteAreNull) {
  Summary summary = summary_of_a_run();
  summary.energy_error.largest = std::numeric_limits<double>::quiet_NaN();
  summary.final.theta[0] = std::numeric_limits<double>::infinity();
  const json read = json::parse(to_json(summary));
  EXPECT_EQ(read.at("energy_error_max"), nullptr);
  EXPECT_EQ(read.at("final").at("theta").at(0), nullptr);
}

TEST(Summary, RowsAreThoseInTheFile) {
  Summary summary = summary_of_a_run();
  EXPECT_EQ(json::parse(to_json(summary)).at("rows"), 201);
  summary.trajectory = "out.csv";
  summary.rows_written = 150;  // the disk is full
  EXPECT_EQ(json::parse(to_json(summary)).at("rows"), 150);
  EXPECT_NE(to_text(summary).find("over 201 rows"), std::string::npos);
  EXPECT_NE(to_text(summary).find("out.csv, 150 rows"), std::string::npos);
}

TEST(Summary, EnergiesThatAreNotKnownAreADash) {
  Summary summary = summary_of_a_run();
  summary.energy_error = {};
  summary.energy_final = -std::numeric_limits<double>::quiet_NaN();
  const std::string text = to_text(summary);
  EXPECT_NE(text.find("energy at start    - J\nenergy at end      - J\n"), std::string::npos) << text;
}

TEST(Summary, AFailedStepIsToldInFull) {
  Summary summary = summary_of_a_run();
  RunReport report;
  report.end = RunEnd::step_failed;
  report.step = {Status::not_converged, 0.5, 0.25, 50, 1e-3, 1};
  summary.ending = ending_of(report);
  const json outcome = json::parse(to_json(summary)).at("outcome");
  EXPECT_EQ(outcome.at("status"), "not_converged");
  EXPECT_EQ(outcome.at("t"), 0.5);
  EXPECT_EQ(outcome.at("step"), 0.25);
  EXPECT_EQ(outcome.at("iterations"), 50);
  EXPECT_EQ(outcome.at("residual"), 1e-3);
  EXPECT_EQ(outcome.at("link"), 2);  // counted from 1
  EXPECT_FALSE(outcome.at("message").get<std::string>().empty());
  EXPECT_NE(to_text(summary).find("ended early"), std::string::npos);
}

TEST(Summary, WarningsAreSentencesInAnArray) {
  Summary summary = summary_of_a_run();
  EXPECT_EQ(json::parse(to_json(summary)).at("warnings"), json::array());
  summary.warnings = {"The energy went \"up\".", "So did the step."};
  EXPECT_EQ(json::parse(to_json(summary)).at("warnings"), json({"The energy went \"up\".", "So did the step."}));
}

TEST(Summary, NamesThatAreNoUtf8DoNotBreakTheJson) {
  Summary summary = summary_of_a_run();
  summary.model.scenario = "\xff.toml";
  EXPECT_TRUE(json::accept(to_json(summary)));
}

TEST(Summary, NaturalUnitsAreTold) {
  Summary summary = summary_of_a_run();
  summary.model.natural = NaturalUnits{0.5, 3, 0.25};
  const json read = json::parse(to_json(summary));
  EXPECT_EQ(read.at("units"), "natural");
  EXPECT_EQ(read.at("natural_units"), json({{"length", 0.5}, {"mass", 3.0}, {"time", 0.25}}));
  EXPECT_NE(to_text(summary).find("M_1 g l_1"), std::string::npos);
}

// The record of the rows.

template <class Space>
void add(RunRecord& record, const Chain<Space>& chain, State<Space> state, double time, double energy) {
  const ChainSubject<Space> subject(chain);
  state.time = time;
  Observation seen = subject.observe(state);
  seen.kinetic = 0;
  seen.energy = energy;
  std::vector<double> row;
  subject.append_row(state, seen, row);
  record.add(state, seen, row, 0);
}

template <class Space>
RunRecord record_of(const Chain<Space>& chain, double duration) {
  return RunRecord(ChainSubject<Space>(chain), Motion(0, Eigen::VectorXd::Zero(Space::dof * chain.links()), {}),
                   duration);
}

TEST(RunRecord, EnergyErrorsAreRelativeToTheScaleOfTheChain) {
  const Chain<Planar> chain = planar_chain(10);
  const State<Planar> state = State<Planar>::from_angles(Eigen::Vector2d(0.1, 0.2));
  RunRecord record = record_of(chain, 1);
  for (const double energy : {5.0, 5.5, 4.0, 5.25}) add(record, chain, state, 0, energy);
  const double scale = 10 * (3 * 0.5 + 2 * 1.5);  // Σ M_i g l_i
  EXPECT_EQ(record.energy_error().initial, 5);
  EXPECT_DOUBLE_EQ(record.energy_error().largest, 1 / scale);
  EXPECT_EQ(record.energy(), 5.25);
  EXPECT_EQ(record.rows(), 4);
}

TEST(RunRecord, EnergyErrorsWithoutGravityAreRelativeToTheEnergy) {
  const Chain<Planar> chain = planar_chain(0);
  const State<Planar> state = State<Planar>::from_angles(Eigen::Vector2d(0.1, 0.2));
  RunRecord moving = record_of(chain, 1);
  for (const double energy : {-5.0, -5.5}) add(moving, chain, state, 0, energy);
  EXPECT_DOUBLE_EQ(moving.energy_error().largest, 0.1);
  RunRecord at_rest = record_of(chain, 1);
  for (const double energy : {0.0, 0.0}) add(at_rest, chain, state, 0, energy);
  EXPECT_EQ(at_rest.energy_error().largest, 0);
  for (const double energy : {1.0, 0.0}) add(at_rest, chain, state, 0, energy);
  EXPECT_TRUE(std::isnan(at_rest.energy_error().largest));
}

TEST(RunRecord, AnEnergyThatIsNotFiniteIsNotHidden) {
  const Chain<Planar> chain = planar_chain(10);
  const State<Planar> state = State<Planar>::from_angles(Eigen::Vector2d(0.1, 0.2));
  RunRecord record = record_of(chain, 1);
  for (const double energy : {5.0, std::numeric_limits<double>::quiet_NaN(), 5.0}) add(record, chain, state, 0, energy);
  EXPECT_TRUE(std::isnan(record.energy_error().largest));
}

TEST(RunRecord, TheTableIsThinAndEndsInTheLastRow) {
  const Chain<Spatial> chain = spatial_chain();
  RunRecord record = record_of(chain, 10);
  for (int i = 0; i <= 1000; ++i) add(record, chain, spatial_state(), 0.01 * i, 0);
  const std::vector<TableRow> table = record.table();
  ASSERT_EQ(table.size(), 11u);
  for (int i = 0; i <= 10; ++i) EXPECT_DOUBLE_EQ(table[static_cast<std::size_t>(i)].time, i);
  add(record, chain, spatial_state(), 10.5, 0);
  EXPECT_EQ(record.table().back().time, 10.5);
}

TEST(RunRecord, TheTableHasRoundTimesWhereThereAreRows) {
  EXPECT_EQ(table_interval(10, 0.01), 1);
  EXPECT_EQ(table_interval(7, 0.1), 0.5);
  EXPECT_EQ(table_interval(25, 0.5), 2.5);
  EXPECT_EQ(table_interval(20, 0.8), 5 * 0.8);  // there are none at multiples of 2
  EXPECT_EQ(table_interval(3.6, 0.3), 0.3);
  EXPECT_EQ(table_interval(3, 1), 1);
  EXPECT_EQ(table_interval(10.05, 0.05), 1);
  EXPECT_EQ(table_interval(0.777, 0), 0.777 / 10);  // it is not known where there are any
  EXPECT_EQ(table_interval(0, 0.1), 0);
}

TEST(RunRecord, ARunWithoutDurationHasOneTableRow) {
  const Chain<Spatial> chain = spatial_chain();
  RunRecord record = record_of(chain, 0);
  EXPECT_TRUE(record.table().empty());
  add(record, chain, spatial_state(), 0, 0);
  EXPECT_EQ(record.table().size(), 1u);
}

}  // namespace
}  // namespace pendula::io
