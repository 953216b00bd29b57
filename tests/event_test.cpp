// Events: every change of sign of a function of the motion, once, at its instant; and a motion that is not moved by it.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/event_location.hpp>
#include <pendula/run/run.hpp>
#include <string>
#include <utility>
#include <vector>

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

using Function = std::function<double(double)>;

/// A function on [0, 1], and what a polynomial shows of it: off by `error`, as a step's polynomial is between its ends.
struct Sight {
  Function function, error = [](double) { return 0.0; };
  int glances = 0, looks = 0;

  double value(double u) {
    ++glances;
    return function(u) + error(u);
  }
  double exact_value(double u) {
    ++looks;
    return function(u);
  }
};

std::vector<SignChange> changes_of(Sight& sight, int sign_before = 0, int degree = 8) {
  const double first = sight.function(0);
  return SignSearch(sight, degree).find(first, sight.function(1), first == 0 ? sign_before : sign_of(first));
}

std::vector<double> zeros_of(Sight& sight, int sign_before = 0, int degree = 8) {
  std::vector<double> zeros;
  for (const SignChange& change : changes_of(sight, sign_before, degree))
    zeros.push_back(locate(sight, change, 4e-16).value());
  return zeros;
}

TEST(SignSearch, LooksAtFourPlacesOfWhatIsFarFromZero) {
  Sight sight{[](double u) { return 3 + std::sin(u); }};
  EXPECT_TRUE(zeros_of(sight).empty());
  EXPECT_EQ(sight.glances, 4);
  EXPECT_EQ(sight.looks, 0);
}

// Five Chebyshev points see nothing of some that turn by 35 radians or more: there they are nearly the same.
TEST(SignSearch, IsNotTakenInByWhatTurnsOften) {
  for (double frequency = 30; frequency < 70; frequency += 0.1) {
    for (double phase = 0.05; phase < 3.1; phase += 0.1) {
      Sight sight{[=](double u) { return std::sin(frequency * u + phase); }};
      const double turned = std::floor((frequency + phase) / std::numbers::pi);
      ASSERT_EQ(changes_of(sight).size(), static_cast<std::size_t>(turned)) << frequency << " " << phase;
    }
  }
}

TEST(SignSearch, FindsOneZeroByFewLooks) {
  Sight sight{[](double u) { return std::exp(u) - 1.7; }};
  sight.error = [](double u) { return 1e-7 * std::sin(std::numbers::pi * u); };
  const std::vector<double> zeros = zeros_of(sight, 0, 6);
  ASSERT_EQ(zeros.size(), 1U);
  EXPECT_NEAR(zeros[0], std::log(1.7), 4e-16);  // measured 0
  EXPECT_EQ(sight.glances, 10);
  EXPECT_LE(sight.looks, 3);  // measured 2
}

TEST(SignSearch, FindsSeveralInOrder) {
  for (const int count : {2, 3, 5, 12}) {
    const double frequency = count * std::numbers::pi;
    Sight sight{[=](double u) { return std::sin(frequency * u + 0.3); }};
    const std::vector<SignChange> changes = changes_of(sight);
    ASSERT_EQ(changes.size(), static_cast<std::size_t>(count));
    for (std::size_t k = 0; k < changes.size(); ++k) {
      EXPECT_EQ(changes[k].sign, k % 2 == 0 ? -1 : 1);
      const double expected = ((static_cast<double>(k) + 1) * std::numbers::pi - 0.3) / frequency;
      EXPECT_NEAR(*locate(sight, changes[k], 4e-16), expected, 1e-15);  // measured 4e-16
    }
  }
}

