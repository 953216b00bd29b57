#pragma once

#include <array>
#include <cstddef>
#include <pendula/model.hpp>
#include <pendula/system/kernel_table.hpp>
#include <pendula/system/system.hpp>

namespace pendula {

/// A model of a generated kernel: model<kernels::Sprung2>({.masses = {1, 1}, …}). All functions of the kernel are
/// compiled here.
template <System Kernel>
Model model(typename Kernel::template Parameters<double> parameters,
            const typename Kernel::template Inputs<double>* inputs = nullptr) {
  constexpr auto count = static_cast<std::size_t>(parameter_count<Kernel>());
  std::array<double*, count + 1> places{};
  Kernel::template parameter_places<double>(parameters, places.data());
  std::array<double, count + 1> numbers{};
  for (std::size_t k = 0; k < count; ++k) numbers[k] = *places[k];
  return Model(pendula_model_of_table(&system_table<Kernel>, numbers.data(), count,
                                      inputs == nullptr ? nullptr : inputs->data(),
                                      inputs == nullptr ? 0 : Kernel::input_names.size()));
}

}  // namespace pendula
