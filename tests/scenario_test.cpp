#include "io/scenario.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/momenta.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "io/scenario_keys.hpp"

namespace pendula::io {
namespace {

using Overrides = std::vector<std::string>;

const std::string planar_text = R"([chain]
space   = "planar"
masses  = [1.0, 2.0]
lengths = 1

[start]
theta = [0.5, -0.25]
)";

const std::string spatial_text = R"([chain]
space   = "spatial"
links   = 3
masses  = [1.0, 0.5, 2.0]
lengths = 1.5
gravity = 9.8
damping = [0.0, 0.1, 0.2]
torque  = [0.0, 0.0, 0.3]
units   = "SI"

[[chain.drive]]
link = 2
amplitude = [1.0, 0, 2.0]
frequency = 3
phase = 0.4

[start]
theta     = [1.0, 0.5, 0.2]
phi       = 0.25
theta_dot = 1
phi_dot   = [1, 2, 3]

[run]
method    = "gauss"
stages    = 4
form      = "velocity"
solver    = "dense"
iteration = "newton"
step      = 1e-2
duration  = 5

[output]
every = 3
)";

template <class Space>
Scenario<Space> parsed(const std::string& text, const Overrides& overrides = {}) {
  return std::get<Scenario<Space>>(parse_scenario(text, "file.toml", overrides));
}

