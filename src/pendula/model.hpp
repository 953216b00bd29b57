#pragma once

#include <pendula/pendula.h>

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <pendula/c_error.hpp>
#include <pendula/chain/chain.hpp>
#include <pendula/system/motion.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pendula {

/// A system with its parameters: a chain, a built-in model, or one of your own. Immutable; copies share it.
class Model {
 public:
  /// From a chain.
  template <class Space, int N>
  Model(const Chain<Space, N>& chain) : Model(of_chain(chain)) {}  // NOLINT(google-explicit-constructor)

  /// A built-in model, such as "cart_chain", with the given parameters, concatenated, or with its default ones if there
  /// are none. Throws NoKernel if this build does not have it, std::invalid_argument for a wrong number of parameters.
  explicit Model(const std::string& name, int links = 0, std::span<const double> parameters = {})
      : Model(pendula_model_named(name.c_str(), links, parameters.empty() ? nullptr : parameters.data(),
                                  parameters.size())) {}

  /// Takes ownership of a model of the C interface; if it is null, throws what pendula_error() says.
  explicit Model(pendula_model* model) : model_(detail::made(model), pendula_model_free) {}

  std::size_t coordinates() const { return pendula_coordinates(get()); }
  std::size_t inputs() const { return pendula_inputs(get()); }

  /// Names of the inputs; for a chain its torques, link by link: "torque_1", in space "torque_x_1".
  std::vector<std::string> input_names() const {
    std::vector<std::string> names(inputs());
    for (std::size_t k = 0; k < names.size(); ++k) names[k] = pendula_input_name(get(), k);
    return names;
  }

  /// Names of the columns of a row: t, coordinates, rates, inputs, points, energy.
  std::vector<std::string> columns() const {
    std::vector<std::string> names(pendula_columns(get()));
    for (std::size_t k = 0; k < names.size(); ++k) names[k] = pendula_column_name(get(), k);
    return names;
  }

  /// The row of a motion.
  std::vector<double> row(const Motion& motion) const {
    require(motion);
    std::vector<double> numbers(pendula_columns(get()));
    detail::require(pendula_row(get(), motion.time, motion.q.data(), motion.v.data(), nullptr, numbers.data()));
    return numbers;
  }

  /// One number of the row of a motion, by the name of its column. Throws std::invalid_argument for an unknown name.
  double number(std::string_view column, const Motion& motion) const {
    return row(motion)[detail::place_of("column", column, columns())];
  }

  /// Throws std::invalid_argument unless a motion has the right number of coordinates and rates.
  void require(const Motion& motion) const {
    detail::require_size("q", static_cast<std::size_t>(motion.q.size()), coordinates());
    detail::require_size("v", static_cast<std::size_t>(motion.v.size()), coordinates());
  }

  /// The same model with amplitude sin(frequency t + phase) added to an input. Throws std::invalid_argument for an
  /// unknown name, and for a chain, which has drives of its own.
  Model driven(std::string_view input, double amplitude, double frequency, double phase = 0) const {
    const std::size_t place = detail::place_of("input", input, input_names());
    return Model(pendula_model_driven(get(), place, amplitude, frequency, phase));
  }

  pendula_model* get() const { return model_.get(); }

 private:
  template <class Space, int N>
  static pendula_model* of_chain(const Chain<Space, N>& chain) {
    std::vector<pendula_drive> drives;
    for (const Drive<Space>& drive : chain.drives()) {
      drives.push_back({drive.link, {}, drive.frequency, drive.phase});
      for (int k = 0; k < Space::torque_components; ++k) drives.back().amplitude[k] = drive.amplitude[k];
    }
    const pendula_chain plain{
        Space::dimension, chain.links(),          chain.masses().data(),          chain.lengths().data(),
        chain.gravity(),  chain.damping().data(), chain.constant_torque().data(), drives.data(),
        drives.size()};
    return pendula_model_of_chain(&plain);
  }

  std::shared_ptr<pendula_model> model_;
};

}  // namespace pendula
