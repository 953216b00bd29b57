// Ensembles of planar chains with a member in every lane: what a step of a member costs, and members of ten seconds.
// Prints medians of several runs, of this thread's processor time. Given the name of a file, it writes starts and ends
// of double pendulums there instead, and prints times and errors by tolerance: heyoka_batch.py does the same of them.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <numbers>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/ensemble/member_queue.hpp>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/system/kernel_table.hpp>
#include <random>
#include <type_traits>
#include <vector>

#include "../tests/support/members.hpp"

namespace {

using namespace pendula;
using test::ChainMember, test::plain_members;

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
std::vector<ChainMember<Planar, N>> members_of(int links, int count, double end, double widest = std::numbers::pi) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> angle(-widest, widest);
  std::vector<ChainMember<Planar, N>> members(static_cast<std::size_t>(count));
  for (auto& member : members) {
    member.start = Motion(0, Eigen::VectorXd(links), Eigen::VectorXd::Zero(links));
    for (double& q : member.start.q) q = angle(random);
    member.end = end;
  }
  return members;
}

// Of nine runs, a member's, sorted.
template <class Queue>
std::vector<double> times_of(Queue& queue, const std::vector<typename Queue::MemberType>& members, MemberEnds& ends) {
  std::vector<double> times;
  for (int run = 0; run < 9; ++run) {
    const double start = processor_time();
    queue.run(members, ends.all());
    times.push_back((processor_time() - start) / static_cast<double>(members.size()));
  }
  std::sort(times.begin(), times.end());
  return times;
}

// Medians over runs; energy errors are of one more run, relative to Σ M g l.
template <class Queue, int N>
void measure(const char* what, const Chain<Planar, N>& chain, const std::vector<ChainMember<Planar, N>>& members,
             QueueOptions options) {
  MemberEnds ends(chain.links(), members.size());
  const std::vector<PlainMember<PlainChain>> given = plain_members(chain, members);
  Queue queue(chain.links(), options);
  const std::vector<double> times = times_of(queue, given, ends);
  double steps = 0, failed = 0;
  for (const MemberEnd& end : ends.all()) {
    steps += static_cast<double>(end.steps);
    failed += end.status == Status::ok ? 0 : 1;
  }
  options.energy_every = 1;
  Queue watching(chain.links(), options);
  watching.run(given, ends.all());
  double energy = 0;
  for (const MemberEnd& end : ends.all()) energy = std::max(energy, end.energy_error / energy_scale(chain));
  const auto count = static_cast<double>(members.size());
  std::printf("%-34s %8.2f us a member (best %8.2f), %7.0f steps, %9.3g member-steps/s, energy %.1e, failed %.0f", what,
              times[4] * 1e6, times[0] * 1e6, steps / count, steps / (times[4] * count), energy, failed);
  if constexpr (requires { queue.iterations(); }) {
    const double iterations = static_cast<double>(queue.iterations()) / 9;
    std::printf(", %.2f iterations", iterations * Queue::lanes / steps);
    std::printf(", %.2f ns a link, stage, iteration and member",
                times[4] * count * 1e9 / (iterations * Queue::lanes * chain.links() * Queue::stages));
  }
  std::printf("\n");
}

// --- Against heyoka ---

// At rest, from angles that fill the square evenly.
std::vector<ChainMember<Planar, 2>> spread_members(int count) {
  std::vector<ChainMember<Planar, 2>> members(static_cast<std::size_t>(count));
  const auto angle = [](double x) { return (2 * (x - std::floor(x)) - 1) * std::numbers::pi; };
  for (int k = 0; k < count; ++k) {
    auto& member = members[static_cast<std::size_t>(k)];
    member.start = Motion(0, Eigen::VectorXd(2), Eigen::VectorXd::Zero(2));
    member.start.q << angle(0.75487766624669276 * (k + 1)), angle(0.56984029099805327 * (k + 1));
    member.end = 10;
  }
  return members;
}

void write(const char* file, const std::vector<ChainMember<Planar, 2>>& members, const MemberEnds& ends) {
  std::FILE* const out = std::fopen(file, "w");
  if (out == nullptr) return std::perror(file);
  for (std::size_t k = 0; k < members.size(); ++k) {
    const Motion end = ends.motion(k);
    for (const Eigen::VectorXd* numbers : {&members[k].start.q, &end.q, &end.v}) {
      for (const double x : *numbers) std::fprintf(out, "%.17g ", x);
    }
    std::fprintf(out, "\n");
  }
  std::fclose(out);
}

