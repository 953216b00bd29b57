#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <contestant.hpp>
#include <equations.hpp>
#include <stdexcept>

namespace bench {
namespace {

void require(bool done, const char* what) {
  if (!done) throw std::runtime_error(std::string("CVODE: ") + what);
}

/// Adams, up to order 12, with functional iteration: CVODE's own choice for problems that are not stiff.
template <class Equations>
class CvodeRun : public Run {
 public:
  CvodeRun(const Problem& problem, double tolerance) : problem_(problem), equations_(problem) {
    require(SUNContext_Create(nullptr, &context_) == 0, "context");
    y_ = N_VNew_Serial(2 * Equations::links, context_);
    memory_ = CVodeCreate(CV_ADAMS, context_);
    require(y_ != nullptr && memory_ != nullptr, "memory");
    restart();
    require(CVodeInit(memory_, derivative, 0, y_) == CV_SUCCESS, "init");
    iteration_ = SUNNonlinSol_FixedPoint(y_, 0, context_);
    require(CVodeSetNonlinearSolver(memory_, iteration_) == CV_SUCCESS, "iteration");
    require(CVodeSStolerances(memory_, tolerance, tolerance) == CV_SUCCESS, "tolerances");
    CVodeSetUserData(memory_, this);
    CVodeSetErrFile(memory_, nullptr);
    CVodeSetMaxNumSteps(memory_, 10'000'000);
  }

  CvodeRun(const CvodeRun&) = delete;
  CvodeRun& operator=(const CvodeRun&) = delete;

  ~CvodeRun() override {
    CVodeFree(&memory_);
    SUNNonlinSolFree(iteration_);
    N_VDestroy(y_);
    SUNContext_Free(&context_);
  }

  void operator()() override {
    restart();
    CVodeReInit(memory_, 0, y_);
    CVodeSetStopTime(memory_, problem_.duration);
    double time = 0;
    status_ = CVode(memory_, problem_.duration, y_, &time, CV_NORMAL);
  }

  EndState end() override {
    if (status_ < 0) return failed(problem_);
    EndState end;
    equations_.end(N_VGetArrayPointer(y_), end);
    return end;
  }

 private:
  void restart() {
    const auto start = Equations::start(problem_);
    std::copy(start.begin(), start.end(), N_VGetArrayPointer(y_));
  }

  static int derivative(double, N_Vector y, N_Vector dy, void* self) {
    static_cast<CvodeRun*>(self)->equations_.derivative(N_VGetArrayPointer(y), N_VGetArrayPointer(dy));
    return 0;
  }

  Problem problem_;
  Equations equations_;
  SUNContext context_ = nullptr;
  N_Vector y_ = nullptr;
  SUNNonlinearSolver iteration_ = nullptr;
  void* memory_ = nullptr;
  int status_ = -1;
};

template <template <class, int> class Equations>
std::unique_ptr<Run> make(const Problem& problem, double tolerance) {
  return with_links(problem.links, [&]<int N>() -> std::unique_ptr<Run> {
    return std::make_unique<CvodeRun<Equations<double, N>>>(problem, tolerance);
  });
}

}  // namespace

void add_cvode(std::vector<Contestant>& contestants) {
  const auto always = [](const Problem&) { return true; };
  const auto fine = [](const Problem&) { return tolerances(5, 15, 4); };
  contestants.push_back({"CVODE Adams", "tolerance", always, fine, make<DenseEquations>});
  contestants.push_back({"CVODE Adams, our O(n) dynamics", "tolerance", always, fine, make<RecursiveEquations>});
}

}  // namespace bench
