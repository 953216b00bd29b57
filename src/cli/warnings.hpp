#pragma once

#include <iostream>
#include <string>
#include <utility>
#include <vector>

namespace pendula::cli {

/// What is odd about a run but no error: sentences, each told on standard error as it comes and kept for the summary.
class Warnings {
 public:
  explicit Warnings(bool told) : told_(told) {}

  void add(std::string sentence) {
    if (told_) std::cerr << "pendula: warning: " << sentence << '\n';
    sentences_.push_back(std::move(sentence));
  }

  const std::vector<std::string>& sentences() const { return sentences_; }

 private:
  bool told_;
  std::vector<std::string> sentences_;
};

}  // namespace pendula::cli
