#include <pendula/pendula.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <pendula/run/linearize.hpp>
#include <pendula/run/mover.hpp>
#include <pendula/run/run_failed.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "front/errors.hpp"
#include "front/model.hpp"
#include "front/options.hpp"
#include "io/trajectory.hpp"

struct pendula_simulation {
  pendula_simulation(pendula_model moved, const pendula::RunOptions& options, bool remembers)
      : model(std::move(moved)), mover(model.subject, options, remembers) {}

  pendula_model model;
  pendula::Mover mover;
  std::vector<pendula_event> events;  // as given
  bool asked_to_stop = false;         // by a callback for rows
};

namespace pendula::front {
namespace {

Event event_of(const pendula_event& given) {
  Event event;
  event.value = [value = given.value, context = given.context](const Motion& motion) {
    return value(context, motion.time, motion.q.data(), motion.v.data());
  };
  event.direction = given.direction > 0 ? Direction::up : given.direction < 0 ? Direction::down : Direction::both;
  event.stop = given.stop != 0;
  return event;
}

Mover::Happened happened_of(const pendula_event& given) {
  if (given.happened == nullptr) return {};
  return [happened = given.happened, context = given.context](bool up, const Motion& motion) {
    return happened(context, up ? 1 : 0, motion.time, motion.q.data(), motion.v.data()) != 0;
  };
}

RowTimes rows_every(double interval) {
  const RowTimes times{interval, {}};
  if (!times.any()) throw std::invalid_argument("rows: expected an interval > 0");
  return times;
}

/// Passes rows to a callback.
class Rows : public Observer {
 public:
  using Take = int (*)(void* context, const double* numbers, size_t count);

  Rows(Take row, void* context, bool& stop) : row_(row), context_(context), stop_(stop) {}

  void take(const Row& row) override {
    if (row_(context_, row.numbers.data(), row.numbers.size()) != 0) stop_ = true;
  }

