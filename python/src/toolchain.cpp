#include "toolchain.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <pendula/system/c_kernel.hpp>
#include <stdexcept>
#include <string_view>
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

nb::object jit(const char* function) {
  return nb::module_::import_("pendula._jit").attr(function);
}

const CKernel* load(std::string_view object) {
  const nb::gil_scoped_acquire lock;
  const nb::object found = jit("load")(nb::bytes(object.data(), object.size()));
  if (nb::isinstance<nb::str>(found)) throw std::invalid_argument(nb::cast<std::string>(found));
  return reinterpret_cast<const CKernel*>(nb::cast<std::uintptr_t>(found));
}

io::Llvm llvm() {
  return {.is_there =
              [] {
                const nb::gil_scoped_acquire lock;
                return nb::cast<bool>(jit("is_there")());
              },
          .compile =
              [](const std::filesystem::path& text, const std::filesystem::path& object) {
                const nb::gil_scoped_acquire lock;
                return nb::cast<std::string>(jit("compile_text")(text.string(), object.string()));
              },
          .load = load};
}

}  // namespace

io::Toolchain toolchain_of(const std::string& program, const std::string& python) {
  io::Toolchain toolchain = io::Toolchain::of(program);
  toolchain.python = python;
  toolchain.ask = heed_signals;
  toolchain.generate = [codegen = toolchain.codegen.string(), python](const std::vector<std::string>& arguments) {
    return generate(codegen, python, arguments);
  };
  toolchain.llvm = llvm();
  return toolchain;
}

}  // namespace pendula::python
