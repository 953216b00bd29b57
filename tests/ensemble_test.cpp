// Many members in one program: each as if it were alone.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <mutex>
#include <pendula/ensemble/propagate.hpp>
#include <pendula/run/chain_subject.hpp>
#include <stdexcept>
#include <vector>

#include "support/random_chain.hpp"

namespace pendula::test {
namespace {

std::vector<EnsembleMember> members(int count) {
  Random random(3);
  std::vector<EnsembleMember> members;
  for (int k = 0; k < count; ++k) {
    const auto subject = std::make_shared<ChainSubject<Planar>>(random_chain<Planar>(random, 2));
    members.push_back({subject, random_state<Planar>(random, 2)});
  }
  return members;
}

EnsembleSchedule schedule(int threads) {
  EnsembleSchedule schedule;
  schedule.options.step = 0;
  schedule.options.stages = 4;
  schedule.options.tolerance = 1e-8;
  schedule.duration = 1;
  schedule.threads = threads;
  schedule.chunk = 3;
  return schedule;
}

std::vector<RunReport> reports(const std::vector<EnsembleMember>& all, const EnsembleSchedule& schedule) {
  std::vector<RunReport> reports(all.size());
  std::mutex guard;
  std::vector<int> seen(all.size());
  propagate(all, schedule, [&](std::size_t number, const RunReport& report) {
    const std::scoped_lock lock(guard);
    ++seen.at(number);
    reports.at(number) = report;
  });
  EXPECT_EQ(seen, std::vector<int>(all.size(), 1));
  return reports;
}

TEST(Propagate, MovesEachMemberAsIfItWereAlone) {
  const std::vector<EnsembleMember> all = members(10);
  const std::vector<RunReport> by_one = reports(all, schedule(1)), by_three = reports(all, schedule(3));
  for (std::size_t k = 0; k < all.size(); ++k) {
    const EnsembleSchedule plan = schedule(1);
    pendula::Run alone({.subject = all[k].subject,
                        .start = all[k].start,
                        .options = plan.options,
                        .duration = plan.duration,
                        .every = plan.every,
                        .doubted = false});
    const RunReport expected = alone.go();
    ASSERT_EQ(expected.end, RunEnd::complete);
    for (const std::vector<RunReport>& found : {by_one, by_three}) {
      EXPECT_EQ(found[k].end, RunEnd::complete);
      EXPECT_EQ(found[k].last.q, expected.last.q) << k;
      EXPECT_EQ(found[k].last.v, expected.last.v) << k;
      EXPECT_EQ(found[k].energy_error.largest, expected.energy_error.largest) << k;
    }
  }
}

TEST(Propagate, AMemberThatFailsStopsNobodyElse) {
  std::vector<EnsembleMember> all = members(7);
  const std::vector<RunReport> expected = reports(all, schedule(1));
  all[2].start.v[0] = std::numeric_limits<double>::infinity();
  const std::vector<RunReport> found = reports(all, schedule(2));
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(found[k].end == RunEnd::complete, k != 2) << k;
    if (k != 2) {
      EXPECT_EQ(found[k].last.q, expected[k].last.q);
    }
  }
}

TEST(Propagate, WhatAnObserverThrowsEndsIt) {
  const std::vector<EnsembleMember> all = members(20);
  const auto refuse = [](std::size_t number, const RunReport&) {
    if (number == 4) throw std::runtime_error("enough");
  };
  for (const int threads : {1, 2}) EXPECT_THROW(propagate(all, schedule(threads), refuse), std::runtime_error);
}

TEST(Propagate, OfNobodyIsNothing) {
  EXPECT_TRUE(reports({}, schedule(2)).empty());
}

}  // namespace
}  // namespace pendula::test
