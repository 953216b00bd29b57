#include <cstddef>
#include <memory>
#include <pendula/chain/chain_variation.hpp>
#include <pendula/explicit/chain_forward_dynamics.hpp>
#include <pendula/run/derivatives.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <pendula/system/constraint_forces.hpp>
#include <pendula/system/lagrangian_variation.hpp>
#include <stdexcept>
#include <utility>

namespace pendula {
namespace {

/// Maps (δq, δv) and variations of parameters to a tangent of an integrator at one motion, and back.
struct TangentMap {
  Directions<> in, in_by;    ///< (rows x 2 coordinates), (rows x varied)
  Directions<> out, out_by;  ///< (2 coordinates x rows), (2 coordinates x varied)

  template <class Variation>
  TangentMap(Variation&& variation, Eigen::Index state, Eigen::Index rows, Eigen::Index varied) {
    const Directions<> parameters = Directions<>::Identity(varied, varied);
    variation.tangents(Directions<>::Identity(state, state), in);
    variation.tangents(Directions<>::Zero(state, varied), in_by, parameters);
    variation.rates(Directions<>::Identity(rows, rows), out);
    variation.rates(Directions<>::Zero(rows, varied), out_by, parameters);
  }
};

/// An integrator that steps to given times and differentiates its steps.
class Differentiated {
 public:
  explicit Differentiated(const MotionTask& task)
      : task_(task), integrator_(task.subject.make_integrator(task.options)), rows_(integrator_->linearize()) {
    double before = task.start.time;
    for (const double time : task.times) {
      if (!(time >= before) || std::isinf(time)) {
        throw std::invalid_argument("times: expected ascending ones from the start on");
      }
      before = time;
    }
  }

  Integrator& integrator() { return *integrator_; }
  Eigen::Index rows() const { return rows_; }
  Eigen::Index varied() { return integrator_->parameters(); }

  TangentMap map_at(const Motion& motion) {
    require_regular(task_.subject, motion);
    const Eigen::Index state = 2 * motion.q.size(), varied = this->varied();
    return as_its_kind_at(task_.subject, motion.time, [&](const auto& kind) {
      return is_dense() ? TangentMap(LagrangianVariation(system_model_of(kind), motion), state, rows_, varied)
                        : chain_map(kind, motion, state, varied);
    });
  }

  /// Steps to each of the times; before_step(), after_step(h asked for) and at_time(motion) on the way.
  template <class Before, class After, class AtTime>
  void go(MovedTo& moved, Before before_step, After after_step, AtTime at_time) {
    moved.outcome = integrator_->start(task_.start);
    double from = task_.start.time;
    for (const double time : task_.times) {
      Schedule schedule;
      schedule.step = longest_step(task_.options);
      schedule.duration = time - from;
      const double began = integrator_->time();
      while (moved.outcome && !detail::at_end(schedule, integrator_->time() - began)) {
        if (task_.stop()) moved.outcome.status = Status::interrupted;
        if (!moved.outcome) break;
        before_step();
        const double h = detail::next_step(schedule, integrator_->time() - began);
        moved.outcome = integrator_->step(h);
        if (moved.outcome) after_step(h);
      }
      if (!moved.outcome) return;
      moved.motions.push_back(integrator_->state());
      at_time(moved.motions.back());
      from = time;
    }
  }

 private:
  /// Whether tangents are in the coordinates of a kernel.
  bool is_dense() const { return integrator_->describe().solver != "chain"; }

  TangentMap chain_map(const SystemSubject&, const Motion&, Eigen::Index, Eigen::Index) const {
    throw std::logic_error("a system is no chain");
  }
  template <class Space>
  TangentMap chain_map(const ChainSubject<Space>& chain, const Motion& motion, Eigen::Index state,
                       Eigen::Index varied) const {
    return {ChainVariation<Space>(chain.chain(), State<Space>(motion)), state, rows_, varied};
  }

