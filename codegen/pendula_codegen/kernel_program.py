"""Kernels of models as programs that the runtime loads."""

from __future__ import annotations

from pathlib import Path

from pendula_codegen.backends.bytecode import function_lines
from pendula_codegen.backends.c import CALLS, INTERFACE, print_functions, print_plain, quoted
from pendula_codegen.backends.c_series import print_series
from pendula_codegen.backends.llvm import print_kernel
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.model import Model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.render import ENVIRONMENT, banner, links_argument
from pendula_codegen.system_info import info_lines
from pendula_codegen.table import kernel_table, series_functions


def render_c(model: Model, source: str, file: str) -> str:
    """The kernel of a model in C, for a file of this name; `source` is how the banner names the model's."""
    kernel = ModelKernel(model)
    table = kernel_table(kernel)
    used = table.operations()
    return ENVIRONMENT.get_template("kernel.c.j2").render(
        banner=banner(
            f"Kernel of the system {model.name}, in C.",
            "program",
            None,
            f"--model {source}{links_argument(model)} --output {file}",
            Path(model.file),
        ),
        file=file,
        interface=INTERFACE,
        widths=(1, 2, 4, 8),
        unrolled=UNROLLED,
        size=len(model.coordinates),
        description=[quoted(line) for line in info_lines(kernel, table.series)],
        functions=print_functions(table),
        plain=print_plain(table),
        series=print_series(table.series, table.names),
        inputs=len(model.inputs),
        used=used,
        calls=sorted(used & CALLS),
    )


def render_bytecode(model: Model) -> str:
    """The kernel of a model for the interpreter: a line of words with tabs between them for each thing it says."""
    kernel = ModelKernel(model)
    table = kernel_table(kernel)
    functions = [
        function for function in (*table.of_many, *table.plain, *series_functions(table.series)) if function
    ]
    lines = [
        f"program\t{INTERFACE}",
        *info_lines(kernel, table.series),
        *(line for function in functions for line in function_lines(function)),
        "end",
    ]
    return "\n".join(lines) + "\n"


def render_llvm(model: Model, instruction_set: str) -> str:
    """The kernel of a model as LLVM's text, for an instruction set of the library."""
    kernel = ModelKernel(model)
    table = kernel_table(kernel)
    return print_kernel(table, len(model.coordinates), info_lines(kernel, table.series), instruction_set)
