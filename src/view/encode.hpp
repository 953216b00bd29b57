#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace pendula::view {

/// The bytes of consecutive numbers, lowest byte first, as on every machine that runs a browser.
class Bytes {
 public:
  template <std::floating_point Real>
  void add(Real number) {
    using Bits = std::conditional_t<sizeof(Real) == 8, std::uint64_t, std::uint32_t>;
    static_assert(sizeof(Real) == sizeof(Bits));
    const Bits bits = std::bit_cast<Bits>(number);
    for (std::size_t k = 0; k < sizeof(Bits); ++k) bytes_ += static_cast<char>((bits >> (8 * k)) & 0xff);
  }

  std::string_view view() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Appends `bytes` in base64 (RFC 4648, padded).
void append_base64(std::string& text, std::string_view bytes);

/// Text escaped for HTML, to stand between tags; bytes that are not UTF-8 become U+FFFD.
std::string html_text(std::string_view text);

/// JSON escaped for a <script>: nothing in it closes or opens a tag or a comment.
std::string script_json(const nlohmann::json& value);

/// A text in which {{name}} is replaced by part(name).
template <class Part>
std::string filled(std::string_view text, const Part& part) {
  std::string filled;
  for (std::size_t begin = text.find("{{"); begin != std::string_view::npos; begin = text.find("{{")) {
    const std::size_t end = text.find("}}", begin);
    filled += text.substr(0, begin);
    filled += part(std::string(text.substr(begin + 2, end - begin - 2)));
    text.remove_prefix(end + 2);
  }
  return filled += text;
}

}  // namespace pendula::view