// A zero at the beginning of a step is one if the sign is another after it than before it; one at its end is the next
// step's.
TEST(SignSearch, CountsAZeroAtAnEndOnce) {
  Sight rising{[](double u) { return u * (1 + u); }};
  EXPECT_EQ(zeros_of(rising, -1), std::vector<double>{0});
  EXPECT_TRUE(zeros_of(rising, 1).empty());  // touched
  EXPECT_TRUE(zeros_of(rising, 0).empty());  // begun there
  Sight ending{[](double u) { return (u - 1) * (1 + u); }};
  EXPECT_TRUE(zeros_of(ending).empty());
  Sight both{[](double u) { return u * (u - 0.5) * (u - 1); }};
  ASSERT_EQ(zeros_of(both, -1).size(), 2U);
  EXPECT_EQ(zeros_of(both, -1)[0], 0);
  EXPECT_NEAR(zeros_of(both, -1)[1], 0.5, 1e-15);  // measured 0
}

// Twice a zero, and a little more or less: with a polynomial that is off by more than that.
TEST(SignSearch, DecidesGrazingByFullOrder) {
  for (const double depth : {1e-3, 1e-6, 1e-9, 1e-12}) {
    for (const double wrong : {-1e-5, 0.0, 1e-5}) {
      const auto parabola = [=](double u) { return (u - 0.37) * (u - 0.37) * (2 + u); };
      const Function error = [=](double u) { return wrong * std::sin(std::numbers::pi * u); };
      Sight below{[=](double u) { return parabola(u) - depth; }, error};
      Sight above{[=](double u) { return parabola(u) + depth; }, error};
      const std::vector<double> zeros = zeros_of(below, 0, 2);
      ASSERT_EQ(zeros.size(), 2U) << depth << ' ' << wrong;
      EXPECT_NEAR(zeros[0], 0.37 - std::sqrt(depth / 2.37), 0.1 * std::sqrt(depth));  // the parabola is bent
      EXPECT_LT(std::abs(below.function(zeros[1])), 1e-15);                           // measured 1e-16
      EXPECT_TRUE(zeros_of(above, 0, 2).empty()) << depth << ' ' << wrong;
    }
  }
  Sight touched{[](double u) { return (u - 0.37) * (u - 0.37); }};
  EXPECT_TRUE(zeros_of(touched).empty());
  Sight flat{[](double u) { return std::pow(u - 0.37, 3); }};
  const std::vector<double> zeros = zeros_of(flat);
  ASSERT_EQ(zeros.size(), 1U);
  EXPECT_NEAR(zeros[0], 0.37, 1e-5);
}

// A line in place of a curve, off at both ends, as rates by the polynomial of a step are.
TEST(SignSearch, KnowsAPolynomialThatMissesTheEnds) {
  for (const double depth : {-0.009, -0.001, 0.001, 0.009}) {
    const auto curve = [=](double u) { return (u - 0.5) * (u - 0.5) + depth; };
    Sight sight{curve, [=](double u) { return 0.08 + 0.001 * u - (u - 0.5) * (u - 0.5); }};
    EXPECT_EQ(zeros_of(sight, 0, 2).size(), depth < 0 ? 2U : 0U) << depth;
  }
}

TEST(SignSearch, FindsJumpsAndCorners) {
  Sight jump{[](double u) { return std::fmod(u + 0.3, 0.7) - 0.35; }};  // up through zero twice, and a fall between
  const std::vector<SignChange> changes = changes_of(jump);
  ASSERT_EQ(changes.size(), 3U);
  EXPECT_NEAR(*locate(jump, changes[0], 4e-16), 0.05, 1e-15);  // measured 0
  EXPECT_NEAR(*locate(jump, changes[1], 4e-16), 0.4, 1e-15);   // measured 1e-16
  EXPECT_EQ(changes[1].sign, -1);
  EXPECT_NEAR(*locate(jump, changes[2], 4e-16), 0.75, 1e-15);  // measured 0
  // Values on one side tell nothing of where the jump is.
  Sight step{[](double u) { return u < 0.6180339887 ? -1e-9 : 1.0; }};
  ASSERT_EQ(zeros_of(step).size(), 1U);
  EXPECT_NEAR(zeros_of(step)[0], 0.6180339887, 1e-15);  // measured 0
  Sight corner{[](double u) { return std::abs(u - 0.37); }};
  EXPECT_TRUE(zeros_of(corner).empty());
  Sight below{[](double u) { return std::abs(u - 0.37) - 0.01; }};
  EXPECT_EQ(zeros_of(below).size(), 2U);
}

