#pragma once

#include <nlohmann/json_fwd.hpp>
#include <pendula/chain/chain.hpp>
#include <ranges>
#include <string>
#include <string_view>

namespace pendula::view {

/// The words of a link to a laboratory: `n=2&m=1,1`.
class LabLink {
 public:
  template <std::ranges::range Numbers>
  void put(std::string_view key, const Numbers& numbers) {
    begin(key);
    for (const double number : numbers) add(number);
  }
  void put(std::string_view key, double number) {
    begin(key);
    add(number);
  }
  const std::string& text() const { return text_; }

 private:
  void begin(std::string_view key);
  void add(double number);

  std::string text_;
};

/// What a chain is, without a state.
template <class Space>
LabLink lab_link(const Chain<Space>& chain) {
  LabLink link;
  link.put("n", chain.links());
  link.put("space", Space::dimension);
  link.put("m", chain.masses());
  link.put("l", chain.lengths());
  link.put("g", chain.gravity());
  link.put("d", chain.damping()[0]);
  return link;
}

/// Whether a laboratory leaves out torques and drives of a chain, or damping of single links.
template <class Space>
bool lab_leaves_out_loads(const Chain<Space>& chain) {
  return chain.constant_torque().any() || !chain.drives().empty();
}
template <class Space>
bool lab_leaves_out_damping(const Chain<Space>& chain) {
  return (chain.damping().array() != chain.damping()[0]).any();
}

/// Whether this build has the laboratory: it takes emscripten.
bool has_lab();

/// The page of a laboratory, in which motion is computed: one HTML file that needs nothing else. `start` is what it
/// begins with (docs/reference/laboratory.md): "title", and "state", the words of a link; of a model besides
/// "program" and "model".
std::string lab_page(const nlohmann::json& start);

}  // namespace pendula::view
