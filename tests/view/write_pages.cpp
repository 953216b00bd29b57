// Writes the pages that tests/view/test_page.py opens: write_pages FOLDER. A line for each tells its name, how long it
// took to write and its size.

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <numbers>
#include <pendula/chain/state.hpp>
#include <pendula/kernels/cart_chain_2.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/kernel_table.hpp>
#include <pendula/version.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/trajectory.hpp"
#include "view/page.hpp"

namespace {

using namespace pendula;

/// How runs are made and shown.
struct Plan {
  std::string name;
  RunOptions options;
  double duration = 10;
  std::int64_t every = 10;
  std::string scenario = "# made by the tests\n";
  std::vector<Event> events = {};
};

Plan plan_of(const std::string& name, int stages, double step, double duration, std::int64_t every) {
  Plan plan{name, {}, duration, every};
  plan.options.stages = stages;
  plan.options.step = step;
  return plan;
}

/// A folder of pages.
class Pages {
 public:
  explicit Pages(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// One page of runs from several starts; the trajectory of the first beside it.
  void write(const std::shared_ptr<const Subject>& subject, view::Scene scene, const Plan& plan,
             const std::vector<Motion>& starts) {
    scene.title = plan.name;
    scene.scenario = plan.scenario;
    scene.version = std::string(version);
    view::Page page(folder_ / (plan.name + ".html"), scene, starts.size());
    io::TrajectoryFile trajectory(folder_ / (plan.name + ".csv"), subject->columns());
    for (std::size_t k = 0; k < starts.size(); ++k) {
      page.begin_run(k == 0 ? "first" : "copy " + std::to_string(k));
      RunSetup setup{{plan.options, plan.duration, plan.every}, subject, starts[k]};
      setup.events = plan.events;
      run(setup, plan.name, page, k == 0 ? &trajectory : nullptr);
    }
    const auto begin = std::chrono::steady_clock::now();
    page.close();
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    std::cout << plan.name << ' ' << took.count() << " ms "
              << std::filesystem::file_size(folder_ / (plan.name + ".html")) << " bytes\n";
  }

 private:
  static void run(const RunSetup& setup, const std::string& name, view::Page& page, io::TrajectoryFile* trajectory) {
    Run run(setup);
    run.add(page);
    if (trajectory) run.add(*trajectory);
    const RunReport report = run.go();
    if (report.end != RunEnd::complete) std::cerr << name << ": " << report.step << '\n';
    page.end_run(report.energy_error);
  }

  std::filesystem::path folder_;
};

template <class Space>
std::shared_ptr<const ChainSubject<Space>> chain_of(int links, double length) {
  ChainParameters<Space> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Constant(links, length / links);
  return std::make_shared<ChainSubject<Space>>(Chain<Space>(parameters));
}

template <class Space>
Motion from_angle(int links, double theta) {
  if constexpr (Space::dof == 1) {
    return State<Space>::from_angles(Eigen::VectorXd::Constant(links, theta));
  } else {
    return State<Space>::from_angles(Eigen::VectorXd::Constant(links, theta),
                                     Eigen::VectorXd::LinSpaced(links, 0.3, 0.9));
  }
}

/// The demo: four links in space, a thousand rows of ten seconds; and the same with every fourth of them.
void demo(Pages& pages) {
  ChainParameters<Spatial> parameters;
  parameters.masses = Eigen::Vector4d(1.2, 0.6, 0.9, 1.6);
  parameters.lengths = Eigen::Vector4d(1, 1, 1, 1);
  const auto subject = std::make_shared<ChainSubject<Spatial>>(Chain<Spatial>(parameters));
  Plan plan = plan_of("demo", 4, 1e-3, 10, 10);
  plan.scenario = "[chain]\nspace = \"spatial\"\n# </script><script>window.broken = 1</script> <!-- & \" é\n";
  pages.write(subject, view::scene_of(*subject), plan, {from_angle<Spatial>(4, 1.9)});
  pages.write(subject, view::scene_of(*subject), plan_of("coarse", 4, 1e-3, 10, 40), {from_angle<Spatial>(4, 1.9)});
}

/// Fifty double pendulums that differ by 1e-9, and three.
void chaos(Pages& pages) {
  const auto subject = chain_of<Planar>(2, 2);
  std::vector<Motion> starts(50, from_angle<Planar>(2, 2.2));
  for (std::size_t k = 0; k < starts.size(); ++k) starts[k].q[0] += 1e-9 * static_cast<double>(k);
  const Plan plan = plan_of("chaos", 6, 5e-3, 20, 4);
  pages.write(subject, view::scene_of(*subject), plan, starts);
  const auto in_space = chain_of<Spatial>(3, 3);
  std::vector<Motion> three(3, from_angle<Spatial>(3, 2.2));
  for (std::size_t k = 0; k < three.size(); ++k) three[k].q[0] += 1e-9 * static_cast<double>(k);
  pages.write(in_space, view::scene_of(*in_space), plan_of("three_in_space", 4, 2e-3, 20, 10), three);
}

template <class Space>
void long_chain(Pages& pages, const std::string& name, int links, double step, double duration, std::int64_t every) {
  const auto subject = chain_of<Space>(links, 1);
  const Plan plan = plan_of(name, 4, step, duration, every);
  pages.write(subject, view::scene_of(*subject), plan, {from_angle<Space>(links, 0.5 * std::numbers::pi)});
}

/// Two links on a cart; and the same as if it had no points.
void model(Pages& pages) {
  const SystemTable& table = system_table<kernels::CartChain2>;
  SystemNumbers numbers{{}, {0}, {}};
  for (std::size_t k = 0; k < table.info.parameters.size(); ++k) {
    const double standard = table.info.parameter_defaults[k];
    const auto count = static_cast<std::size_t>(table.info.parameter_sizes[k]);
    numbers.parameters.insert(numbers.parameters.end(), count, std::isnan(standard) ? 1 : standard);
  }
  const std::shared_ptr<const SystemTable> unowned(&table, [](const SystemTable*) {});
  const auto subject = std::make_shared<SystemSubject>(unowned, numbers);
  Motion start;
  start.q = Eigen::Vector3d(0, 1.2, 2.0);
  start.v = Eigen::Vector3d::Zero();
  const Plan plan = plan_of("cart", 4, 2e-3, 12, 5);
  pages.write(subject, view::scene_of(*subject), plan, {start});
  view::Scene bare = view::scene_of(*subject);
  bare.points.clear();
  pages.write(subject, bare, plan_of("no_points", 4, 2e-3, 12, 5), {start});
}

/// Steps of the method's own choice, and things that happen; one of them too often for its marks.
void events(Pages& pages) {
  const auto subject = chain_of<Planar>(3, 3);
  Plan plan = plan_of("events", 6, 0, 20, 1);
  plan.options.tolerance = 1e-9;
  plan.events.push_back({"down", [](const Motion& motion) { return std::sin(motion.q[0]); }, Direction::both, false});
  plan.events.push_back({"turn", [](const Motion& motion) { return motion.v[0]; }, Direction::up, false});
  plan.events.push_back(
      {"tick", [](const Motion& motion) { return std::sin(200 * motion.time); }, Direction::up, false});
  pages.write(subject, view::scene_of(*subject), plan, {from_angle<Planar>(3, 2.2)});
}

/// A point in space that hangs on nothing, and a run that is over where it begins.
void odd_ones(Pages& pages) {
  const auto in_space = chain_of<Spatial>(1, 1);
  view::Scene point = view::scene_of(*in_space);
  point.rods = view::Rods::none;
  point.lengths.clear();
  pages.write(in_space, point, plan_of("free_point", 4, 1e-2, 10, 2), {from_angle<Spatial>(1, 1.2)});
  const auto chain = chain_of<Planar>(1, 1);
  pages.write(chain, view::scene_of(*chain), plan_of("one_row", 4, 1e-2, 0, 1), {from_angle<Planar>(1, 1.2)});
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::cerr << "usage: write_pages FOLDER\n";
    return 2;
  }
  Pages pages(arguments[1]);
  demo(pages);
  chaos(pages);
  long_chain<Planar>(pages, "hundred", 100, 1e-3, 1, 4);
  long_chain<Spatial>(pages, "hundred_in_space", 100, 1e-3, 1, 4);
  long_chain<Planar>(pages, "thousand", 1000, 1e-3, 0.2, 2);
  long_chain<Spatial>(pages, "thousand_in_space", 1000, 1e-3, 0.1, 1);
  model(pages);
  odd_ones(pages);
  events(pages);
}
