#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace pendula::view {

/// Whether this build has the laboratory: it takes emscripten.
bool has_lab();

/// The page of a laboratory, in which motion is computed: one HTML file that needs nothing else. `start` is what it
/// begins with (docs/reference/laboratory.md): "title", and "state", the words of a link; of a model besides
/// "program" and "model".
std::string lab_page(const nlohmann::json& start);

}  // namespace pendula::view
