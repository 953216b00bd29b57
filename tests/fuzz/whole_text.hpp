#pragma once

#include <fstream>
#include <iterator>
#include <string>

namespace pendula::fuzz {

inline std::string whole_text(const char* file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace pendula::fuzz