// The error that half of the members have at most: distance in angles and rates from the reference.
double median_error(MemberEnds& ends, const MemberEnds& reference) {
  std::vector<double> errors;
  for (std::size_t k = 0; k < ends.all().size(); ++k) {
    const Motion a = ends.motion(k), b = reference.motion(k);
    errors.push_back(std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff()));
  }
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  return errors[errors.size() / 2];
}

template <class Queue>
void race(const char* what, typename Queue::Subject subject, const std::vector<typename Queue::MemberType>& members,
          const MemberEnds& reference, const QueueOptions& options) {
  MemberEnds ends(2, members.size());
  Queue queue(subject, options);
  const std::vector<double> times = times_of(queue, members, ends);
  double steps = 0;
  for (const MemberEnd& end : ends.all()) steps += static_cast<double>(end.steps);
  std::printf("%-12s %s %-6.0e %7.2f us a member (best %7.2f), %5.1f ns a step, error %.1e\n", what,
              options.step > 0 ? "step     " : "tolerance", options.step > 0 ? options.step : options.tolerance,
              times[4] * 1e6, times[0] * 1e6, times[4] * 1e9 * static_cast<double>(members.size()) / steps,
              median_error(ends, reference));
}

void race_all(const char* file) {
  const auto chain = equal_chain<2>(2);
  const auto members = spread_members(1024);
  MemberEnds reference(2, members.size());
  GaussLanes<Planar, 8, 2>(2, {.step = 1.0 / 512}).run(plain_members(chain, members), reference.all());
  write(file, members, reference);
  const auto go = [&](auto queue, const char* what, const QueueOptions& options) {
    race<typename decltype(queue)::type>(what, 2, plain_members(chain, members), reference, options);
  };
  for (const double tolerance : {1e-5, 1e-6, 1e-7}) {
    go(std::type_identity<GaussLanes<Planar, 4, 2>>(), "4 stages", {.tolerance = tolerance});
  }
  for (const double tolerance : {1e-9, 1e-12, 1e-14}) {
    go(std::type_identity<GaussLanes<Planar, 8, 2>>(), "8 stages", {.tolerance = tolerance});
  }
  for (const double tolerance : {1e-7, 1e-8, 1e-10, 1e-11, 1e-13, 1e-15}) {
    go(std::type_identity<ExplicitLanes<Planar, Fehlberg8, 2>>(), "fehlberg78", {.tolerance = tolerance});
  }
  for (const double tolerance : {1e-6, 1e-7, 1e-8, 1e-11, 1e-13, 1e-14, 1e-16}) {
    go(std::type_identity<TaylorLanes<Planar, 2>>(), "taylor, rods", {.tolerance = tolerance});
  }
  const ChainSystem numbers(plain(chain, {}), Planar::torque_components);
  std::vector<PlainMember<PlainSystem>> systems;
  for (const auto& member : members) {
    systems.push_back({numbers.plain(), 0, member.end, member.start.q.data(), member.start.v.data()});
  }
  using Lanes = SystemSeriesLanes<>;
  MemberSystems<Lanes::L> kernel(system_table<kernels::Planar2>);
  for (const double tolerance : {1e-6, 1e-7, 1e-8, 1e-11, 1e-13, 1e-14, 1e-16}) {
    race<Lanes>("taylor", kernel, systems, reference, {.tolerance = tolerance});
  }
}

}  // namespace

int main(int count, char** words) {
  if (count > 1) {
    race_all(words[1]);
    return 0;
  }
  const auto two = equal_chain<2>(2);
  const auto second = members_of<2>(2, 64, 1), ten_seconds = members_of<2>(2, 512, 10);
  measure<GaussLanes<Planar, 8, 2>>("n=2 s=8 h=1/128 round-off", two, ten_seconds, {.step = 1.0 / 128});
  measure<GaussLanes<Planar, 4, 2>>("n=2 s=4 T=10 tolerance 1e-6", two, ten_seconds, {.tolerance = 1e-6});
  measure<GaussLanes<Planar, 8, 2>>("n=2 s=8 T=10 tolerance 1e-12", two, ten_seconds, {.tolerance = 1e-12});
  measure<GaussLanes<Planar, 8, 2>>("n=2 s=8 T=10 tolerance 1e-15", two, ten_seconds, {.tolerance = 1e-15});
  const auto ten = equal_chain<Eigen::Dynamic>(10);
  const auto tens = members_of<Eigen::Dynamic>(10, 32, 0.5);
  measure<GaussLanes<Planar, 8>>("n=10 s=8 h=1/256 round-off", ten, tens, {.step = 1.0 / 256});
  measure<GaussLanes<Planar, 2>>("n=10 s=2 h=1e-3 round-off", ten, tens, {.step = 1e-3});
}
