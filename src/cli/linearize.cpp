#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <pendula/numeric/directions.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/derivatives.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/linearize.hpp>
#include <pendula/run/state_columns.hpp>
#include <string>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/read_scenario.hpp"
#include "io/errors.hpp"
#include "io/quantity_text.hpp"
#include "io/row_slopes.hpp"
#include "io/scenario_run.hpp"

namespace pendula::cli {
namespace {

/// The linearisation at a motion, with names of its numbers: of all coordinates and rates, and of those in x.
struct Linear {
  Motion at;
  std::vector<std::string> all, names, inputs, outputs;
  Linearized system;
  Directions<> c, d;
  std::optional<double> step;  ///< of the discrete system  [s]; nullopt: continuous
};

/// The oscillation of an eigenvalue, exp((-damping w + i …) t): undamped frequency w  [Hz], and damping ratio.
struct Swing {
  double frequency, damping;
};

Swing swing_of(std::complex<double> eigenvalue, std::optional<double> step) {
  if (step) eigenvalue = std::log(eigenvalue) / *step;
  const double pace = std::abs(eigenvalue);
  return {pace / (2 * std::numbers::pi), -eigenvalue.real() / pace};
}

std::vector<std::string> state_names(const Subject& subject) {
  const std::vector<std::string> columns = subject.columns();
  std::vector<std::string> names;
  for (const std::size_t place : state_columns(subject)) names.push_back(columns[place]);
  return names;
}

/// Makes the system discrete: from one time to the next, while inputs are held.
void make_discrete(const Subject& subject, const RunOptions& options, double step, const InterruptGuard& guard,
                   Linear& linear) {
  const Directions<>& basis = linear.system.independent.basis;
  const Eigen::Index n = basis.cols(), inputs = std::ssize(linear.inputs);
  Eigen::Index varied = 0;
  for (const Varied& one : varied_by(subject)) varied += one.size;
  Directions<> of_start = Directions<>::Zero(basis.rows(), n + inputs),
               of_parameters = Directions<>::Zero(varied, n + inputs);
  of_start.leftCols(n) = basis;
  of_parameters.bottomRightCorner(inputs, inputs).setIdentity();  // inputs come last
  const std::array<double, 1> times = {linear.at.time + step};
  const Forward moved = move_variations({.subject = subject,
                                         .options = options,
                                         .start = linear.at,
                                         .times = times,
                                         .stop = [&] { return guard.interrupted(); }},
                                        of_start, of_parameters);
  if (!moved.outcome) throw io::InputError(message(moved.outcome, subject.coordinates(), subject.switches()));
  const Directions<> end = linear.system.independent.rows(moved.variations.front());
  linear.system.a = end.leftCols(n);
  linear.system.b = end.rightCols(inputs);
}

template <class Scenario>
Linear linear_of(const Scenario& scenario, const LinearizeOptions& options, const InterruptGuard& guard) {
  const std::shared_ptr<const Subject> subject = io::subject_of(scenario);
  const Motion start = scenario.start;
  Linear linear{.at = options.at == "equilibrium" ? equilibrium(*subject, start) : start,
                .all = state_names(*subject),
                .names = {},
                .inputs = input_names(*subject),
                .outputs = io::point_columns(*subject),
                .system = {},
                .c = {},
                .d = {},
                .step = {}};
  if (!options.step.empty()) {
    linear.step = io::number_or_quantity(options.step, "s", {.time = scenario.natural ? scenario.natural->time : 1});
    linear.system.independent = find_independent(*subject, linear.at);
    make_discrete(*subject, scenario.options, *linear.step, guard, linear);
  } else {
    linear.system = linearize(*subject, linear.at);
  }
  if (!linear.system.a.allFinite() || !linear.system.b.allFinite()) {
    throw io::InputError(options.scenario +
                         ": expected a state where the equations are regular, got one where they are not");
  }
  for (const Eigen::Index place : linear.system.independent.places) {
    linear.names.push_back(linear.all[static_cast<std::size_t>(place)]);
  }
  const io::RowSlopes slopes = io::row_slopes(*subject, linear.at, linear.outputs);
  linear.c = slopes.by_state * linear.system.independent.basis;
  linear.d = slopes.by_inputs;
  return linear;
}

std::vector<double> state_of(const Motion& motion) {
  std::vector<double> state(motion.q.begin(), motion.q.end());
  state.insert(state.end(), motion.v.begin(), motion.v.end());
  return state;
}

// Of x.
std::vector<double> state_of(const Linear& linear) {
  const std::vector<double> all = state_of(linear.at);
  const Directions<> found =
      linear.system.independent.rows(Eigen::VectorXd::Map(all.data(), static_cast<Eigen::Index>(all.size())));
  return {found.data(), found.data() + found.size()};
}

std::vector<std::vector<double>> rows_of(const Directions<>& matrix) {
  std::vector<std::vector<double>> rows;
  for (const auto& row : matrix.rowwise()) rows.emplace_back(row.begin(), row.end());
  return rows;
}

void print_json(const Linear& linear, const LinearizeOptions& options, const Eigen::VectorXcd& eigenvalues) {
  nlohmann::ordered_json json{{"scenario", options.scenario},
                              {"at", options.at},
                              {"step", nullptr},
                              {"t", linear.at.time},
                              {"names", linear.names},
                              {"inputs", linear.inputs},
                              {"state", state_of(linear)},
                              {"A", rows_of(linear.system.a)},
                              {"B", rows_of(linear.system.b)},
                              {"outputs", linear.outputs},
                              {"C", rows_of(linear.c)},
                              {"D", rows_of(linear.d)}};
  if (linear.step) json["step"] = *linear.step;
  if (linear.all != linear.names) {
    json["basis"] = {
        {"names", linear.all}, {"state", state_of(linear.at)}, {"T", rows_of(linear.system.independent.basis)}};
  }
  for (const std::complex<double>& one : eigenvalues) {
    const Swing swing = swing_of(one, linear.step);
    json["eigenvalues"].push_back({one.real(), one.imag()});
    json["frequencies"].push_back(swing.frequency);
    json["damping"].push_back(swing.damping);
  }
  std::cout << json.dump(2) << '\n';
}

void print_matrix(const Directions<>& matrix, const std::vector<std::string>& rows,
                  const std::vector<std::string>& columns) {
  constexpr int width = 14;
  std::size_t longest = 0;
  for (const std::string& name : rows) longest = std::max(longest, name.size());
  std::cout << std::string(longest, ' ');
  for (const std::string& name : columns) std::cout << std::setw(width) << name;
  std::cout << '\n';
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    const std::string& name = rows[static_cast<std::size_t>(i)];
    std::cout << name << std::string(longest - name.size(), ' ');
    for (const double number : matrix.row(i)) std::cout << std::setw(width) << rounded(number, 6);
    std::cout << '\n';
  }
}

void print_text(const Linear& linear, const Eigen::VectorXcd& eigenvalues) {
  std::cout << (linear.step ? "x(t + " + shortest(*linear.step) + ") = A x(t) + B u" : "dx/dt = A x + B u")
            << ", x a deviation from\n\n";
  const std::vector<double> state = state_of(linear.at);
  for (std::size_t k = 0; k < state.size(); ++k) {
    std::cout << "  " << std::left << std::setw(17) << linear.all[k] << shortest(state[k]) << '\n';
  }
  std::cout << std::right;
  if (linear.all != linear.names) {
    std::cout << "\nT, of their deviations T x: the constraints leave x free\n";
    print_matrix(linear.system.independent.basis, linear.all, linear.names);
  }
  std::cout << "\nA\n";
  print_matrix(linear.system.a, linear.names, linear.names);
  if (linear.system.b.cols() > 0) {
    std::cout << "\nB\n";
    print_matrix(linear.system.b, linear.names, linear.inputs);
  }
  if (linear.c.rows() > 0) {
    std::cout << "\nC, of y = C x\n";
    print_matrix(linear.c, linear.outputs, linear.names);
  }
  std::cout << "\neigenvalues of A                      frequency  damping ratio\n";
  const double smallest = 1e-13 * eigenvalues.cwiseAbs().maxCoeff();  // smaller ones are rounding
  for (const std::complex<double>& one : eigenvalues) {
    std::cout << std::setw(15) << (std::abs(one.real()) < smallest ? "0" : rounded(one.real(), 6));
    if (std::abs(one.imag()) > smallest) {
      const Swing swing = swing_of(one, linear.step);
      const double damping = std::abs(swing.damping) < 1e-12 ? 0 : swing.damping;
      const std::string imaginary = (one.imag() < 0 ? " - " : " + ") + rounded(std::abs(one.imag()), 6) + " i";
      std::cout << std::left << std::setw(17) << imaginary << std::right << std::setw(13) << rounded(swing.frequency, 6)
                << " Hz" << std::setw(12) << rounded(damping, 6);
    }
    std::cout << '\n';
  }
}

}  // namespace

ExitStatus linearize(const LinearizeOptions& options) {
  const InterruptGuard guard;
  const Linear linear = std::visit(
      [&](auto scenario) {
        scenario.signals.clear();  // they add to u, which is an input of the result
        return io::told_at_keys(scenario, options.scenario, [&] { return linear_of(scenario, options, guard); });
      },
      read_scenario(options.scenario, options.overrides, options.json));
  const Eigen::VectorXcd rates = eigenvalues(linear.system.a);
  if (options.json)
    print_json(linear, options, rates);
  else
    print_text(linear, rates);
  return done;
}

}  // namespace pendula::cli
