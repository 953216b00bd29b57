// The module that the Python package stands on (python/pendula).

#include "bindings.hpp"

#include <pendula/pendula.h>

#include <exception>

#include "io/errors.hpp"
#include "io/kernel_cache.hpp"

namespace nb = nanobind;

NB_MODULE(_core, module) {
  using namespace pendula;
  nb::set_leak_warnings(false);  // of threads that run when Python ends: nobody can help that
  module.def("version", &pendula_version);
  module.def("instruction_set", &pendula_instruction_set);
  nb::exception<io::InputError>(module, "InputError", PyExc_ValueError);  // NOLINT(bugprone-unused-raii)
  nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
    try {
      std::rethrow_exception(thrown);
    } catch (const io::ModelError& error) {
      PyErr_SetString(nb::module_::import_("pendula._core").attr("InputError").ptr(), error.what());
    }
  });
  python::define_runs(module);
  python::define_files(module);
  python::define_models(module);
  python::define_prepared(module);
  python::define_simulations(module);
  python::define_ensembles(module);
  python::define_derivatives(module);
}
