#pragma once

#include <Python.h>
#include <nanobind/nanobind.h>

/// What each file of bindings adds to the module.
namespace pendula::python {

void define_prepared(nanobind::module_& module);
void define_runs(nanobind::module_& module);
void define_files(nanobind::module_& module);
void define_models(nanobind::module_& module);
void define_simulations(nanobind::module_& module);
void define_ensembles(nanobind::module_& module);
void define_derivatives(nanobind::module_& module);

}  // namespace pendula::python
