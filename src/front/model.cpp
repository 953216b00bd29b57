#include "front/model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/assembly.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/no_kernel.hpp>
#include <pendula/run/quantity.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/c_kernel.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <pendula/system/system_table.hpp>
#include <pendula/version.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "front/errors.hpp"

namespace pendula::front {
namespace {

/// Parameters in the order of derivatives with respect to them (run/derivatives.hpp).
std::vector<Constant> parameters_of(const Subject& subject) {
  std::vector<Constant> constants = subject.constants();
  if (dynamic_cast<const SystemSubject*>(&subject) != nullptr) return constants;
  constants.resize(4);  // masses, lengths, gravity and damping of a chain; its torques are inputs
  std::swap(constants[2], constants[3]);
  return constants;
}

}  // namespace
}  // namespace pendula::front

pendula_model::pendula_model(std::shared_ptr<const pendula::Subject> moved, std::size_t coordinate_count)
    : subject(std::move(moved)),
      coordinates(coordinate_count),
      inputs(input_names(*subject)),
      names(subject->columns()),
      units(names.size()) {
  for (const pendula::Quantity& quantity : subject->quantities()) {
    for (std::size_t k = 0; k < quantity.size(); ++k) units[quantity.column(k)] = quantity.unit;
  }
  for (const pendula::Constant& constant : pendula::front::parameters_of(*subject)) {
    for (std::size_t k = 0; k < constant.values.size(); ++k) {
      parameter_names.push_back(constant.per_link ? constant.name + "_" + std::to_string(k + 1) : constant.name);
      parameter_units.push_back(constant.unit);
      parameters.push_back(constant.values[k]);
    }
  }
}