 private:
  Take row_;
  void* context_;
  bool& stop_;
};

}  // namespace

extern "C" {

pendula_simulation* pendula_simulation_new(const pendula_model* model, double time, const double* q, const double* v,
                                           const pendula_options* options) {
  return made([&] {
    const bool remembers = options == nullptr || options->forget == 0;
    auto fresh = std::make_unique<pendula_simulation>(*model, options_of(options), remembers);
    require(fresh->mover.start(motion_of(*model, time, q, v)), fresh->mover.subject());
    pendula_heed(fresh.get(), nullptr, nullptr);
    return fresh.release();
  });
}

pendula_simulation* pendula_simulation_copy(const pendula_simulation* simulation, void* const* contexts) {
  return made([&] {
    auto copy = std::make_unique<pendula_simulation>(*simulation);
    copy->asked_to_stop = false;
    pendula_heed(copy.get(), nullptr, nullptr);
    if (contexts == nullptr) return copy.release();
    std::vector<Event> events;
    std::vector<Mover::Happened> happened;
    for (std::size_t k = 0; k < copy->events.size(); ++k) {
      copy->events[k].context = contexts[k];
      events.push_back(event_of(copy->events[k]));
      happened.push_back(happened_of(copy->events[k]));
    }
    copy->mover.replace(std::move(events), std::move(happened));
    return copy.release();
  });
}

void pendula_simulation_free(pendula_simulation* simulation) {
  delete simulation;
}

pendula_status pendula_advance_to(pendula_simulation* simulation, double time) {
  return guarded([&] {
    simulation->asked_to_stop = false;
    const Advance advance = simulation->mover.advance_to(time);
    require(advance.outcome, simulation->mover.subject());
    return advance.event ? PENDULA_EVENT : advance.stopped ? PENDULA_STOPPED : PENDULA_OK;
  });
}

pendula_status pendula_step(pendula_simulation* simulation) {
  return guarded([&] {
    simulation->asked_to_stop = false;
    const Advance advance = simulation->mover.step();
    require(advance.outcome, simulation->mover.subject());
    return advance.event ? PENDULA_EVENT : advance.stopped ? PENDULA_STOPPED : PENDULA_OK;
  });
}

double pendula_time(const pendula_simulation* simulation) {
  return simulation->mover.motion().time;
}
void pendula_motion(const pendula_simulation* simulation, double* q, double* v) {
  write(simulation->mover.motion(), q, v);
}
size_t pendula_steps(const pendula_simulation* simulation) {
  return simulation->mover.steps();
}

pendula_status pendula_simulation_row(const pendula_simulation* simulation, double* row) {
  return guarded([&] {
    write_row(simulation->mover.subject(), simulation->mover.motion(), row);
    return PENDULA_OK;
  });
}

pendula_status pendula_hold(pendula_simulation* simulation, const double* inputs, size_t count) {
  return guarded([&] {
    require(simulation->mover.hold({inputs, count}), simulation->mover.subject());
    return PENDULA_OK;
  });
}
void pendula_held(const pendula_simulation* simulation, double* inputs) {
  std::ranges::copy(simulation->mover.inputs(), inputs);
}

pendula_status pendula_at(pendula_simulation* simulation, double time, double* q, double* v) {
  return guarded([&] {
    Motion motion;
    require(simulation->mover.at(time, motion), simulation->mover.subject());
    write(motion, q, v);
    return PENDULA_OK;
  });
}

pendula_status pendula_restart(pendula_simulation* simulation, double time, const double* q, const double* v) {
  return guarded([&] {
    Mover& mover = simulation->mover;
    if (!(time >= mover.motion().time)) {
      throw std::invalid_argument("time: expected the present one, or a later one, to go on from");
    }
    require(mover.start(motion_of(simulation->model, time, q, v)), mover.subject());
    return PENDULA_OK;
  });
}

size_t pendula_saved(pendula_simulation* simulation) {
  return simulation->mover.save().numbers.size();
}
pendula_status pendula_save(pendula_simulation* simulation, double* numbers, size_t count) {
  return guarded([&] {
    const Member saved = simulation->mover.save();
    if (count != saved.numbers.size()) {
      throw std::invalid_argument("numbers: expected place for " + std::to_string(saved.numbers.size()) + ", got " +
                                  std::to_string(count));
    }
    std::ranges::copy(saved.numbers, numbers);
    return PENDULA_OK;
  });
}
pendula_status pendula_resume(pendula_simulation* simulation, const double* numbers, size_t count) {
  return guarded([&] {
    simulation->mover.resume({{numbers, numbers + count}});
    return PENDULA_OK;
  });
}

pendula_status pendula_heed(pendula_simulation* simulation, int (*stop)(void* context), void* context) {
  return guarded([&] {
    simulation->mover.set_stop([stop, context, asked = &simulation->asked_to_stop] {
      return *asked || (stop != nullptr && stop(context) != 0);
    });
    return PENDULA_OK;
  });
}

pendula_status pendula_on(pendula_simulation* simulation, const pendula_event* event) {
  return guarded([&] {
    if (event->value == nullptr) throw std::invalid_argument("value: expected a function of the motion, got none");
    simulation->mover.on(event_of(*event), happened_of(*event));
    simulation->events.push_back(*event);
    return PENDULA_OK;
  });
}

int pendula_stopped_by(const pendula_simulation* simulation) {
  const auto event = simulation->mover.stopped_by();
  return event ? static_cast<int>(*event) : -1;
}

pendula_status pendula_write_csv(pendula_simulation* simulation, const char* file, double interval) {
  return guarded([&] {
    const RowTimes times = rows_every(interval);  // may throw, so before the file is opened
    simulation->mover.add(std::make_unique<io::TrajectoryFile>(file, simulation->model.names), times);
    return PENDULA_OK;
  });
}

pendula_status pendula_on_rows(pendula_simulation* simulation, double interval,
                               int (*row)(void* context, const double* numbers, size_t count), void* context) {
  return guarded([&] {
    simulation->mover.add(std::make_unique<Rows>(row, context, simulation->asked_to_stop), rows_every(interval));
    return PENDULA_OK;
  });
}

pendula_status pendula_finish(pendula_simulation* simulation) {
  return guarded([&] {
    simulation->mover.finish();
    return PENDULA_OK;
  });
}

pendula_status pendula_linearize(const pendula_simulation* simulation, double* a, double* b) {
  return guarded([&] {
    const Linearized found = linearize(simulation->mover.subject(), simulation->mover.motion());
    if (a != nullptr) std::copy_n(found.a.data(), found.a.size(), a);
    if (b != nullptr) std::copy_n(found.b.data(), found.b.size(), b);
    return PENDULA_OK;
  });
}

pendula_status pendula_independent(const pendula_simulation* simulation, int* count, int* places) {
  return guarded([&] {
    const Independent found = find_independent(simulation->mover.subject(), simulation->mover.motion());
    *count = static_cast<int>(found.places.size());
    std::ranges::transform(found.places, places, [](Eigen::Index k) { return static_cast<int>(k); });
    return PENDULA_OK;
  });
}
}

}  // namespace pendula::front