// The polynomial shows two zeros that there are not: that is seen, and full order then looks for others.
TEST(SignSearch, BelievesNoZeroThatIsNotThere) {
  Sight sight{[](double u) { return 1 + 0.1 * u; }, [](double u) { return -8 * u * (1 - u); }};
  const std::vector<SignChange> changes = changes_of(sight);
  ASSERT_EQ(changes.size(), 2U);
  EXPECT_EQ(locate(sight, changes[0], 4e-16), std::nullopt);
  EXPECT_EQ(locate(sight, changes[1], 4e-16), std::nullopt);
  SignSearch search(sight, 8);
  EXPECT_TRUE(search.find(1, 1.1, 1, decltype(search)::By::full_order).empty());
}

TEST(SignSearch, FindsNothingWhereThereIsNoNumber) {
  Sight half{[](double u) { return std::sqrt(u - 0.5) - 0.5; }};
  SignSearch search(half, 8);
  const std::vector<SignChange> changes = search.find(half.function(0), half.function(1), 0);
  EXPECT_FALSE(search.is_finite());
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_NEAR(*locate(half, changes[0], 4e-16), 0.75, 1e-15);  // measured 0
  Sight none{[](double) { return std::nan(""); }};
  EXPECT_TRUE(zeros_of(none).empty());
  EXPECT_LT(none.glances, 10);
}

TEST(SignSearch, CountsNoRoundingErrors) {
  Random random(1);
  Sight noise{[&](double) { return random.uniform(-1e-16, 1e-16); }};
  SignSearch search(noise, 8);
  ASSERT_EQ(search.find(1e-17, -1e-17, 1).size(), 1U);
  EXPECT_FALSE(search.is_told());
  EXPECT_LT(noise.glances, 600);
  EXPECT_TRUE(search.find(1e-17, 1e-17, 1).empty());
}

// --- Runs ---

struct Happened {
  std::size_t event;
  bool up;
  double time;
};

class Listener : public Observer {
 public:
  explicit Listener(const RunSetup& setup) : setup_(setup) {}

  void take(const Row& row) override { rows.push_back(row.motion); }
  void happen(const EventRow& row) override {
    const auto same = [&](const Event& event) { return event.name == row.event.name; };
    const auto event = std::ranges::find_if(setup_.events, same) - setup_.events.begin();
    happened.push_back({static_cast<std::size_t>(event), row.up, row.row.motion.time});
    EXPECT_EQ(row.row.numbers.front(), row.row.motion.time);
    at_zero = std::max(at_zero, std::abs(row.event.value(row.row.motion)));
  }
  void keep(const Checkpoint& checkpoint) override { checkpoints.push_back(checkpoint); }
  bool wants_checkpoint() const override { return true; }

  std::vector<Motion> rows;
  std::vector<Happened> happened;
  std::vector<Checkpoint> checkpoints;
  double at_zero = 0;  // largest |g| where one happened

 private:
  const RunSetup& setup_;
};