namespace pendula::front {
namespace {

template <class Space>
pendula_model* make_chain(const pendula_chain& given) {
  if (given.links < 1) throw std::invalid_argument("links: expected at least 1, got " + std::to_string(given.links));
  if (given.masses == nullptr || given.lengths == nullptr) {
    throw std::invalid_argument("masses, lengths: expected a number for each link, got none");
  }
  const auto links = static_cast<std::size_t>(given.links);
  const std::vector<double> none(links * Space::torque_components);
  std::vector<PlainChain::Drive> drives;
  for (const pendula_drive& drive : std::span(given.drives, given.drive_count)) {
    PlainChain::Drive& added = drives.emplace_back(PlainChain::Drive{drive.link, {}, drive.frequency, drive.phase});
    std::copy_n(drive.amplitude, Space::torque_components, added.amplitude);
  }
  const PlainChain plain{given.links,
                         given.gravity,
                         given.masses,
                         given.lengths,
                         given.damping == nullptr ? none.data() : given.damping,
                         given.torque == nullptr ? none.data() : given.torque,
                         drives};
  return new pendula_model(std::make_shared<ChainSubject<Space>>(chain_of<Space>(plain)), Space::dof * links);
}

pendula_model* make_system(std::shared_ptr<const SystemTable> table, std::span<const double> parameters,
                           std::span<const double> inputs) {
  const std::size_t coordinates = table->info.coordinates.size();
  SystemNumbers numbers{{parameters.begin(), parameters.end()}, {inputs.begin(), inputs.end()}, {}};
  if (inputs.empty()) numbers.inputs.assign(table->info.inputs.size(), 0.0);
  return new pendula_model(std::make_shared<SystemSubject>(std::move(table), std::move(numbers)), coordinates);
}

/// A table that outlives all models.
std::shared_ptr<const SystemTable> borrowed(const SystemTable& table) {
  return {std::shared_ptr<void>(), &table};
}

/// The default parameters of a model. Throws std::invalid_argument if one has no default.
std::vector<double> defaults_of(const SystemInfo& info) {
  std::vector<double> numbers;
  for (std::size_t k = 0; k < info.own_parameters(); ++k) {
    if (std::isnan(info.parameter_defaults[k])) {
      throw std::invalid_argument("parameters: expected a number for " + std::string(info.parameters[k]) +
                                  ", which the model has no default for");
    }
    numbers.insert(numbers.end(), static_cast<std::size_t>(info.parameter_sizes[k]), info.parameter_defaults[k]);
  }
  return numbers;
}

std::vector<double> numbers_or_defaults(const SystemInfo& info, const double* given, std::size_t count) {
  return given == nullptr ? defaults_of(info) : std::vector<double>(given, given + count);
}

const SystemTable* find_system(const std::string& name, int links) {
  std::string built;
  for (const SystemTable* table : library<KernelList<Models>>().tables) {
    if (table->info.model == name && (links == 0 || table->info.links == links)) return table;
    built += (built.empty() ? "" : ", ") + std::string(table->info.name);
  }
  throw NoKernel("no kernel for the model " + name + (links > 0 ? " of " + std::to_string(links) + " links" : "") +
                 " in this build; it has " + (built.empty() ? "none" : built));
}

[[noreturn]] void refuse(const std::string& name, double number) {
  throw std::invalid_argument(name + ": expected a finite number, got " + shortest(number));
}

void require_finite(const pendula_model& model, const Motion& motion) {
  if (!std::isfinite(motion.time)) refuse("t", motion.time);
  if (motion.q.allFinite() && motion.v.allFinite()) return;
  Eigen::Index coordinate = 0, rate = 0;
  for (const Quantity& quantity : model.subject->quantities()) {
    if (quantity.role != Role::coordinate && quantity.role != Role::rate) continue;
    for (std::size_t k = 0; k < quantity.size(); ++k) {
      const double number = quantity.role == Role::coordinate ? motion.q[coordinate++] : motion.v[rate++];
      if (!std::isfinite(number)) refuse(model.names[quantity.column(k)], number);
    }
  }
}

}  // namespace

Motion motion_of(const pendula_model& model, double time, const double* q, const double* v) {
  if (q == nullptr)
    throw std::invalid_argument("q: expected " + std::to_string(model.coordinates) + " numbers, got none");
  const auto count = static_cast<Eigen::Index>(model.coordinates);
  using Numbers = Eigen::Map<const Eigen::VectorXd>;
  Motion motion{time, Numbers(q, count), Numbers(q, count)};
  motion.v = v == nullptr ? Eigen::VectorXd(Eigen::VectorXd::Zero(count)) : Numbers(v, count);
  require_finite(model, motion);
  return motion;
}

void write(const Motion& motion, double* q, double* v) {
  if (q != nullptr) std::ranges::copy(motion.q, q);
  if (v != nullptr) std::ranges::copy(motion.v, v);
}

std::shared_ptr<const Subject> holding(const pendula_model& model, const double* inputs) {
  return inputs == nullptr ? model.subject : with_inputs(model.subject, {inputs, model.inputs.size()});
}

void write_row(const Subject& subject, const Motion& motion, double* row) {
  std::vector<double> numbers;
  subject.append_row(motion, subject.observe(motion), numbers);
  std::ranges::copy(numbers, row);
}

extern "C" {

const char* pendula_version(void) {
  return version.data();
}

const char* pendula_instruction_set(void) {
  return made([] { return instruction_set().data(); });
}

pendula_model* pendula_model_of_chain(const pendula_chain* chain) {
  return made([&]() -> pendula_model* {
    if (chain->dimension == 2) return make_chain<Planar>(*chain);
    if (chain->dimension == 3) return make_chain<Spatial>(*chain);
    throw std::invalid_argument("dimension: expected 2 or 3, got " + std::to_string(chain->dimension));
  });
}

pendula_model* pendula_model_named(const char* name, int links, const double* parameters, size_t count) {
  return made([&] {
    const SystemTable& table = *find_system(name, links);
    return make_system(borrowed(table), numbers_or_defaults(table.info, parameters, count), {});
  });
}

pendula_model* pendula_model_of_table(const void* table, const double* parameters, size_t parameter_count,
                                      const double* inputs, size_t input_count) {
  return made([&] {
    return make_system(borrowed(*static_cast<const SystemTable*>(table)), {parameters, parameter_count},
                       {inputs, input_count});
  });
}

pendula_model* pendula_model_of_kernel(const void* kernel, const double* parameters, size_t count) {
  return made([&] {
    if (kernel == nullptr) throw std::invalid_argument("kernel: expected the address of one, got none");
    std::shared_ptr<const SystemTable> table = table_of(*static_cast<const CKernel*>(kernel), nullptr);
    const std::vector<double> numbers = numbers_or_defaults(table->info, parameters, count);
    return make_system(std::move(table), numbers, {});
  });
}

pendula_model* pendula_model_of_program(const char* text, const double* parameters, size_t count) {
  return made([&] {
    std::shared_ptr<const SystemTable> table = table_of(text, *library<const ProgramInterpreter*>());
    const std::vector<double> numbers = numbers_or_defaults(table->info, parameters, count);
    return make_system(std::move(table), numbers, {});
  });
}

pendula_model* pendula_model_driven(const pendula_model* model, size_t input, double amplitude, double frequency,
                                    double phase) {
  return made([&] {
    const auto* system = dynamic_cast<const SystemSubject*>(model->subject.get());
    if (system == nullptr) throw std::invalid_argument("model: expected one that is no chain, got a chain");
    if (!std::isfinite(amplitude) || !std::isfinite(frequency) || !std::isfinite(phase)) {
      throw std::invalid_argument("drive: expected a finite amplitude, frequency and phase, got another number");
    }
    SystemNumbers numbers = system->numbers();
    numbers.sines.push_back({input < model->inputs.size() ? static_cast<int>(input) : -1, amplitude, frequency, phase});
    const std::shared_ptr<const SystemTable> table(model->subject, &system->table());
    return new pendula_model(std::make_shared<SystemSubject>(table, std::move(numbers)), model->coordinates);
  });
}

void pendula_model_free(pendula_model* model) {
  delete model;
}

size_t pendula_coordinates(const pendula_model* model) {
  return model->coordinates;
}
size_t pendula_inputs(const pendula_model* model) {
  return model->inputs.size();
}
const char* pendula_input_name(const pendula_model* model, size_t input) {
  return input < model->inputs.size() ? model->inputs[input].c_str() : nullptr;
}
size_t pendula_columns(const pendula_model* model) {
  return model->names.size();
}
const char* pendula_column_name(const pendula_model* model, size_t column) {
  return column < model->names.size() ? model->names[column].c_str() : nullptr;
}
const char* pendula_column_unit(const pendula_model* model, size_t column) {
  return column < model->units.size() ? model->units[column].c_str() : nullptr;
}

size_t pendula_parameters(const pendula_model* model) {
  return model->parameters.size();
}
const char* pendula_parameter_name(const pendula_model* model, size_t parameter) {
  return parameter < model->parameters.size() ? model->parameter_names[parameter].c_str() : nullptr;
}
const char* pendula_parameter_unit(const pendula_model* model, size_t parameter) {
  return parameter < model->parameters.size() ? model->parameter_units[parameter].c_str() : nullptr;
}
void pendula_parameter_values(const pendula_model* model, double* values) {
  std::ranges::copy(model->parameters, values);
}

pendula_status pendula_energies(const pendula_model* model, double time, const double* q, const double* v,
                                double* energies) {
  return guarded([&] {
    const Observation seen = model->subject->observe(motion_of(*model, time, q, v));
    energies[0] = seen.kinetic;
    energies[1] = seen.potential();
    return PENDULA_OK;
  });
}

pendula_status pendula_assemble(const pendula_model* model, double time, const int* kept, double* q, double* v) {
  return guarded([&] {
    Motion motion = motion_of(*model, time, q, v);
    const auto* system = dynamic_cast<const SystemSubject*>(model->subject.get());
    if (system == nullptr) return PENDULA_OK;
    std::vector<bool> free(model->coordinates, true);
    if (kept != nullptr) std::transform(kept, kept + free.size(), free.begin(), std::logical_not<>());
    const std::string left = bring_back(*system, free, motion);
    if (!left.empty()) throw std::invalid_argument("expected a motion that keeps the constraints, got " + left);
    write(motion, q, v);
    return PENDULA_OK;
  });
}

pendula_status pendula_row(const pendula_model* model, double time, const double* q, const double* v,
                           const double* inputs, double* row) {
  return guarded([&] {
    write_row(*holding(*model, inputs), motion_of(*model, time, q, v), row);
    return PENDULA_OK;
  });
}
}

}  // namespace pendula::front
