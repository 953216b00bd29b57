#pragma once

#include <Python.h>
#include <nanobind/nanobind.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <string>
#include <vector>

#include "io/scenario.hpp"
#include "io/toolchain.hpp"

/// Scenarios' texts that were read: what runs, simulations and ensembles begin with.
namespace pendula::python {

namespace nb = nanobind;

using Tell = nb::typed<nb::callable, void(const std::string&)>;

/// Where models are found, and what is told before a kernel is made: by Python, whose lock others have meanwhile.
/// `program` is where the program is in the Python package: it tells where the generator is. `python` runs that.
class Models {
 public:
  Models(const std::string& program, const std::string& python, const Tell& tell);

  io::FindSystem finder();
  const std::string& by() const { return by_; }

 private:
  io::Toolchain toolchain_;
  std::string by_ = "build";
  const Tell& tell_;
};

/// A system, its start and how it is moved, as a scenario says: what simulations and ensembles begin with.
struct Prepared {
  io::AnyScenario scenario;  // it owns the kernel
  std::shared_ptr<const Subject> subject;
  Motion start;
  RunOptions options;
  std::vector<std::string> warnings;
};

/// What a scenario says.
std::shared_ptr<Prepared> prepared(io::AnyScenario any);

}  // namespace pendula::python