/// Where a chain's functions change their signs, by brute force: from the beginning of each step to 64 places in it,
/// and between two of them by halving. What is between two changes of less than that is not seen.
std::vector<Happened> by_brute_force(const RunSetup& setup) {
  const auto integrator = setup.subject->make_integrator(setup.options);
  EXPECT_TRUE(integrator->start(setup.start));
  std::vector<Happened> happened;
  const auto largest = is_adaptive(setup.options.method) ? 1e9 : setup.options.step;
  while (integrator->time() < setup.duration - 1e-12) {
    const Member before = integrator->member();
    const double begin = integrator->time();
    EXPECT_TRUE(integrator->step(std::min(largest, setup.duration - begin)));
    const Member after = integrator->member();
    const double length = integrator->time() - begin;
    Motion end = integrator->state();
    const auto state_at = [&](double u) {
      if (u == 1) return end;
      integrator->resume(before);
      const double time = begin + u * length;
      while (integrator->time() < time - 1e-15) EXPECT_TRUE(integrator->step(time - integrator->time()));
      Motion motion = integrator->state();
      motion.time = time;
      return motion;
    };
    std::vector<Motion> states;
    for (int k = 0; k <= 64; ++k) states.push_back(state_at(k / 64.0));
    for (std::size_t event = 0; event < setup.events.size(); ++event) {
      const auto& value = setup.events[event].value;
      for (std::size_t k = 0; k < 64; ++k) {
        const bool up = value(states[k + 1]) > 0;
        if ((value(states[k]) > 0) == up) continue;
        double from = static_cast<double>(k) / 64, to = static_cast<double>(k + 1) / 64;
        for (int halvings = 0; halvings < 50; ++halvings) {
          const double middle = (from + to) / 2;
          ((value(state_at(middle)) > 0) == up ? to : from) = middle;
        }
        happened.push_back({event, up, begin + to * length});
      }
    }
    integrator->resume(after);
  }
  return happened;
}

/// Functions of the kinds that people ask for, with random numbers in them. In space none of the rates of angles, which
/// leap at a pole within far less than a step.
template <class Space>
std::vector<Event> random_events(Random& random, const Chain<Space>& chain, int count) {
  std::vector<Event> events;
  const int links = chain.links();
  for (int k = 0; k < count; ++k) {
    const auto link = static_cast<Eigen::Index>(random.uniform(0, links * (1 - 1e-9)));
    const double level = random.uniform(-1, 1);
    const auto rate = [=](const Motion& motion) {
      return Space::dof == 1 ? motion.v[link] : bob_velocities(chain, motion)(1, link);
    };
    Event event{"event" + std::to_string(k), {}};
    switch (k % 6) {
      case 0:
        event.value = [=](const Motion& motion) { return std::cos(motion.q[link]) - level; };
        break;
      case 1:
        event.value = [=](const Motion& motion) { return rate(motion) - 3 * level; };
        break;
      case 2:
        event.value = [=](const Motion& motion) { return bob_positions(chain, motion)(0, link) - level; };
        break;
      case 3:
        event.value = [=](const Motion& motion) {
          return std::sin(5 * bob_positions(chain, motion)(1, link) + motion.time) - 0.9 * level;
        };
        break;
      case 4:
        event.value = [=](const Motion& motion) { return rate(motion) * std::cos(3 * motion.q[0]) + level; };
        break;
      default:
        event.value = [=](const Motion& motion) { return energies(chain, motion).kinetic - 10 * std::abs(level); };
    }
    events.push_back(event);
  }
  return events;
}

template <class Space>
RunSetup swinging(Random& random, int links, const RunOptions& options, double duration, int events) {
  const Chain<Space> chain = random_chain<Space>(random, links);
  RunSetup setup{{options, duration}, std::make_shared<ChainSubject<Space>>(chain), random_state<Space>(random, links)};
  setup.judged = false;
  setup.events = random_events(random, chain, events);
  return setup;
}

/// The events of a run, each one's by time.
struct Found {
  std::vector<std::vector<Happened>> of;
  RunReport report;
  double at_zero = 0;

  Found(const RunSetup& setup, const std::vector<Happened>& all) : of(setup.events.size()) {
    for (const Happened& happened : all) of[happened.event].push_back(happened);
  }
};

Found run_of(const RunSetup& setup) {
  Listener listener(setup);
  pendula::Run run(setup);
  run.add(listener);
  const RunReport report = run.go();
  EXPECT_EQ(report.end, RunEnd::complete);
  Found found(setup, listener.happened);
  found.report = report;
  found.at_zero = listener.at_zero;
  return found;
}

struct Case {
  const char* name;
  Method method;
  int stages;
  double step;
  bool spatial;
  int links;
  double looks = 3.5, glances = 10;  // at most: of a crossing, and of a step for all 24 functions together

  friend void PrintTo(const Case& given, std::ostream* out) { *out << given.name; }
};

class RandomCrossings : public ::testing::TestWithParam<Case> {};

