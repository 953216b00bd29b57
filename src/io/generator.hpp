#pragma once

#include <filesystem>
#include <pendula/system/motion.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/model_name.hpp"
#include "io/toolchain.hpp"

/// Model files, and the generator in Python that reads them. Failures throw ModelError.
namespace pendula::io {

/// The file of a model.
std::filesystem::path find_model(const ModelName& name, const Toolchain& toolchain);

/// The text of a model file.
std::string read_model(const std::filesystem::path& file);

/// Arguments for a generator command on a model.
std::vector<std::string> about(const char* command, const ModelName& name, const Toolchain& toolchain);

/// Runs the generator and returns its output. Fails, too, if there is no suitable Python.
std::string run_generator(const std::vector<std::string>& arguments, const Toolchain& toolchain);

/// Values of a model's functions at a start, as the generator derives them from the model's text; KernelComparison
/// compares a kernel with them. `parameters` are those of the kernel.
std::vector<double> written_values(const ModelName& name, const Toolchain& toolchain,
                                   std::span<const double> parameters, const Motion& start, unsigned seed);

/// Coordinates, parameters, inputs and points of a model with their units, as JSON.
std::string describe_model(const ModelName& name, const Toolchain& toolchain);

/// The same for all built-in models, as a JSON array.
std::string describe_models(const Toolchain& toolchain);

/// Names of the built-in models.
std::vector<std::string> built_in_models(const Toolchain& toolchain);

}  // namespace pendula::io
