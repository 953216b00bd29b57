#pragma once

#include <cmath>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <pendula/chain/chain.hpp>
#include <pendula/run/system_subject.hpp>
#include <ranges>
#include <span>
#include <string>
#include <string_view>
#include <vector>

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

/// Adds inputs: constant parts, and sines on them, four numbers each.
void put_inputs(LabLink& link, std::span<const double> held, std::span<const InputSine> sines);

/// A chain without a state. Its torques are its inputs, link by link.
template <class Space>
LabLink lab_link(const Chain<Space>& chain) {
  LabLink link;
  link.put("n", chain.links());
  link.put("space", Space::dimension);
  link.put("m", chain.masses());
  link.put("l", chain.lengths());
  link.put("g", chain.gravity());
  link.put("d", chain.damping()[0]);
  const auto& torque = chain.constant_torque();
  std::vector<InputSine> sines;
  for (const Drive<Space>& drive : chain.drives()) {
    for (int k = 0; k < Space::torque_components; ++k) {
      sines.push_back({(drive.link * Space::torque_components) + k, drive.amplitude[k], drive.frequency, drive.phase});
    }
  }
  put_inputs(link, {torque.data(), static_cast<std::size_t>(torque.size())}, sines);
  return link;
}

/// Properties of a chain that a laboratory leaves out or changes, in words; the bounds are those of
/// src/view/lab/spec.js.
template <class Space>
std::vector<std::string> lab_leaves_out(const Chain<Space>& chain) {
  constexpr int most_links = 300;
  constexpr double most_gravity = 100, most_damping = 1000, most_size = 1e6;
  std::vector<std::string> words;
  const auto damping = chain.damping().array();
  if (chain.links() > most_links) words.push_back("links after the " + std::to_string(most_links) + "th");
  if ((damping != damping[0]).any()) words.emplace_back("damping of single links: all have that of the first");
  if (chain.is_held()) words.emplace_back("what holds the last bob");
  if (std::abs(chain.gravity()) > most_gravity) words.emplace_back("gravity beyond 100");
  if (damping[0] > most_damping) words.emplace_back("damping beyond 1000");
  if ((chain.masses().array() >= most_size).any() || (chain.lengths().array() >= most_size).any()) {
    words.emplace_back("masses or lengths of a million and more");
  }
  return words;
}

/// A system without a state: parameters and inputs. The link goes with `lab_model`.
LabLink lab_link(const SystemSubject& system);

/// The start of a laboratory that moves a model by its program: "model" and "program".
nlohmann::json lab_model(const SystemInfo& info, std::string program);

/// The page of a laboratory, in which motion is computed: one HTML file that needs nothing else. `start`
/// (docs/reference/laboratory.md) has "title", and "state", the words of a link; for a model "program" and "model",
/// too.
std::string lab_page(const nlohmann::json& start);

}  // namespace pendula::view