TEST_P(RandomCrossings, AreTheSameAsByBruteForce) {
  const Case& given = GetParam();
  RunOptions options;
  options.method = given.method;
  options.stages = given.stages;
  options.step = given.step;
  std::int64_t crossings = 0, looks = 0, glances = 0, steps = 0;
  double off = 0;
  for (unsigned seed = 0; crossings < 1250; ++seed) {
    Random random(seed);
    const RunSetup setup = given.spatial ? swinging<Spatial>(random, given.links, options, 4, 24)
                                         : swinging<Planar>(random, given.links, options, 4, 24);
    const Found found = run_of(setup), expected(setup, by_brute_force(setup));
    for (std::size_t event = 0; event < setup.events.size(); ++event) {
      ASSERT_EQ(found.of[event].size(), expected.of[event].size()) << "seed " << seed << ", event " << event;
      for (std::size_t k = 0; k < found.of[event].size(); ++k) {
        const Happened &got = found.of[event][k], &wanted = expected.of[event][k];
        EXPECT_EQ(got.up, wanted.up);
        off = std::max(off, std::abs(got.time - wanted.time));
        ++crossings;
      }
    }
    looks += found.report.event_cost.looks;
    glances += found.report.event_cost.glances;
    steps += found.report.statistics.steps;
  }
  EXPECT_LT(off, 1e-13);  // in s; measured 3e-15
  const auto per = [](std::int64_t count, std::int64_t of) {
    return static_cast<double>(count) / static_cast<double>(of);
  };
  // Measured 16.7 with one stage, 5.3 with two, else to 2.5.
  EXPECT_LE(per(looks, crossings), given.looks);
  EXPECT_LE(per(glances, steps), given.glances);  // measured 4.2 to 6.7
}

INSTANTIATE_TEST_SUITE_P(Methods, RandomCrossings,
                         ::testing::Values(Case{"gauss_1", Method::gauss, 1, 0.005, false, 2, 22},
                                           Case{"gauss_2", Method::gauss, 2, 0.005, false, 2, 7},
                                           Case{"gauss_4", Method::gauss, 4, 0.02, false, 3},
                                           Case{"gauss_6", Method::gauss, 6, 0.03, true, 2},
                                           Case{"gauss_8", Method::gauss, 8, 0.05, false, 2},
                                           Case{"chain", Method::gauss, 4, 0.01, false, 6},
                                           Case{"rk4", Method::rk4, 1, 0.01, false, 2},
                                           Case{"dopri5", Method::dopri5, 1, 1, false, 2},
                                           Case{"taylor", Method::taylor, 1, 1, true, 3},
                                           Case{"radau", Method::radau, 3, 0.01, false, 2}),
                         [](const auto& test) { return std::string(test.param.name); });

RunSetup double_pendulum(std::vector<Event> events, double duration = 4) {
  RunSetup setup{{.duration = duration},
                 std::make_shared<ChainSubject<Planar>>(equal_chain<Planar>(2)),
                 State<Planar>::from_angles(Eigen::Vector2d(1.5, 2))};
  setup.options.stages = 6;
  setup.options.step = 0.01;
  setup.events = std::move(events);
  return setup;
}

Event bob_passes_below(Direction direction = Direction::both, bool stop = false) {
  return {"below", [](const Motion& motion) { return std::sin(motion.q[0]) + std::sin(motion.q[1]); }, direction, stop};
}

Event at_time(double time) {
  return {"at " + std::to_string(time), [=](const Motion& motion) { return motion.time - time; }};
}