/// The message that a scenario is turned away with.
std::string error_of(const std::string& text, const Overrides& overrides = {}) {
  try {
    parse_scenario(text, "file.toml", overrides);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

/// `text` with the first `from` replaced.
std::string edited(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

Eigen::VectorXd numbers(std::initializer_list<double> values) {
  return Eigen::Map<const Eigen::VectorXd>(values.begin(), static_cast<Eigen::Index>(values.size()));
}

TEST(Scenario, DefaultsAreThoseOfTheReference) {
  const auto scenario = parsed<Planar>(planar_text);
  EXPECT_EQ(scenario.chain.links(), 2);
  EXPECT_EQ(scenario.chain.masses(), numbers({1, 2}));
  EXPECT_EQ(scenario.chain.lengths(), numbers({1, 1}));  // a number means every link
  EXPECT_EQ(scenario.chain.gravity(), 9.81);
  EXPECT_FALSE(scenario.chain.loaded());
  EXPECT_EQ(scenario.start.q, numbers({0.5, -0.25}));
  EXPECT_EQ(scenario.start.v, numbers({0, 0}));
  EXPECT_EQ(scenario.start.time, 0);
  EXPECT_EQ(scenario.options.method, Method::gauss);
  EXPECT_EQ(scenario.options.stages, 8);
  EXPECT_EQ(scenario.options.form, Form::momentum);
  EXPECT_EQ(scenario.options.solver, Solver::automatic);
  EXPECT_EQ(scenario.options.iteration, Iteration::automatic);
  EXPECT_EQ(scenario.options.step, 0);
  EXPECT_EQ(scenario.options.tolerance, 1e-9);
  EXPECT_EQ(scenario.duration, 10);
  EXPECT_TRUE(scenario.rows.chosen);
  EXPECT_EQ(scenario.rows.interval, 0.01);
  EXPECT_FALSE(scenario.natural);
  EXPECT_TRUE(scenario.warnings.empty());
}

TEST(Scenario, EveryKeyIsRead) {
  const auto scenario = parsed<Spatial>(spatial_text);
  EXPECT_EQ(scenario.chain.links(), 3);
  EXPECT_EQ(scenario.chain.masses(), numbers({1, 0.5, 2}));
  EXPECT_EQ(scenario.chain.lengths(), numbers({1.5, 1.5, 1.5}));
  EXPECT_EQ(scenario.chain.gravity(), 9.8);
  EXPECT_EQ(scenario.chain.damping(), numbers({0, 0.1, 0.2}));
  EXPECT_EQ(scenario.chain.constant_torque(), Eigen::Vector3d(0, 0, 0.3).replicate(1, 3));
  ASSERT_EQ(scenario.chain.drives().size(), 1u);
  const Drive<Spatial>& drive = scenario.chain.drives()[0];
  EXPECT_EQ(drive.link, 1);
  EXPECT_EQ(drive.amplitude, Eigen::Vector3d(1, 0, 2));
  EXPECT_EQ(drive.frequency, 3);
  EXPECT_EQ(drive.phase, 0.4);
  EXPECT_EQ(scenario.start.theta(), numbers({1, 0.5, 0.2}));
  EXPECT_EQ(scenario.start.phi(), numbers({0.25, 0.25, 0.25}));
  EXPECT_EQ(scenario.start.theta_dot(), numbers({1, 1, 1}));
  EXPECT_EQ(scenario.start.phi_dot(), numbers({1, 2, 3}));
  EXPECT_EQ(scenario.options.stages, 4);
  EXPECT_EQ(scenario.options.form, Form::velocity);
  EXPECT_EQ(scenario.options.solver, Solver::dense);
  EXPECT_EQ(scenario.options.iteration, Iteration::newton);
  EXPECT_EQ(scenario.options.step, 1e-2);
  EXPECT_EQ(scenario.duration, 5);
  EXPECT_EQ(scenario.every, 3);
}

TEST(Scenario, NamesOfSettingsMeanTheirEnumerators) {
  const auto run = [](const std::string& setting) { return parsed<Planar>(planar_text, {"run." + setting}).options; };
  EXPECT_EQ(run("method=rk4").method, Method::rk4);
  EXPECT_EQ(run("method=dopri5").method, Method::dopri5);
  EXPECT_EQ(run("method=fehlberg78").method, Method::fehlberg78);
  EXPECT_EQ(run("method=taylor").method, Method::taylor);
  EXPECT_EQ(run("form=momentum").form, Form::momentum);
  EXPECT_EQ(run("solver=auto").solver, Solver::automatic);
  EXPECT_EQ(run("solver=chain").solver, Solver::chain);
  EXPECT_EQ(run("iteration=auto").iteration, Iteration::automatic);
  EXPECT_EQ(run("iteration=fixed-point").iteration, Iteration::fixed_point);
}

TEST(Scenario, DefaultsAreThoseOfTheTableOfKeys) {
  const auto without = parsed<Spatial>(edited(planar_text, "planar", "spatial"));
  int tried = 0;
  for (const ScenarioTable& table : scenario_tables()) {
    if (!std::set<std::string_view>{"chain", "start", "run", "output"}.contains(table.name)) continue;
    for (const ScenarioKey& key : table.keys) {
      if (key.otherwise.index() < 2 || key.name == "tolerance") continue;  // no value; which asks for no accuracy
      const std::string change = std::string(table.name) + "." + std::string(key.name) + "=" + default_text(key);
      const auto with = parsed<Spatial>(edited(planar_text, "planar", "spatial"), {change});
      EXPECT_EQ(with.chain.gravity(), without.chain.gravity()) << change;
      EXPECT_EQ(with.chain.damping(), without.chain.damping()) << change;
      EXPECT_EQ(with.chain.constant_torque(), without.chain.constant_torque()) << change;
      EXPECT_EQ(with.natural.has_value(), without.natural.has_value()) << change;
      EXPECT_EQ(with.start.q, without.start.q) << change;
      EXPECT_EQ(with.start.v, without.start.v) << change;
      EXPECT_EQ(with.options.method, without.options.method) << change;
      EXPECT_EQ(with.options.form, without.options.form) << change;
      EXPECT_EQ(with.options.solver, without.options.solver) << change;
      EXPECT_EQ(with.options.iteration, without.options.iteration) << change;
      EXPECT_EQ(with.duration, without.duration) << change;
      EXPECT_EQ(with.estimate, without.estimate) << change;
      EXPECT_EQ(with.checkpoint, without.checkpoint) << change;
      ++tried;
    }
  }
  EXPECT_EQ(tried, 15);
  EXPECT_EQ(without.chain.gravity(), ChainParameters<Planar>{}.gravity);
  EXPECT_EQ(without.options.tolerance, std::get<double>(find_key("run.tolerance")->otherwise));
}

TEST(Scenario, KeysAreFoundByTheirNames) {
  std::set<std::string_view> names;
  for (const std::string_view name : all_keys()) {
    EXPECT_TRUE(names.insert(name).second) << name;
    ASSERT_NE(find_key(name), nullptr) << name;
    EXPECT_TRUE(name.ends_with(find_key(name)->name)) << name;
    EXPECT_FALSE(find_key(name)->hint.empty()) << name;
  }
  EXPECT_EQ(find_key("chain.drive[2].amplitude"), find_key("chain.drive.amplitude"));
  EXPECT_EQ(find_key("chain.torque[2][3]")->unit, "N m");
  for (const std::string_view none : {"chain.", "chain.mass", "chain.masses.first", "drive.link", "", "."}) {
    EXPECT_EQ(find_key(none), nullptr) << none;
  }
}

TEST(Scenario, AnyArrayTellsTheNumberOfLinks) {
  const std::string text = "[chain]\nspace = \"spatial\"\nmasses = 1\nlengths = 1\n[start]\ntheta = 1\n";
  for (const std::string key : {"chain.masses", "chain.lengths", "chain.damping", "start.theta", "start.phi",
                                "start.theta_dot", "start.phi_dot", "start.p_theta", "start.p_phi"}) {
    EXPECT_EQ(parsed<Spatial>(text, {key + "=[1, 2, 3, 4]"}).chain.links(), 4) << key;
  }
  EXPECT_EQ(parsed<Spatial>(text, {"chain.torque=[[0, 0, 1], [0, 1, 0]]"}).chain.links(), 2);
  EXPECT_EQ(parsed<Spatial>(text, {"chain.links=5"}).chain.links(), 5);
  EXPECT_EQ(parsed<Planar>(text, {"chain.space=planar", "chain.torque=[1, 2, 3]"}).chain.links(), 3);
  EXPECT_EQ(error_of(text),
            "file.toml:1: chain.links: expected the number of links, where no array tells it, got no such key");
}

TEST(Scenario, TorquesAreOneALinkOrOneForAll) {
  const auto torque = [](const std::string& value) {
    return parsed<Spatial>(spatial_text, {"chain.torque=" + value}).chain.constant_torque();
  };
  EXPECT_EQ(torque("0.0"), Eigen::MatrixXd::Zero(3, 3));
  EXPECT_EQ(torque("[1, 2, 3]"), Eigen::Vector3d(1, 2, 3).replicate(1, 3));
  EXPECT_EQ(torque("[[1, 2, 3], [4, 5, 6], [7, 8, 9]]"), (Eigen::Matrix3d() << 1, 4, 7, 2, 5, 8, 3, 6, 9).finished());
  EXPECT_EQ(parsed<Planar>(planar_text, {"chain.torque=0.5"}).chain.constant_torque(), numbers({0.5, 0.5}).transpose());
  EXPECT_EQ(parsed<Planar>(planar_text, {"chain.torque=[1, 2]"}).chain.constant_torque(), numbers({1, 2}).transpose());
}

TEST(Scenario, PlanarDrivesHaveOneNumber) {
  const auto scenario =
      parsed<Planar>(planar_text +
                     "[[chain.drive]]\nlink = 1\namplitude = 2.0\nfrequency = 3.0\n[[chain.drive]]\nlink = 2\n"
                     "amplitude = 1\nfrequency = 2\nphase = 0.4\n");
  ASSERT_EQ(scenario.chain.drives().size(), 2u);
  EXPECT_EQ(scenario.chain.drives()[0].amplitude[0], 2);
  EXPECT_EQ(scenario.chain.drives()[0].phase, 0);
  EXPECT_EQ(scenario.chain.drives()[1].link, 1);
}

TEST(Scenario, OverridesReplaceWhatTheFileSays) {
  const auto scenario = parsed<Planar>(
      planar_text, {"run.step=1e-4", "run.method = rk4", "chain.masses=[3, 4]", "output.every=7", "start={theta=0.125}",
                    "chain.drive=[{link=1, amplitude=2, frequency=3}]", "run.step=2e-4"});
  EXPECT_EQ(scenario.options.step, 2e-4);  // the last one counts
  EXPECT_EQ(scenario.options.method, Method::rk4);
  EXPECT_EQ(scenario.chain.masses(), numbers({3, 4}));
  EXPECT_EQ(scenario.every, 7);
  EXPECT_EQ(scenario.start.theta(), numbers({0.125, 0.125}));
  EXPECT_EQ(scenario.chain.drives().size(), 1u);
  EXPECT_TRUE(parsed<Spatial>(spatial_text, {"chain.drive=[]"}).chain.drives().empty());
}

struct BadInput {
  std::string from, to, message;
};

TEST(Scenario, BadValuesAreToldByFileLineKeyExpectedAndGot) {
  const std::vector<BadInput> inputs = {
      // not the right tables
      {"[output]\nevery = 3", "output = 3",
       "file.toml:32: run.output: expected one of method, stages, form, solver, iteration, step, tolerance, accuracy, "
       "duration, estimate, "
       "got "
       "the unknown key \"output\""},
      {"[output]", "[outputs]",
       "file.toml:32: outputs: expected one of chain, system, start, run, output, event, ensemble, got the unknown key "
       "\"outputs\" (did you mean output?)"},
      {"[[chain.drive]]", "[chain.drive]", "file.toml:11: chain.drive: expected [[chain.drive]] tables, got a table"},
      // unknown keys, with the one that may be meant
      {"masses  =", "mases =",
       "file.toml:4: chain.mases: expected one of space, links, masses, lengths, gravity, damping, "
       "torque, units, end, drive, feedback, signal, got the unknown key \"mases\" (did you mean masses?)"},
      {"units   =", "theta =",
       "file.toml:9: chain.theta: expected one of space, links, masses, lengths, gravity, damping, "
       "torque, units, end, drive, feedback, signal, got the unknown key \"theta\" (did you mean start.theta?)"},
      {"phase = 0.4", "delay = 0.4",
       "file.toml:15: chain.drive[1].delay: expected one of link, amplitude, frequency, "
       "phase, got the unknown key \"delay\""},
      {"theta_dot =", "theta_dto =",
       "file.toml:20: start.theta_dto: expected one of shape, theta, phi, theta_dot, phi_dot, p_theta, p_phi, got "
       "the unknown key \"theta_dto\" (did you mean theta_dot?)"},
      // missing keys
      {"space   = \"spatial\"", "", "file.toml:1: chain.space: expected \"planar\" or \"spatial\", got no such key"},
      {"masses  = [1.0, 0.5, 2.0]", "", "file.toml:1: chain.masses: expected the masses of the bobs, got no such key"},
      {"lengths = 1.5", "", "file.toml:1: chain.lengths: expected the lengths of the rods, got no such key"},
      {"theta     = [1.0, 0.5, 0.2]", "",
       "file.toml:17: start.theta: expected the angles at the start, from the downward vertical, got no such key"},
      {"link = 2", "",
       "file.toml:11: chain.drive[1].link: expected the link that it acts on, 1 at the pivot, got no such key"},
      {"frequency = 3", "", "file.toml:11: chain.drive[1].frequency: expected an angular frequency, got no such key"},
      // wrong types
      {"lengths = 1.5", "lengths = \"long\"",
       "file.toml:5: chain.lengths: expected a finite number > 0 or a string in m (a length), got \"long\""},
      {"[1.0, 0.5, 2.0]", "[1.0, true, 2.0]", "file.toml:4: chain.masses[2]: expected a finite number > 0, got true"},
      {"links   = 3", "links = 3.0", "file.toml:3: chain.links: expected an integer from 1 to 1000000, got 3.0"},
      {"gravity = 9.8", "gravity = [9.8]", "file.toml:6: chain.gravity: expected a finite number, got [9.8]"},
      {"gravity = 9.8", "gravity = 1979-05-27",
       "file.toml:6: chain.gravity: expected a finite number, got a date or time"},
      {"\"spatial\"", "\"spacial\"",
       "file.toml:2: chain.space: expected \"planar\" or \"spatial\", got \"spacial\" (did "
       "you mean spatial?)"},
      {"\"spatial\"", "3", "file.toml:2: chain.space: expected \"planar\" or \"spatial\", got 3"},
      {"\"gauss\"", "\"euler\"",
       "file.toml:24: run.method: expected \"gauss\" or \"radau\" or \"rk4\" or \"dopri5\" or \"fehlberg78\" or "
       "\"taylor\" or \"auto\", got \"euler\""},
      {"\"gauss\"", "\"bulirsch-stoer\"",
       "file.toml:24: run.method: expected \"gauss\" or \"radau\" or \"rk4\" or \"dopri5\" or \"fehlberg78\" or "
       "\"taylor\" or \"auto\", got \"bulirsch-stoer\" (that is gone, take fehlberg78)"},
      {"\"SI\"", "\"imperial\"", "file.toml:9: chain.units: expected \"SI\" or \"natural\", got \"imperial\""},
      // wrong lengths
      {"masses  = [1.0, 0.5, 2.0]", "masses = [1.0, 0.5]",
       "file.toml:4: chain.masses: expected a finite number > 0 for all "
       "links, or an array of 3 (the links that chain.links tells), got [1.0, 0.5]"},
      {"phi_dot   = [1, 2, 3]", "phi_dot = []",
       "file.toml:21: start.phi_dot: expected a finite number or a string in rad/s or deg/s for all links, or an "
       "array of 3 (the links that chain.links tells), got []"},
      {"[0.0, 0.0, 0.3]", "[0.0, 0.3]", "file.toml:8: chain.torque: expected a vector [x, y, z], got [0.0, 0.3]"},
      {"[0.0, 0.0, 0.3]", "[[0, 0, 1]]",
       "file.toml:8: chain.torque: expected 0, one vector [x, y, z] for all links, or 3 "
       "of them, got [[0, 0, 1]]"},
      {"[0.0, 0.0, 0.3]", "[[0, 0, 1], [0, 0, 1], 2]",
       "file.toml:8: chain.torque[3]: expected a vector [x, y, z], got 2"},
      {"[0.0, 0.0, 0.3]", "0.3",
       "file.toml:8: chain.torque: expected 0, one vector [x, y, z] for all links, or 3 of them, "
       "got 0.3"},
      {"[1.0, 0, 2.0]", "2.0", "file.toml:13: chain.drive[1].amplitude: expected a vector [x, y, z], got 2.0"},
      // values out of range
      {"[1.0, 0.5, 2.0]", "[1.0, -0.5, 2.0]", "file.toml:4: chain.masses[2]: expected a finite number > 0, got -0.5"},
      {"[1.0, 0.5, 2.0]", "0", "file.toml:4: chain.masses: expected a finite number > 0, got 0"},
      {"lengths = 1.5", "lengths = 0.0", "file.toml:5: chain.lengths: expected a finite number > 0, got 0.0"},
      {"lengths = 1.5", "lengths = inf", "file.toml:5: chain.lengths: expected a finite number > 0, got inf"},
      {"gravity = 9.8", "gravity = nan", "file.toml:6: chain.gravity: expected a finite number, got nan"},
      {"[0.0, 0.1, 0.2]", "-0.1", "file.toml:7: chain.damping: expected a finite number >= 0, got -0.1"},
      {"[1.0, 0.5, 0.2]", "[1.0, -inf, 0.2]",
       "file.toml:18: start.theta[2]: expected a finite number or a string in rad or deg, got -inf"},
      {"link = 2", "link = 4", "file.toml:12: chain.drive[1].link: expected an integer from 1 to 3, got 4"},
      {"link = 2", "link = 0", "file.toml:12: chain.drive[1].link: expected an integer from 1 to 3, got 0"},
      {"links   = 3", "links = 0", "file.toml:3: chain.links: expected an integer from 1 to 1000000, got 0"},
      {"links   = 3", "links = 2000000000",
       "file.toml:3: chain.links: expected an integer from 1 to 1000000, got "
       "2000000000"},
      {"stages    = 4", "stages = 9", "file.toml:25: run.stages: expected an integer from 1 to 8, got 9"},
      {"stages    = 4", "stages = 0", "file.toml:25: run.stages: expected an integer from 1 to 8, got 0"},
      {"step      = 1e-2", "step = 0", "file.toml:29: run.step: expected a finite number > 0, got 0"},
      {"step      = 1e-2", "step = -1e-3", "file.toml:29: run.step: expected a finite number > 0, got -0.001"},
      {"step      = 1e-2", "step = 1e-300",
       "file.toml:29: run.step: expected a step of at least 5.555555555555556e-16 for "
       "this duration, got 1e-300"},
      {"step      = 1e-2", "tolerance = 0.0",
       "file.toml:29: run.tolerance: expected a finite number >= 1e-16, got 0.0"},
      {"duration  = 5", "duration = -5", "file.toml:30: run.duration: expected a finite number >= 0, got -5"},
      {"every = 3", "every = 0",
       "file.toml:33: output.every: expected an integer from 1 to 9223372036854775807, got 0"},
      {"every = 3", "every = 2.5",
       "file.toml:33: output.every: expected an integer from 1 to 9223372036854775807, got 2.5"},
  };
  for (const BadInput& input : inputs) {
    EXPECT_EQ(error_of(edited(spatial_text, input.from, input.to)), input.message);
  }
}

TEST(Scenario, TextThatIsNoTomlIsToldByItsLine) {
  const auto begins = [](const std::string& text, const std::string& start) {
    EXPECT_EQ(error_of(text).substr(0, start.size()), start);  // the rest is the TOML library's
  };
  begins(edited(spatial_text, "1.0, 0.5", "1.0 0.5"),
         "file.toml:4: expected valid TOML, got: Error while parsing array");
  begins(edited(spatial_text, "links   = 3", "links = 3\nlinks = 4"), "file.toml:4: expected valid TOML, got: ");
  begins(edited(spatial_text, "[start]", "[start"), "file.toml:17: expected valid TOML, got: ");
  begins("[chain]\nspace = \"\xff\"\n", "file.toml:2: expected valid TOML, got: ");
}

TEST(Scenario, NestingThatWouldExhaustTheStackIsAnError) {
  const auto repeated = [](const std::string& piece, int times) {
    std::string text;
    for (int i = 0; i < times; ++i) text += piece;
    return text;
  };
  constexpr int many = 40'000;
  const std::string message = ": expected keys and values nested at most 16 deep, got more";
  for (const std::string& text :
       {"a" + repeated(".a", many) + " = 1", "[a" + repeated(".a", many) + "]", "a = " + repeated("[", many),
        "a = " + repeated("{a=", many), "a = " + repeated("{a.a.a.a = ", many), "a" + repeated(".\"a\"", many) + " = 1",
        "a" + repeated(" . a", many) + " = 1"}) {
    EXPECT_EQ(error_of(planar_text + text), "file.toml:8" + message);
  }
  EXPECT_TRUE(error_of(planar_text, {"a" + repeated(".a", many) + "=1"}).ends_with(message));
  EXPECT_TRUE(error_of(planar_text, {"chain.drive=" + repeated("[", many)}).ends_with(message));
  EXPECT_EQ(error_of(planar_text + "a" + repeated(".a", 15) + " = 1").find("nested"), std::string::npos);
  // What stands in strings and comments is not nested.
  const std::string marks = repeated("[", 100) + repeated(".", 100);
  for (const std::string& text :
       {"# " + marks + "\nb = 1", "b = \"" + marks + "\"", "b = '" + marks + "'", "b = \"\\\"" + marks + "\"",
        "b = \"\"\"" + marks + "\n\\\"\"\"" + marks + "\"\"\"", "b = '''" + marks + "'" + marks + "'''"}) {
    EXPECT_NE(error_of(planar_text + text).find("got the unknown key \"b\""), std::string::npos) << text;
  }
}

TEST(Scenario, NumbersBeyondTheirTypeAreTold) {
  const auto with_length = [](const std::string& length) {
    return error_of(edited(planar_text, "lengths = 1", "lengths = " + length));
  };
  EXPECT_EQ(with_length("1e400"), "file.toml:4: expected a number, got 1e400, too large for a double");
  EXPECT_EQ(with_length("[1, -1_0e400]"), "file.toml:4: expected a number, got -1_0e400, too large for a double");
  EXPECT_EQ(with_length("99999999999999999999"),
            "file.toml:4: expected a number, got 99999999999999999999, too large for an integer; with a point it is a "
            "float");
  EXPECT_EQ(error_of(planar_text, {"chain.lengths=+1e400"}),
            "--set chain.lengths=+1e400: expected a number, got +1e400, too large for a double");
  // One too small for a double is rounded to zero, as any number is to the nearest double.
  EXPECT_EQ(parsed<Planar>(planar_text, {"chain.gravity=1e-400"}).chain.gravity(), 0);
}

TEST(Scenario, TextsAreShownOnOneLineAndCut) {
  const auto in_space = [](const std::string& text) {
    return error_of(edited(planar_text, "\"planar\"", "\"" + text + "\""));
  };
  const std::string expected = "file.toml:2: chain.space: expected \"planar\" or \"spatial\", got ";
  EXPECT_EQ(in_space(std::string(100, 'x')), expected + "\"" + std::string(60, 'x') + "...\"");
  EXPECT_EQ(in_space("\\u001b[2J\\n"), expected + "\"?[2J?\"");
  std::string umlauts = "a";
  for (int i = 0; i < 40; ++i) umlauts += "\u00fc";
  EXPECT_EQ(in_space(umlauts), expected + "\"" + umlauts.substr(0, 59) + "...\"");  // never half a character
  EXPECT_EQ(error_of(planar_text, {"chain.space=" + std::string(100, 'x')}).substr(0, 70),
            "--set chain.space=" + std::string(48, 'x') + "...:");
}

TEST(Scenario, AnglesAndRatesMayHaveUnits) {
  const auto start = [](const Overrides& overrides) { return parsed<Spatial>(spatial_text, overrides).start; };
  const double pi = std::numbers::pi;
  const auto angles = start({"start.theta=[\"90 deg\", \"180deg\", \"-.5 rad\"]", "start.phi=\" 30  deg \""});
  EXPECT_EQ(angles.theta(), numbers({pi / 2, pi, -0.5}));
  EXPECT_EQ(angles.phi(), numbers({pi / 6, pi / 6, pi / 6}));
  const auto rates = start({"start.theta_dot=\"+360 deg/s\"", "start.phi_dot=[1, \"1e-1 rad/s\", \"90 deg/s\"]"});
  EXPECT_EQ(rates.theta_dot(), numbers({2 * pi, 2 * pi, 2 * pi}));
  EXPECT_EQ(rates.phi_dot(), numbers({1, 0.1, pi / 2}));
  EXPECT_EQ(start({"start.theta=90 deg"}).theta(), numbers({pi / 2, pi / 2, pi / 2}));  // the shell takes the quotes
  EXPECT_EQ(parsed<Planar>(planar_text, {"start.theta=[\"45 deg\", 1]"}).start.theta(), numbers({pi / 4, 1}));
}

TEST(Scenario, TextsThatAreNoAnglesAreTold) {
  const std::string expected = ": expected a finite number or a string in rad or deg";
  for (const std::string text : {"90", "deg", "90 grad", "90 deg deg", "90 deg/s", "nan deg", "inf rad", "1e400 deg",
                                 "", "--1 deg", "+-1 deg", "9 0 deg"}) {
    const std::string override = "start.theta=[1, 2, \"" + text + "\"]";
    EXPECT_EQ(error_of(spatial_text, {override}), "--set " + override + ": start.theta[3]" + expected + ", got \"" +
                                                      text + "\"" +
                                                      (text == "90 deg/s" ? ", an angular velocity" : ""));
  }
  EXPECT_EQ(error_of(spatial_text, {"start.phi=\"1 rad/s\""}),
            "--set start.phi=\"1 rad/s\": start.phi" + expected + ", got \"1 rad/s\", an angular velocity");
  EXPECT_EQ(error_of(spatial_text, {"start.theta_dot=\"1 deg\""}),
            "--set start.theta_dot=\"1 deg\": start.theta_dot: expected a finite number or a string in rad/s or deg/s, "
            "got \"1 deg\", an angle");
}

TEST(Scenario, NumbersMayHaveUnits) {
  const auto chain =
      parsed<Planar>(planar_text, {"chain.masses=[\"100 g\", 2]", "chain.lengths=5 cm", "chain.gravity=\"981 cm/s^2\"",
                                   "chain.damping=2 mN m s/rad", "chain.torque=\"3 N cm\"", "run.duration=1 min",
                                   "start.theta_dot=10 rpm", "output.times=[\"1 ms\", \"2s\"]"});
  EXPECT_EQ(chain.chain.masses(), numbers({100 * 1e-3, 2}));
  EXPECT_EQ(chain.chain.lengths(), numbers({5 * 1e-2, 5 * 1e-2}));
  EXPECT_DOUBLE_EQ(chain.chain.gravity(), 9.81);
  EXPECT_EQ(chain.chain.damping(), numbers({2e-3, 2e-3}));
  EXPECT_DOUBLE_EQ(chain.chain.constant_torque()(0, 1), 0.03);
  EXPECT_EQ(chain.duration, 60);
  EXPECT_DOUBLE_EQ(chain.start.v[0], std::numbers::pi / 3);
  EXPECT_EQ(chain.rows.times, (std::vector<double>{1e-3, 2}));
  const auto driven = parsed<Spatial>(
      spatial_text, {"chain.drive[1].frequency=\"2 Hz\"", "chain.drive[1].amplitude=[\"1 kN m\", 0, \"2 J\"]"});
  EXPECT_DOUBLE_EQ(driven.chain.drives()[0].frequency, 4 * std::numbers::pi);
  EXPECT_EQ(driven.chain.drives()[0].amplitude, Eigen::Vector3d(1e3, 0, 2));
  for (const std::string micro : {"u", "\u00b5", "\u03bc"}) {
    const auto small = parsed<Planar>(planar_text, {"chain.lengths=5 " + micro + "m", "run.duration=5 " + micro + "s"});
    EXPECT_EQ(small.chain.lengths(), numbers({5 * 1e-6, 5 * 1e-6}));
    EXPECT_EQ(small.duration, 5 * 1e-6);
  }
}

TEST(Scenario, UnitsOfNaturalScenariosAreConverted) {
  const std::string natural =
      "[chain]\nspace=\"planar\"\nmasses=[1.0, 3.0]\nlengths=\"40 cm\"\ngravity=10\n"
      "units=\"natural\"\n[[chain.drive]]\nlink=1\namplitude=\"16 N m\"\nfrequency=\"1 rad/s\"\n"
      "[start]\ntheta=\"90 deg\"\ntheta_dot=\"1 rad/s\"\n[run]\nduration=\"2 s\"\n";
  const auto scenario = parsed<Planar>(natural);  // l_1 = 0.4 m, M_1 = 4 kg, a time of 0.2 s, an energy of 16 J
  EXPECT_DOUBLE_EQ(scenario.duration, 10);
  EXPECT_DOUBLE_EQ(scenario.start.v[0], 0.2);
  EXPECT_DOUBLE_EQ(scenario.chain.drives()[0].amplitude[0], 1);
  EXPECT_DOUBLE_EQ(scenario.chain.drives()[0].frequency, 0.2);
}

TEST(Scenario, UnitsOfAnotherKindAreTold) {
  const auto error = [](const std::string& override) { return error_of(planar_text, {override}); };
  EXPECT_EQ(error("chain.masses=5 cm"),
            "--set chain.masses=5 cm: chain.masses: expected a finite number > 0 or a string in kg (a mass), got "
            "\"5 cm\", a length");
  EXPECT_EQ(error("run.duration=\"3 apples\""),
            "--set run.duration=\"3 apples\": run.duration: expected a finite number >= 0 or a string in s (a time), "
            "got \"3 apples\"");
  EXPECT_EQ(
      error("run.step=\"-1 ms\""),
      "--set run.step=\"-1 ms\": run.step: expected a finite number > 0 or a string in s (a time), got \"-1 ms\"");
  EXPECT_EQ(error("run.tolerance=\"1 m\""),
            "--set run.tolerance=\"1 m\": run.tolerance: expected a finite number >= 1e-16, got \"1 m\", a length");
}

TEST(Scenario, MomentaStandInPlaceOfRates) {
  const auto scenario = parsed<Spatial>(edited(edited(spatial_text, "theta_dot = 1", "p_theta = [1.0, 2, -0.5]"),
                                               "phi_dot   = [1, 2, 3]", "p_phi = 0.25"));
  const Coordinates<Spatial, Eigen::Dynamic> p = momenta(scenario.chain, scenario.start);
  EXPECT_LT((p - numbers({1, 2, -0.5, 0.25, 0.25, 0.25})).cwiseAbs().maxCoeff(), 2e-14);  // measured 1.3e-15
  const auto planar = parsed<Planar>(edited(planar_text, "theta = [0.5, -0.25]", "theta = 0.0\np_theta = [6.0, 0.0]"));
  EXPECT_LT((momenta(planar.chain, planar.start) - numbers({6, 0})).cwiseAbs().maxCoeff(), 1e-14);  // measured 0
  const std::string one = "[chain]\nspace=\"spatial\"\nmasses=[2.0]\nlengths=3.0\n[start]\ntheta=\"90 deg\"\np_phi=9.0";
  EXPECT_LT((parsed<Spatial>(one).start.v - numbers({0, 0.5})).norm(), 1e-15);  // p_φ = m l² sin²θ φ̇; measured 0
}

TEST(Scenario, MomentaThatMakeNoSenseAreTold) {
  EXPECT_EQ(error_of(planar_text + "p_theta = 1\ntheta_dot = 2.0\n"),
            "file.toml:9: start.theta_dot: expected no rates beside the momenta start.p_theta, got 2.0");
  EXPECT_EQ(error_of(planar_text + "p_phi = 1\n"),
            "file.toml:8: start.p_phi: expected no such key in a planar scenario, got 1");
  EXPECT_EQ(error_of(planar_text + "p_theta = \"1 rad\"\n"),
            "file.toml:8: start.p_theta: expected a finite number or a string in N m s (an angular momentum), got "
            "\"1 rad\", an angle");
  const std::string pole = "[chain]\nspace=\"spatial\"\nmasses=[1, 1]\nlengths=1\n[start]\ntheta=[1, \"180 deg\"]\n";
  EXPECT_EQ(error_of(pole + "p_phi = 1"), "file.toml:7: start.p_phi: link 2: expected 0 where sin(theta) = 0");
  EXPECT_EQ(parsed<Spatial>(pole + "p_phi = [1, 0]\np_theta = 1").start.v[3], 0);
}

TEST(Scenario, AnglesThatLookLikeDegreesAreWarnedOf) {
  const auto warnings = [](const Overrides& overrides) { return parsed<Spatial>(spatial_text, overrides).warnings; };
  EXPECT_EQ(warnings({"start.theta=90"}),
            Overrides{"--set start.theta=90: start.theta: 90 rad is more than a turn; did you mean \"90 deg\"?"});
  EXPECT_EQ(warnings({"start.theta=[1, -45.5, 90]", "start.phi=[1, 2, 12.6]"}),
            (Overrides{"--set start.theta=[1, -45.5, 90]: start.theta[2]: -45.5 rad is more than a turn; did you "
                       "mean \"-45.5 deg\"?",
                       "--set start.phi=[1, 2, 12.6]: start.phi[3]: 12.6 rad is more than a turn; did you mean "
                       "\"12.6 deg\"?"}));
  EXPECT_TRUE(warnings({"start.theta=[6.28, \"90 deg\", \"90 rad\"]"}).empty());
  EXPECT_TRUE(warnings({"start.theta=[9.42477796076938, -56.5486677646, 0]"}).empty());  // where a run has ended
}

TEST(Scenario, PlanarChainsHaveNoPhi) {
  EXPECT_EQ(error_of(planar_text + "phi = 0.1\n"),
            "file.toml:8: start.phi: expected no such key in a planar scenario, got 0.1");
  EXPECT_EQ(error_of(planar_text + "phi_dot = [1, 2]\n"),
            "file.toml:8: start.phi_dot: expected no such key in a planar scenario, got [1, 2]");
}

TEST(Scenario, ArraysThatDisagreeNameTheOneThatTellsTheLinks) {
  EXPECT_EQ(error_of(edited(planar_text, "lengths = 1", "lengths = [1, 2, 3]")),
            "file.toml:4: chain.lengths: expected a finite number > 0 for all links, or an array of 2 (the links that "
            "chain.masses tells), got [1, 2, 3]");
  EXPECT_EQ(error_of(edited(planar_text, "[1.0, 2.0]", "[]")),
            "file.toml:3: chain.masses: expected at least one link, got []");
}

TEST(Scenario, LongArraysAreCutInMessages) {
  std::string many = "[1";
  for (int i = 0; i < 1000; ++i) many += ", 1";
  EXPECT_EQ(error_of(edited(planar_text, "lengths = 1", "lengths = " + many + "]")),
            "file.toml:4: chain.lengths: expected a finite number > 0 for all links, or an array of 2 (the links that "
            "chain.masses tells), got [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, ...] (1001 values)");
}

TEST(Scenario, AnElementIsFoundOnItsOwnLine) {
  EXPECT_EQ(error_of(edited(planar_text, "[1.0, 2.0]", "[\n  1.0,\n  -2.0,\n]")),
            "file.toml:5: chain.masses[2]: expected a finite number > 0, got -2.0");
}

TEST(Scenario, AnEmptyFileMovesNothing) {
  EXPECT_EQ(error_of(""), "file.toml: expected [chain] or [system], got neither");
}

// Nothing makes it a part of the equations of a chain: it was left out without a word.
TEST(Scenario, FeedbackOfAChainIsSampled) {
  const std::string law = "\n[[chain.feedback]]\ninput = \"torque_1\"\nvalue = \"-theta_1\"\n";
  EXPECT_NE(error_of(planar_text + law).find("chain.feedback[1].sample: expected"), std::string::npos);
  EXPECT_EQ(error_of(planar_text + law + "sample = 0.01\n"), "no error");
}

TEST(Scenario, ValuesOfSignalsMayHaveUnits) {
  const std::string signal = "\n[[chain.signal]]\ninput = \"torque_1\"\ntimes = [0, \"500 ms\"]\nvalues = [0, ";
  EXPECT_EQ(error_of(planar_text + signal + "\"200 mN m\"]\n"), "no error");
  EXPECT_NE(error_of(planar_text + signal + "\"200 mm\"]\n").find("values[2]"), std::string::npos);
}

TEST(Scenario, BadOverridesAreToldByTheirText) {
  const std::vector<std::pair<std::string, std::string>> inputs = {
      {"run.step=-1", "--set run.step=-1: run.step: expected a finite number > 0, got -1"},
      {"run.step=nan", "--set run.step=nan: run.step: expected a finite number > 0, got nan"},
      {"run.stpe=1",
       "--set run.stpe=1: run.stpe: expected one of method, stages, form, solver, iteration, step, "
       "tolerance, accuracy, duration, estimate, got the unknown key \"stpe\" (did you mean step?)"},
      {"step=1",
       "--set step=1: step: expected one of chain, system, start, run, output, event, ensemble, got the unknown key "
       "\"step\" "
       "(did you "
       "mean run.step?)"},
      {"run.step", "--set run.step: expected KEY=VALUE such as run.step=1e-4, got \"run.step\""},
      {"=1", "--set =1: expected KEY=VALUE such as run.step=1e-4, got \"=1\""},
      {"run..step=1", "--set run..step=1: expected KEY=VALUE such as run.step=1e-4, got \"run..step=1\""},
      {"run.step=", "--set run.step=: run.step: expected a key of the scenario, to take it out, got none"},
      {"chain.masses[3]=",
       "--set chain.masses[3]=: chain.masses[3]: expected an array of at least 3 elements, got [1.0, 2.0]"},
      {"run.step=1e-",
       "--set run.step=1e-: run.step: expected a finite number > 0 or a string in s (a time), got \"1e-\""},
      {"run.step=1\nevery=2", "--set run.step=1?every=2: expected a TOML value after '=', got \"1?every=2\""},
      {"run.method=eulr",
       "--set run.method=eulr: run.method: expected \"gauss\" or \"radau\" or \"rk4\" or \"dopri5\" or "
       "\"fehlberg78\" or \"taylor\" or \"auto\", got \"eulr\""},
      {"run=3", "--set run=3: run: expected a table, got 3"},
      {"chain.masses.first=3",
       "--set chain.masses.first=3: chain.masses.first: expected a table before the last dot (an "
       "array is set as a whole), got masses = [1.0, 2.0]"},
      {"chain.masses[3]=1",
       "--set chain.masses[3]=1: chain.masses[3]: expected an array of at least 3 elements, got [1.0, 2.0]"},
      {"chain.masses[0]=1",
       "--set chain.masses[0]=1: expected KEY=VALUE such as run.step=1e-4, got \"chain.masses[0]=1\" "
       "(elements of arrays count from 1)"},
      {"chain.drive[1].phase=1",
       "--set chain.drive[1].phase=1: chain.drive[1].phase: expected an array of at least 1 elements, got none"},
      {"chain.masses=[1, -2]", "--set chain.masses=[1, -2]: chain.masses[2]: expected a finite number > 0, got -2"},
  };
  for (const auto& [override, message] : inputs) EXPECT_EQ(error_of(planar_text, {override}), message);
}

TEST(Scenario, OverridesReachElementsAndTablesInArrays) {
  const auto scenario = parsed<Spatial>(
      spatial_text, {"chain.masses[2]=7", "chain.drive[1].frequency=5", "chain.drive[1].amplitude[3]=-1",
                     "chain.torque=[[0, 0, 1], [0, 0, 0], [0, 0, 0]]", "chain.torque[2][1]=4"});
  EXPECT_EQ(scenario.chain.masses(), Eigen::Vector3d(1, 7, 2));
  EXPECT_EQ(scenario.chain.drives()[0].frequency, 5);
  EXPECT_EQ(scenario.chain.drives()[0].amplitude, Eigen::Vector3d(1, 0, -1));
  EXPECT_EQ(scenario.chain.constant_torque()(0, 1), 4);
  EXPECT_EQ(scenario.chain.constant_torque()(2, 0), 1);
  EXPECT_EQ(
      error_of(spatial_text, {"chain.drive[1].frequency=nan"}),
      "--set chain.drive[1].frequency=nan: chain.drive[1].frequency: expected a finite number or a string in rad/s or "
      "deg/s, got nan");
}

TEST(Scenario, OverridesWithoutAValueTakeKeysOut) {
  const auto scenario = parsed<Spatial>(spatial_text, {"chain.drive[1]=", "chain.gravity=", "run.step = "});
  EXPECT_TRUE(scenario.chain.drives().empty());
  EXPECT_EQ(scenario.chain.gravity(), 9.81);
  EXPECT_TRUE(is_adaptive(scenario.options));
  EXPECT_EQ(parsed<Planar>(planar_text, {"chain.masses[2]=", "start.theta[2]="}).chain.links(), 1);
}

TEST(Scenario, AnglesMayHaveTheSignForDegrees) {
  const double quarter = std::numbers::pi / 2;
  EXPECT_EQ(parsed<Planar>(planar_text, {"start.theta=90°"}).start.theta(), Eigen::Vector2d(quarter, quarter));
  EXPECT_EQ(parsed<Planar>(planar_text, {"start.theta=[\"90 °\", \"-90°\"]"}).start.theta(),
            Eigen::Vector2d(quarter, -quarter));
  EXPECT_EQ(parsed<Planar>(planar_text, {"start.theta_dot=180°/s"}).start.theta_dot(),
            Eigen::Vector2d(2 * quarter, 2 * quarter));
}

TEST(Scenario, TheEstimateIsWantedUnlessItIsNot) {
  EXPECT_TRUE(parsed<Planar>(planar_text).estimate);
  EXPECT_FALSE(parsed<Planar>(planar_text, {"run.estimate=false"}).estimate);
}

TEST(Scenario, WithoutAStepThereAreAsManyStagesAsTheToleranceWants) {
  const auto run = [](const Overrides& overrides) { return parsed<Planar>(planar_text, overrides).options; };
  EXPECT_EQ(run({"run.tolerance=1e-4"}).stages, 4);
  EXPECT_EQ(run({"run.tolerance=1e-7"}).stages, 8);
  EXPECT_EQ(run({"run.tolerance=1e-4", "run.stages=5"}).stages, 5);
  EXPECT_EQ(run({"run.method=radau"}).stages, 3);
  EXPECT_EQ(run({"run.step=0.01"}).stages, 2);
  EXPECT_EQ(run({"run.step=0.01"}).step, 0.01);
  EXPECT_EQ(run({"run.method=rk4"}).step, 1e-3);
  EXPECT_TRUE(is_adaptive(run({"run.stages=3"})));
}

TEST(Scenario, SettingsWithoutEffectAreWarnedOf) {
  const auto warnings = [](const Overrides& overrides) { return parsed<Planar>(planar_text, overrides).warnings; };
  EXPECT_TRUE(warnings({"run.tolerance=1e-8"}).empty());
  EXPECT_EQ(warnings({"run.tolerance=1e-8", "run.step=0.1"}),
            Overrides{"--set run.tolerance=1e-8: run.tolerance: has no effect with run.step"});
  EXPECT_EQ(warnings({"run.method=dopri5", "run.step=0.1", "run.form=velocity"}),
            (Overrides{"--set run.form=velocity: run.form: has no effect with method dopri5",
                       "--set run.step=0.1: run.step: has no effect with method dopri5"}));
  EXPECT_TRUE(warnings({"run.method=rk4", "run.step=0.1"}).empty());
}

TEST(Scenario, SettingsKeepTheirPlacesForErrorsYetToCome) {
  const auto scenario = parsed<Spatial>(spatial_text, {"run.solver=chain"});
  EXPECT_EQ(scenario.places.at("stages"), "file.toml:25: run.stages");
  EXPECT_EQ(scenario.places.at("solver"), "--set run.solver=chain: run.solver");
  EXPECT_EQ(scenario.places.at("links"), "file.toml:3: chain.links");
  EXPECT_EQ(scenario.places.count("tolerance"), 0u);
  EXPECT_EQ(parsed<Planar>(planar_text).places.at("links"), "file.toml:3: chain.masses");
}

TEST(Scenario, FilesThatCannotBeReadAreInputErrors) {
  const auto error = [](const std::filesystem::path& file) -> std::string {
    try {
      read_scenario(file);
    } catch (const InputError& rejected) {
      return rejected.what();
    }
    return "no error";
  };
  EXPECT_EQ(error("no/such.toml"),
            "no/such.toml: expected a scenario file that can be read, got: No such file or directory");
  EXPECT_EQ(
      error(std::filesystem::temp_directory_path()),
      std::filesystem::temp_directory_path().string() + ": expected a scenario file that can be read, got: a folder");
}

// Natural units (paper §3.1): what stands above `units` is SI, everything else in l_1, M_1, sqrt(l_1/g).

const std::string natural_text = R"([chain]
space   = "planar"
masses  = [1.5, 0.5]
lengths = [0.8, 0.6]
gravity = 9.81
damping = [0.1, 0.2]
torque  = [0.3, -0.4]
units   = "natural"
drive   = [{ link = 2, amplitude = 0.5, frequency = 2.0, phase = 0.1 }]

[start]
theta     = [1.0, -0.5]
theta_dot = [0.3, 0.7]

[run]
step = 1e-2
duration = 3
)";

TEST(NaturalUnits, TwoLinksAreToldByTheirRatios) {
  const Chain<Planar> chain = parsed<Planar>(natural_text).chain;
  const double m = 0.5 / 2.0, l = 0.6 / 0.8;
  EXPECT_DOUBLE_EQ(chain.masses()[0], 1 - m);
  EXPECT_DOUBLE_EQ(chain.masses()[1], m);
  EXPECT_DOUBLE_EQ(chain.lengths()[0], 1);
  EXPECT_DOUBLE_EQ(chain.lengths()[1], l);
  EXPECT_EQ(chain.gravity(), 1);
}

TEST(NaturalUnits, OnlyWhatStandsAboveUnitsIsConverted) {
  const auto natural = parsed<Planar>(natural_text);
  ASSERT_TRUE(natural.natural);
  EXPECT_EQ(natural.natural->length, 0.8);
  EXPECT_EQ(natural.natural->mass, 2);
  EXPECT_DOUBLE_EQ(natural.natural->time, std::sqrt(0.8 / 9.81));
  EXPECT_EQ(natural.chain.drives()[0].amplitude[0], 0.5);
  EXPECT_EQ(natural.chain.drives()[0].frequency, 2);
  EXPECT_EQ(natural.start.theta_dot(), numbers({0.3, 0.7}));
  EXPECT_EQ(natural.options.step, 1e-2);
  EXPECT_EQ(natural.duration, 3);
}

TEST(NaturalUnits, MomentaAreNaturalAndStringsSayTheirUnit) {
  const std::string rates = edited(natural_text, "theta_dot = [0.3, 0.7]", "theta_dot = [\"90 deg/s\", \"2 rad/s\"]");
  const auto si = parsed<Planar>(rates, {"chain.units=SI"});
  const auto natural = parsed<Planar>(rates);
  EXPECT_EQ(si.start.v, numbers({std::numbers::pi / 2, 2}));
  EXPECT_LT((natural.start.v - natural.natural->time * si.start.v).norm(), 1e-15);  // measured 4.5e-17
  const auto by_momenta = parsed<Planar>(edited(natural_text, "theta_dot = [0.3, 0.7]", "p_theta = [0.25, -0.125]"));
  EXPECT_LT((momenta(by_momenta.chain, by_momenta.start) - numbers({0.25, -0.125})).norm(), 1e-15);  // measured 0
  const auto in_si =
      momenta(si.chain, State<Planar>{0, by_momenta.start.q, by_momenta.start.v / by_momenta.natural->time});
  const double unit = natural.natural->energy() * natural.natural->time;  // M_1 l_1² / time
  EXPECT_LT((in_si / unit - numbers({0.25, -0.125})).norm(), 1e-15);      // measured 5.6e-17
}

TEST(NaturalUnits, LoadsAndEnergyAreEqualAfterScalingBack) {
  const auto natural = parsed<Planar>(natural_text);
  const auto si = parsed<Planar>(natural_text, {"chain.units=SI"});
  const NaturalUnits unit = *natural.natural;
  const double torque_unit = 2 * 9.81 * 0.8;           // M_1 g l_1
  EXPECT_NEAR(unit.energy() / torque_unit, 1, 1e-15);  // measured 2.2e-16
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(natural.chain.constant_torque()(0, i) * torque_unit, si.chain.constant_torque()(0, i),
                1e-15);  // measured 1.1e-16
    EXPECT_NEAR(natural.chain.damping()[i] * torque_unit * unit.time, si.chain.damping()[i],
                1e-15);  // measured 5.6e-17
  }
  State<Planar> scaled_start = si.start;
  scaled_start.v *= unit.time;  // rad/s to rad per natural unit of time
  EXPECT_NEAR(energy(natural.chain, scaled_start) * torque_unit, energy(si.chain, si.start),
              1e-14);  // measured 1.8e-15
}

TEST(NaturalUnits, SpatialTorquesAreConvertedToo) {
  const auto scenario = parsed<Spatial>(spatial_text, {"chain.units=natural"});
  const double torque_unit = 3.5 * 9.8 * 1.5;
  EXPECT_NEAR(scenario.chain.constant_torque()(2, 1) * torque_unit, 0.3, 1e-15);  // measured 0
  EXPECT_EQ(scenario.chain.drives()[0].amplitude, Eigen::Vector3d(1, 0, 2));
}

TEST(NaturalUnits, NeedGravity) {
  EXPECT_EQ(error_of(edited(natural_text, "9.81", "0")),
            "file.toml:5: chain.gravity: expected a number > 0, which natural units need, got 0");
  EXPECT_EQ(error_of(edited(natural_text, "9.81", "-9.81")),
            "file.toml:5: chain.gravity: expected a number > 0, which natural units need, got -9.81");
}

TEST(NaturalUnits, AreRefusedWhereADoubleCannotHoldThem) {
  EXPECT_EQ(error_of(edited(natural_text, "[0.8, 0.6]", "1e-300")),
            "file.toml:8: chain.units: expected masses, lengths and gravity whose natural units a double can hold, got "
            "\"natural\"");
}

}  // namespace
}  // namespace pendula::io
