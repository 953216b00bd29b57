#include "view/encode.hpp"

#include <nlohmann/json.hpp>

namespace pendula::view {

void append_base64(std::string& text, std::string_view bytes) {
  constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  text.reserve(text.size() + (bytes.size() + 2) / 3 * 4);
  const auto byte = [&](std::size_t k) { return k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0U; };
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const unsigned group = byte(k) << 16U | byte(k + 1) << 8U | byte(k + 2);
    text += digits[group >> 18U];
    text += digits[group >> 12U & 63U];
    text += k + 1 < bytes.size() ? digits[group >> 6U & 63U] : '=';
    text += k + 2 < bytes.size() ? digits[group & 63U] : '=';
  }
}

std::string script_json(const nlohmann::json& value) {
  std::string text;
  for (const char c : value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

std::string html_text(std::string_view text) {
  // Through JSON and back, which replaces bytes that are not UTF-8.
  const std::string mended =
      nlohmann::json::parse(nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  std::string html;
  for (const char c : mended) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      case '\0':
        html += "\xEF\xBF\xBD";
        break;
      default:
        html += c;
    }
  }
  return html;
}

}  // namespace pendula::view