TEST(Events, DoNotMoveTheMotion) {
  for (const RowTimes& rows : {RowTimes{}, RowTimes{0.013, {}}}) {
    for (const Method method : {Method::gauss, Method::rk4, Method::dopri5, Method::taylor}) {
      RunSetup with = double_pendulum({bob_passes_below(), at_time(1.23)});
      with.rows = rows;
      with.options.method = method;
      RunSetup without = with;
      without.events = {};
      Listener watched(with), alone(without);
      pendula::Run one(with), other(without);
      one.add(watched);
      other.add(alone);
      const RunReport report = one.go();
      EXPECT_EQ(report.statistics.newton_iterations, other.go().statistics.newton_iterations);
      EXPECT_GE(watched.happened.size(), 4U);
      ASSERT_EQ(watched.rows.size(), alone.rows.size());
      for (std::size_t k = 0; k < alone.rows.size(); ++k) {
        EXPECT_EQ(watched.rows[k].time, alone.rows[k].time);
        EXPECT_EQ(watched.rows[k].q, alone.rows[k].q);
        EXPECT_EQ(watched.rows[k].v, alone.rows[k].v);
      }
    }
  }
}

TEST(Events, OfTimeAloneAreFoundWhereTheyTurnOftenInAStep) {
  for (const double frequency : {35.0, 50.0, 60.0, 70.0}) {
    RunSetup setup =
        double_pendulum({{"turned", [=](const Motion& motion) { return std::sin(frequency * motion.time + 0.1); }}}, 5);
    setup.start = State<Planar>::from_angles(Eigen::Vector2d(0.1, 0.1));
    setup.options.step = 0.7;
    Listener listener(setup);
    pendula::Run run(setup);
    run.add(listener);
    const double turned = std::floor((frequency * 5 + 0.1) / std::numbers::pi);
    EXPECT_EQ(run.go().events[0].count, static_cast<std::int64_t>(turned)) << frequency;
  }
}

// Where the angle of a pendulum turns, the energy tells: a threshold a little below is passed twice at each turn, one a
// little above never, by all methods, whatever their polynomial within a step is.
TEST(Events, OfPairsNoneIsMissedThatIsDeeperThanTheErrorOfTheState) {
  struct Asked {
    RunOptions options;
    double error;  // of the state
  };
  std::vector<Asked> all = {{{.stages = 8, .step = 0, .tolerance = 1e-10}, 1e-9},
                            {{.stages = 4, .step = 0, .tolerance = 1e-6}, 1e-4},
                            {{.stages = 2, .step = 0.002}, 1e-8},
                            {{.method = Method::radau, .stages = 3, .step = 0, .tolerance = 1e-8}, 1e-6},
                            {{.method = Method::rk4, .step = 0.002}, 1e-8}};
  for (const Method method : {Method::dopri5, Method::fehlberg78, Method::taylor}) {
    all.push_back({{.method = method, .tolerance = 1e-11}, 1e-8});
  }
  Random random(3);
  int turns = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const double theta = random.uniform(-0.5, 0.5), rate = random.uniform(0.5, 5);
    const double highest = std::acos(std::cos(theta) - rate * rate / (2 * 9.81));  // of length 1
    for (const auto& [options, error] : all) {
      const double depth = std::pow(10, random.uniform(std::log10(10 * error), -2));
      RunSetup setup{
          {options, 4},
          std::make_shared<ChainSubject<Planar>>(equal_chain<Planar>(1)),
          State<Planar>::from_angles(Eigen::VectorXd::Constant(1, theta), Eigen::VectorXd::Constant(1, rate))};
      setup.judged = false;
      setup.events = {
          {"passes", [=](const Motion& motion) { return motion.q[0] - (highest - depth); }},
          {"misses", [=](const Motion& motion) { return motion.q[0] - (highest + depth); }},
          {"turns", [](const Motion& motion) { return motion.v[0]; }, Direction::down},
      };
      const RunReport report = pendula::Run(setup).go();
      if (report.last.q[0] > highest - 2 * depth) continue;  // in between
      EXPECT_EQ(report.events[0].count, 2 * report.events[2].count) << options.method << ' ' << trial << ' ' << depth;
      EXPECT_EQ(report.events[1].count, 0) << options.method << ' ' << trial << ' ' << depth;
      turns += static_cast<int>(report.events[2].count);
    }
  }
  EXPECT_GT(turns, 300);
}

