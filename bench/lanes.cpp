// Ensembles of planar chains with a member in every lane: what a step of a member costs, and members of ten seconds.
// Prints medians of several runs, of this thread's processor time.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <numbers>
#include <pendula/chain/invariants.hpp>
#include <pendula/lanes/lane_queue.hpp>
#include <random>
#include <vector>

namespace {

using namespace pendula;

double processor_time() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

template <int N>
Chain<Planar, N> equal_chain(int links) {
  ChainParameters<Planar, N> parameters;
  parameters.masses.setOnes(links);
  parameters.lengths.setOnes(links);
  parameters.damping.setZero(links);
  parameters.torque.setZero(1, links);
  return Chain<Planar, N>(parameters);
}

// At rest, from random angles.
template <int N>
std::vector<LaneMember<Planar, N>> members_of(int links, int count, double end, double widest = std::numbers::pi) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> angle(-widest, widest);
  std::vector<LaneMember<Planar, N>> members(static_cast<std::size_t>(count));
  for (auto& member : members) {
    member.start = Motion(0, Eigen::VectorXd(links), Eigen::VectorXd::Zero(links));
    for (double& q : member.start.q) q = angle(random);
    member.end = end;
  }
  return members;
}

// Medians over runs; energy errors are of one more run, relative to Σ M g l.
template <class Queue, int N>
void measure(const char* what, const Chain<Planar, N>& chain, const std::vector<LaneMember<Planar, N>>& members,
             LaneOptions options) {
  std::vector<LaneEnd> ends(members.size());
  Queue queue(chain, options);
  std::vector<double> times;
  for (int run = 0; run < 9; ++run) {
    const double start = processor_time();
    queue.run(members, ends);
    times.push_back(processor_time() - start);
  }
  std::sort(times.begin(), times.end());
  double steps = 0, failed = 0;
  for (const LaneEnd& end : ends) {
    steps += static_cast<double>(end.steps);
    failed += end.status == Status::ok ? 0 : 1;
  }
  options.energy_every = 1;
  Queue watching(chain, options);
  watching.run(members, ends);
  double energy = 0;
  for (const LaneEnd& end : ends) energy = std::max(energy, end.energy_error / energy_scale(chain));
  const auto count = static_cast<double>(members.size());
  std::printf("%-34s %8.2f us a member (best %8.2f), %7.0f steps, %9.3g member-steps/s, energy %.1e, failed %.0f", what,
              times[4] / count * 1e6, times[0] / count * 1e6, steps / count, steps / times[4], energy, failed);
  if constexpr (requires { queue.iterations(); }) {
    const double iterations = static_cast<double>(queue.iterations()) / 9;
    std::printf(", %.2f iterations", iterations * Queue::lanes / steps);
    std::printf(", %.2f ns a link, stage, iteration and member",
                times[4] * 1e9 / (iterations * Queue::lanes * chain.links() * Queue::stages));
  }
  std::printf("\n");
}

}  // namespace

int main() {
  const auto two = equal_chain<2>(2);
  const auto second = members_of<2>(2, 64, 1), ten_seconds = members_of<2>(2, 512, 10);
  measure<GaussLanes<Planar, 2, 2>>("n=2 s=2 h=1e-3 round-off", two, second, {.step = 1e-3});
  measure<GaussLanes<Planar, 2, 2>>("n=2 s=2 h=1e-3 to 1e-9", two, second, {.step = 1e-3, .enough = 1e-9});
  measure<Rk4Lanes<Planar, 2>>("n=2 rk4 h=1e-3", two, second, {.step = 1e-3});
  measure<GaussLanes<Planar, 8, 2>>("n=2 s=8 h=1/128 round-off", two, ten_seconds, {.step = 1.0 / 128});
  measure<GaussLanes<Planar, 4, 2>>("n=2 s=4 T=10 tolerance 1e-6", two, ten_seconds, {.tolerance = 1e-6});
  measure<GaussLanes<Planar, 5, 2>>("n=2 s=5 T=10 tolerance 1e-6", two, ten_seconds, {.tolerance = 1e-6});
  measure<GaussLanes<Planar, 6, 2>>("n=2 s=6 T=10 tolerance 1e-9", two, ten_seconds, {.tolerance = 1e-9});
  measure<GaussLanes<Planar, 8, 2>>("n=2 s=8 T=10 tolerance 1e-12", two, ten_seconds, {.tolerance = 1e-12});
  measure<GaussLanes<Planar, 8, 2>>("n=2 s=8 T=10 tolerance 1e-15", two, ten_seconds, {.tolerance = 1e-15});
  const auto ten = equal_chain<Eigen::Dynamic>(10);
  const auto tens = members_of<Eigen::Dynamic>(10, 32, 0.5);
  measure<GaussLanes<Planar, 8>>("n=10 s=8 h=1/256 round-off", ten, tens, {.step = 1.0 / 256});
  measure<GaussLanes<Planar, 2>>("n=10 s=2 h=1e-3 round-off", ten, tens, {.step = 1e-3});
}
