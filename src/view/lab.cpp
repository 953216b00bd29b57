#include "view/lab.hpp"

#include <nlohmann/json.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/version.hpp>
#include <string_view>

#include "view/assets.hpp"
#include "view/encode.hpp"
#include "view/template.hpp"

namespace pendula::view {
namespace {

/// A script of another kind, whose text nothing in it may end.
std::string worker_text() {
  return script_json(std::string(assets::lab_worker));
}

}  // namespace

void LabLink::begin(std::string_view key) {
  if (!text_.empty()) text_ += '&';
  text_.append(key) += '=';
}
void LabLink::add(double number) {
  if (text_.back() != '=') text_ += ',';
  text_ += shortest(number);
}

bool has_lab() {
  return !assets::lab_module.empty();
}

std::string lab_page(const nlohmann::json& start) {
  return filled(assets::lab_page, [&](std::string_view name) -> std::string {
    if (name == "title") return html_text(start.value("title", "Pendulum laboratory"));
    if (name == "version") return std::string(version);
    if (name == "style") return std::string(assets::lab_style);
    if (name == "script") return std::string(assets::lab_script);
    if (name == "start") return script_json(start);
    if (name == "texts") return std::string(assets::lab_texts);
    if (name == "models") return script_json(nlohmann::json::parse(assets::lab_models));
    if (name == "worker") return worker_text();
    std::string module;
    append_base64(module, assets::lab_module);
    return module;
  });
}

}  // namespace pendula::view