// What comes so close to zero by time alone, many times in a step, is looked at where it turns.
TEST(Events, OfTimeAloneAreFoundWhereTheyHardlyReachZero) {
  for (const Method method : {Method::gauss, Method::taylor, Method::dopri5}) {
    for (const double least : {1e-6, 1e-9, 1e-12}) {
      RunSetup setup = double_pendulum(
          {{"reaches", [=](const Motion& motion) { return std::cos(37 * motion.time) - (1 - least); }}}, 10);
      setup.options.method = method;
      setup.options.step = 0;
      setup.judged = false;
      const double times = 1 + 2 * std::floor(37 * 10 / (2 * std::numbers::pi));  // it starts above
      EXPECT_EQ(pendula::Run(setup).go().events[0].count, static_cast<std::int64_t>(times)) << method << ' ' << least;
    }
  }
}

TEST(Events, AreToldInOrderWithTheirDirectionAndCounted) {
  RunSetup named = double_pendulum({bob_passes_below(), bob_passes_below(Direction::up),
                                    bob_passes_below(Direction::down), at_time(1.2301), at_time(1.2303), at_time(99)},
                                   10);
  for (std::size_t k = 0; k < named.events.size(); ++k) named.events[k].name = std::to_string(k);
  Listener all(named);
  pendula::Run run(named);
  run.add(all);
  const RunReport report = run.go();
  EXPECT_TRUE(std::ranges::is_sorted(all.happened, {}, &Happened::time));
  EXPECT_LT(all.at_zero, 1e-14);  // measured 2e-15
  std::vector<EventTally> expected(6);
  for (const Happened& happened : all.happened) {
    expected[happened.event].add(happened.time);
    EXPECT_TRUE(happened.event != 1 || happened.up);
    EXPECT_TRUE(happened.event != 2 || !happened.up);
  }
  EXPECT_EQ(report.events[0].count, report.events[1].count + report.events[2].count);
  EXPECT_GE(report.events[1].count, 2);
  EXPECT_GE(report.events[2].count, 2);
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(report.events[k].count, expected[k].count);
    if (expected[k].count > 0) {
      EXPECT_EQ(report.events[k].first, expected[k].first);
      EXPECT_EQ(report.events[k].last, expected[k].last);
    }
  }
  EXPECT_EQ(report.events[3].count, 1);
  EXPECT_NEAR(report.events[3].first, 1.2301, 3e-16);  // measured 0
  EXPECT_NEAR(report.events[4].first, 1.2303, 3e-16);  // measured 2.2e-16
  EXPECT_EQ(report.events[5].count, 0);
  EXPECT_TRUE(std::isnan(report.events[5].first));
}

// On every end of a step, from the second to the last but one: once each.
TEST(Events, AtTheEndsOfStepsHappenOnce) {
  std::vector<Event> events;
  for (int step = 0; step <= 100; ++step) events.push_back(at_time(step * 0.01));
  const RunSetup setup = double_pendulum(events, 1);
  const Found found = run_of(setup);
  for (std::size_t step = 1; step < 100; ++step) {
    ASSERT_EQ(found.report.events[step].count, 1) << step;
    EXPECT_NEAR(found.report.events[step].first, static_cast<double>(step) * 0.01, 3e-16);  // measured 2.2e-16
  }
  EXPECT_EQ(found.report.events[0].count, 0);    // it begins there
  EXPECT_EQ(found.report.events[100].count, 0);  // and ends here, who knows where it goes
}

