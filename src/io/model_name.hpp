#pragma once

#include <compare>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pendula::io {

/// Continuous feedback: a kernel adds its value to an input wherever that input occurs in forces.
struct InputLaw {
  std::string input;
  std::string value;  ///< an expression in coordinates, rates, points and time, as codegen's feedback.py reads it

  auto operator<=>(const InputLaw&) const = default;
};

/// A model as scenarios and commands name it.
struct ModelName {
  std::string model;  ///< a file ending in .py, or a built-in model
  // NOLINTBEGIN(readability-redundant-member-init): left out in initializers
  std::optional<int> links = {};      ///< empty if nothing says how many
  std::filesystem::path folder = {};  ///< the file is relative to this one
  std::vector<InputLaw> laws = {};
  // NOLINTEND(readability-redundant-member-init)

  auto operator<=>(const ModelName&) const = default;
};

/// The name of the model's kernel: cart_chain_2.
inline std::string kernel_name(const ModelName& name) {
  const std::string stem = std::filesystem::path(name.model).stem().string();
  return name.links ? stem + "_" + std::to_string(*name.links) : stem;
}

}  // namespace pendula::io