  const MotionTask& task_;
  std::unique_ptr<Integrator> integrator_;
  Eigen::Index rows_;
};

void require_rows(const char* what, const Directions<>& got, Eigen::Index rows, Eigen::Index columns) {
  if (got.rows() == rows && got.cols() == columns) return;
  throw std::invalid_argument(std::string(what) + ": expected (" + std::to_string(rows) + ", " +
                              std::to_string(columns) + ") numbers, got (" + std::to_string(got.rows()) + ", " +
                              std::to_string(got.cols()) + ")");
}

void find_accelerations(const SystemSubject& subject, const Motion& motion, double* found) {
  find_accelerations(system_model_of(subject, motion), motion.time, motion.q.data(), motion.v.data(), found);
}

template <class Space>
void find_accelerations(const ChainSubject<Space>& subject, const Motion& motion, double* found) {
  ChainForwardDynamics<Space>(subject.chain()).acceleration(motion.time, motion.q.data(), motion.v.data(), found);
}

}  // namespace

std::vector<Varied> varied_by(const Subject& subject) {
  if (const auto part = subject.part_at(0)) return varied_by(*part);
  std::vector<Varied> found;
  if (const auto* system = dynamic_cast<const SystemSubject*>(&subject)) {
    const SystemInfo& info = system->info();
    for (std::size_t k = 0; k < info.parameters.size(); ++k) {
      found.push_back({std::string(info.parameters[k]), info.parameter_sizes[k], false});
    }
    for (const std::string_view input : info.inputs) found.push_back({std::string(input), 1, true});
    return found;
  }
  // As chain_tangent.hpp and generated kernels number them.
  const auto [links, torques] = as_its_kind(subject, [](const auto& kind) {
    if constexpr (requires { kind.chain(); }) {
      return std::pair(kind.chain().links(), static_cast<int>(kind.chain().constant_torque().size()));
    } else {
      return std::pair(0, 0);
    }
  });
  return {{"masses", links, false},
          {"lengths", links, false},
          {"damping", links, false},
          {"gravity", 1, false},
          {"torque", torques, true}};
}

Forward move_variations(const MotionTask& task, const Directions<>& of_start, const Directions<>& of_parameters) {
  Differentiated moved(task);
  require_rows("variations of the start", of_start, 2 * task.start.q.size(), of_start.cols());
  require_rows("variations of parameters", of_parameters, moved.varied(), of_start.cols());
  Forward forward;
  const TangentMap first = moved.map_at(task.start);
  Directions<> tangents = first.in * of_start + first.in_by * of_parameters;
  moved.go(
      forward, [] {}, [&](double) { moved.integrator().push(tangents, of_parameters); },
      [&](const Motion& motion) {
        const TangentMap here = moved.map_at(motion);
        forward.variations.emplace_back(here.out * tangents + here.out_by * of_parameters);
      });
  return forward;
}

Backward move_gradients(const MotionTask& task, const Directions<>& gradients) {
  struct Taken {
    Member before;
    double step;
    std::size_t times;  ///< passed before it
  };
  Differentiated moved(task);
  require_rows("gradients", gradients, 2 * task.start.q.size(), static_cast<Eigen::Index>(task.times.size()));
  Backward backward;
  std::vector<Taken> steps;
  std::vector<TangentMap> maps;
  moved.go(
      backward,
      [&] {
        steps.push_back({moved.integrator().member(), 0, maps.size()});
      },
      [&](double h) { steps.back().step = h; }, [&](const Motion& motion) { maps.push_back(moved.map_at(motion)); });
  if (!backward.outcome) return backward;

  Directions<> pulled = Directions<>::Zero(moved.rows(), 1), of_parameters = Directions<>::Zero(moved.varied(), 1);
  std::size_t left = maps.size();
  const auto add_until = [&](std::size_t until) {
    while (left > until) {
      --left;
      const auto given = gradients.col(static_cast<Eigen::Index>(left));
      pulled += maps[left].out.transpose() * given;
      of_parameters += maps[left].out_by.transpose() * given;
    }
  };
  while (!steps.empty()) {
    const Taken& last = steps.back();
    add_until(last.times);
    moved.integrator().resume(last.before);
    backward.outcome = moved.integrator().step(last.step);
    if (backward.outcome && task.stop()) backward.outcome.status = Status::interrupted;
    if (!backward.outcome) return backward;
    moved.integrator().pull(pulled, of_parameters);
    steps.pop_back();
  }
  add_until(0);
  const TangentMap first = moved.map_at(task.start);
  backward.of_start = first.in.transpose() * pulled.col(0);
  backward.of_parameters = of_parameters.col(0) + first.in_by.transpose() * pulled.col(0);
  return backward;
}

void require_regular(const Subject& subject, const Motion& motion) {
  if (const auto part = subject.part_at(motion.time)) return require_regular(*part, motion);
  if (dynamic_cast<const ChainSubject<Spatial>*>(&subject) == nullptr) return;
  const Eigen::Index links = motion.q.size() / 2;
  constexpr double smallest = 1e-9;  // of sin(theta); derivatives have the digits that this leaves
  if ((motion.q.head(links).array().sin().abs() >= smallest).all()) return;
  throw std::invalid_argument(
      "derivatives: expected a state where the equations are regular, got one at a pole (in space phi has no meaning "
      "where sin(theta) is 0)");
}

Eigen::VectorXd field_at(const Subject& subject, const Motion& motion) {
  Eigen::VectorXd field(2 * motion.q.size());
  field.head(motion.q.size()) = motion.v;
  double* const found = field.data() + motion.q.size();
  as_its_kind_at(subject, motion.time, [&](const auto& kind) { find_accelerations(kind, motion, found); });
  return field;
}

}  // namespace pendula