TEST(Events, MayEndTheRun) {
  for (const RowTimes& rows : {RowTimes{}, RowTimes{0.013, {}}, RowTimes{0, {0.1, 3.5}}}) {
    RunSetup setup = double_pendulum({at_time(0.3), bob_passes_below(Direction::up, true), at_time(3)});
    setup.rows = rows;
    Listener listener(setup);
    pendula::Run run(setup);
    run.add(listener);
    const RunReport report = run.go();
    EXPECT_EQ(report.end, RunEnd::event);
    EXPECT_EQ(report.ended_by, 1U);
    EXPECT_EQ(report.events[1].count, 1);
    EXPECT_EQ(report.events[2].count, 0);
    EXPECT_EQ(listener.happened.back().time, report.last.time);
    EXPECT_EQ(report.last.time, report.events[1].first);
    EXPECT_LT(std::abs(setup.events[1].value(report.last)), 1e-14);  // measured 1e-15
    EXPECT_LE(listener.rows.back().time, report.last.time);
    EXPECT_EQ(listener.rows.back().time == report.last.time, !rows.any());
    EXPECT_TRUE(rows.interval == 0 || listener.rows.back().time > report.last.time - rows.interval);
    EXPECT_TRUE(std::ranges::adjacent_find(listener.rows, {}, &Motion::time) == listener.rows.end());
    EXPECT_TRUE(report.warnings.empty());
  }
}

TEST(Events, AtARowEndTheRunWithThatRow) {
  RunSetup setup = double_pendulum({at_time(0.5)});
  setup.events[0].stop = true;
  Listener listener(setup);
  pendula::Run run(setup);
  run.add(listener);
  EXPECT_EQ(run.go().end, RunEnd::event);
  EXPECT_NEAR(listener.rows.back().time, 0.5, 2e-16);  // measured 0
  EXPECT_TRUE(std::ranges::adjacent_find(listener.rows, {}, &Motion::time) == listener.rows.end());
}

// Cut anywhere that it may go on from, the parts have the events of the whole, and its last checkpoint.
TEST(Events, OfARunThatGoesOnAreThoseOfTheWhole) {
  const RunSetup setup = double_pendulum({bob_passes_below(), at_time(1), at_time(1.0001)});
  Listener whole(setup);
  pendula::Run run(setup);
  run.add(whole);
  const RunReport report = run.go();
  for (std::size_t cut = 1; cut < whole.checkpoints.size(); cut += 7) {
    const Checkpoint& from = whole.checkpoints[cut];
    Listener rest(setup);
    pendula::Run second(setup);
    second.add(rest);
    const RunReport end = second.go_on(from);
    ASSERT_LE(rest.happened.size(), whole.happened.size());
    const std::size_t before = whole.happened.size() - rest.happened.size();
    for (std::size_t k = 0; k < rest.happened.size(); ++k) {
      EXPECT_EQ(rest.happened[k].event, whole.happened[before + k].event);
      EXPECT_EQ(rest.happened[k].time, whole.happened[before + k].time);
    }
    EXPECT_TRUE(before == 0 || whole.happened[before - 1].time <= from.time);
    EXPECT_EQ(end.events[0].count, report.events[0].count);
    EXPECT_EQ(end.events[0].first, report.events[0].first);
    EXPECT_EQ(rest.checkpoints.back().record, whole.checkpoints.back().record);
    EXPECT_EQ(rest.checkpoints.back().integrator, whole.checkpoints.back().integrator);
  }
}

// It would come to the event again.
TEST(Events, ARunThatAnEventEndedEndsThereAgain) {
  const RunSetup setup = double_pendulum({bob_passes_below(Direction::up, true)});
  Listener whole(setup), rest(setup);
  pendula::Run run(setup), second(setup);
  run.add(whole);
  const RunReport report = run.go();
  second.add(rest);
  const RunReport end = second.go_on(whole.checkpoints.back());
  EXPECT_EQ(end.end, RunEnd::event);
  EXPECT_EQ(end.last.time, report.last.time);
  EXPECT_EQ(end.last.q, report.last.q);
  EXPECT_EQ(end.events[0].count, 1);
}

TEST(Events, ThatAreNoNumberAreWarnedOf) {
  RunSetup setup = double_pendulum({{"root", [](const Motion& motion) { return std::sqrt(0.5 - motion.time) - 2; }}});
  const Found found = run_of(setup);
  ASSERT_EQ(found.report.warnings.size(), 1U);
  EXPECT_EQ(found.report.warnings[0],
            "event root: not finite before t = 0.51 s; where that is so, nothing was looked for");
  EXPECT_TRUE(found.of[0].empty());
}

}  // namespace
}  // namespace pendula::test
