#include "toolchain.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "interruption.hpp"
#include "io/process.hpp"

namespace pendula::python {
namespace {

std::optional<io::Ended> generate(const std::string& codegen, const std::string& python,
                                  const std::vector<std::string>& arguments) {
  const nb::gil_scoped_acquire lock;
  const nb::object found = nb::module_::import_("pendula._generator").attr("generate")(codegen, python, arguments);
  auto ended = nb::cast<std::optional<std::pair<int, std::string>>>(found);
  if (!ended) return std::nullopt;
  return io::Ended{ended->first, std::move(ended->second)};
}

}  // namespace

io::Toolchain toolchain_of(const std::string& program, const std::string& python) {
  io::Toolchain toolchain = io::Toolchain::of(program);
  toolchain.python = python;
  toolchain.ask = heed_signals;
  toolchain.generate = [codegen = toolchain.codegen.string(), python](const std::vector<std::string>& arguments) {
    return generate(codegen, python, arguments);
  };
  return toolchain;
}

}  // namespace pendula::python
