#include <mujoco/mujoco.h>

#include <contestant.hpp>
#include <cstring>
#include <sstream>
#include <stdexcept>

namespace bench {
namespace {

/// The chain as MuJoCo's bodies: hinges about −y, so that a rod at angle θ points along (sin θ, 0, −cos θ), and bobs
/// that are points but for the least inertia that the compiler accepts. Everything that a chain does not need is off.
std::string model_text(const Problem& problem, double step) {
  std::ostringstream xml;
  xml.precision(17);
  xml << R"(<mujoco><compiler angle="radian"/><size nconmax="0" njmax="0"/><option integrator="RK4" timestep=")" << step
      << R"(" gravity="0 0 )" << -problem.gravity << R"("><flag contact="disable" constraint="disable" )"
      << R"(passive="disable" actuation="disable" sensor="disable" warmstart="disable"/></option><worldbody>)";
  for (int i = 0; i < problem.links; ++i) {
    xml << R"(<body pos="0 0 )" << (i == 0 ? 0 : -problem.length) << R"("><joint type="hinge" axis="0 -1 0"/>)"
        << R"(<inertial pos="0 0 )" << -problem.length << R"(" mass=")" << problem.mass
        << R"(" diaginertia="2e-15 2e-15 2e-15"/>)";
  }
  for (int i = 0; i < problem.links; ++i) xml << "</body>";
  xml << "</worldbody></mujoco>";
  return xml.str();
}

mjModel* load(const std::string& text) {
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), "chain.xml", static_cast<int>(text.size()));
  std::memcpy(files->filedata[0], text.data(), text.size());
  char error[256] = "";
  mjModel* model = mj_loadXML("chain.xml", files.get(), error, sizeof error);
  mj_deleteVFS(files.get());
  if (model == nullptr) throw std::runtime_error(std::string("MuJoCo: ") + error);
  return model;
}

class MujocoRun : public Run {
 public:
  MujocoRun(const Problem& problem, double steps)
      : problem_(problem),
        steps_(static_cast<int>(steps)),
        model_(load(model_text(problem, problem.duration / steps)), mj_deleteModel),
        data_(mj_makeData(model_.get()), mj_deleteData) {}

  void operator()() override {
    mj_resetData(model_.get(), data_.get());
    data_->qpos[0] = problem_.angle;  // angles are relative: the rest of the chain goes on straight
    for (int k = 0; k < steps_; ++k) mj_step(model_.get(), data_.get());
  }

  EndState end() override {
    EndState end;
    double theta = 0, theta_dot = 0;
    for (int i = 0; i < problem_.links; ++i) {
      end.theta.push_back(theta += data_->qpos[i]);
      end.theta_dot.push_back(theta_dot += data_->qvel[i]);
    }
    return end;
  }

 private:
  Problem problem_;
  int steps_;
  std::unique_ptr<mjModel, void (*)(mjModel*)> model_;
  std::unique_ptr<mjData, void (*)(mjData*)> data_;
};

}  // namespace

void add_mujoco(std::vector<Contestant>& contestants) {
  mju_user_warning = [](const char*) {};  // an unstable step shows in the error
  contestants.push_back({"MuJoCo RK4", "steps", [](const Problem&) { return true; },
                         [](const Problem& problem) { return step_counts(problem, 2, 1.5, 24); },
                         [](const Problem& problem, double steps) -> std::unique_ptr<Run> {
                           return std::make_unique<MujocoRun>(problem, steps);
                         }});
}

}  // namespace bench
