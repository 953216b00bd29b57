"""Kernels as LLVM's text: the steps of tapes for 1, 2, 4 and 8 states, in registers as wide as a processor has them.

The table of a kernel and the order of operations are the same as in C (templates/kernel.c.j2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate

from pendula_codegen.backends.c import INTERFACE, SELDOM
from pendula_codegen.backends.llvm_functions import functions_of, library_declarations
from pendula_codegen.backends.llvm_loops import factorization, iteration, rows_of_eight, solution
from pendula_codegen.backends.llvm_series import series_next, series_start
from pendula_codegen.backends.llvm_steps import Steps
from pendula_codegen.backends.llvm_text import LlvmFunction
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.table import CONDITIONS, KernelTable, TableFunction

WIDTHS = (1, 2, 4, 8)
_AVX2 = "+avx2,+fma"
# For each instruction set of the library: numbers in a register, and LLVM's names of the instructions.
INSTRUCTION_SETS = {
    "baseline": (2, ""),
    "sse2": (2, "-sse3"),
    "avx2": (4, _AVX2),
    "avx512": (8, f"{_AVX2},+avx512f,+avx512cd,+avx512dq,+avx512bw,+avx512vl"),
}


def print_kernel(table: KernelTable, size: int, description: Sequence[str], instruction_set: str) -> str:
    """The kernel of a model with `size` coordinates; `description` has the lines of its description."""
    most, features = INSTRUCTION_SETS[instruction_set]
    used = table.operations()
    of_many, plain = ([_written_out(one) for one in functions] for functions in (table.of_many, table.plain))
    parts = library_declarations()
    for width in sorted({min(most, states) for states in WIDTHS}):
        parts += functions_of(width, used)
        if size > UNROLLED:
            parts += [factorization(width, size), solution(width, size)]
    for states in WIDTHS:
        width = min(most, states)
        parts += rows_of_eight(states) if states < 8 else []
        for function in filter(None, of_many):
            seldom = states in SELDOM.get(function.name, ())
            parts.append(_by_eight(table, function, states) if seldom else _function(function, states, width))
        parts.append(_iteration(of_many[0], states, width, size))
        parts += [series_start(table, states, width), series_next(table, states, width, most)]
    parts += [_function(function, 1, 1) for function in filter(None, plain)]
    target = f' "target-cpu"="x86-64" "target-features"="{features}"' if features else ""
    parts += [*_tables(table, description), f"attributes #0 = {{ nounwind{target} }}"]
    parts.append("attributes #1 = { nounwind willreturn memory(none) }")
    return "\n\n".join(parts) + "\n"


def _written_out(function: TableFunction | None) -> TableFunction | None:
    """The same with small linear systems in products and sums."""
    return function and replace(function, tape=function.tape.written_out(UNROLLED))


def _tables(table: KernelTable, description: Sequence[str]) -> list[str]:
    def list_of(
        name: str, functions: Sequence[TableFunction | None], states: int, more: Sequence[str]
    ) -> str:
        entries = [f"ptr @{function.name}_{states}" if function else "ptr null" for function in functions]
        return (
            f"@{name} = internal constant [{len(entries) + len(more)} x ptr] [{', '.join([*entries, *more])}]"
        )

    text = "".join(f"{line}\n" for line in description).encode() + b"\0"
    written = "".join(chr(c) if 32 <= c < 127 and c not in b'"\\' else f"\\{c:02X}" for c in text)
    functions = ", ".join(f"ptr @functions_{states}" for states in WIDTHS)
    more = ("iterate", "series_start", "series_next")
    kinds = f"{{ i32, ptr, [{len(WIDTHS)} x ptr], ptr }}"
    return [
        *(list_of(f"functions_{n}", table.of_many, n, [f"ptr @{name}_{n}" for name in more]) for n in WIDTHS),
        list_of("plain_functions", table.plain, 1, []),
        f'@description = internal constant [{len(text)} x i8] c"{written}"',
        f"@pendula_kernel = constant {kinds} {{ i32 {INTERFACE}, ptr @description, "
        f"[{len(WIDTHS)} x ptr] [{functions}], ptr @plain_functions }}",
    ]


def _head(function: TableFunction, states: int) -> str:
    arrays = [f"ptr noalias readonly %{name}" for name in function.takes]
    arrays += [f"ptr noalias %{name}" for name in function.gives]
    return f"internal void @{function.name}_{states}(ptr readonly %at, {', '.join(arrays)})"


def _by_eight(table: KernelTable, function: TableFunction, states: int) -> str:
    """A function of few states that calls that of eight, with some states repeated."""
    f = LlvmFunction(_head(function, states), 1)
    taken = [table.rows[array] for array in (*CONDITIONS, *function.takes)]
    given = [[name for name, _ in function.tape.outputs].count(array) for array in function.gives]
    *starts, rows = accumulate((*taken, *given), initial=0)
    wide, there = f.slot("double", 8 * rows), f.slot("ptr", 1 + len(CONDITIONS))
    places = [f.place(wide, 8 * start) for start in starts]
    arrays = [f.pointer("%at", 1 + k) for k in range(len(CONDITIONS))] + [
        f"%{name}" for name in function.takes
    ]
    f.line(f"store ptr {f.pointer('%at', 0)}, ptr {there}")
    for k, place in enumerate(places[: len(CONDITIONS)]):
        f.line(f"store ptr {place}, ptr {f.let(f'getelementptr inbounds ptr, ptr {there}, i64 {1 + k}')}")
    for array, count, place in zip(arrays, taken, places, strict=False):
        f.line(f"call fastcc void @widen_{states}(ptr {array}, i64 {count}, ptr {place})")
    passed = ", ".join(f"ptr {place}" for place in (there, *places[len(CONDITIONS) :]))
    f.line(f"call void @{function.name}_8({passed})")
    for array, count, place in zip(function.gives, given, places[len(taken) :], strict=True):
        f.line(f"call fastcc void @narrow_{states}(ptr {place}, i64 {count}, ptr %{array})")
    f.line("ret void")
    return f.text()


def _function(function: TableFunction, states: int, width: int) -> str:
    f = LlvmFunction(_head(function, states), width)
    with f.each_register(states) as lane:
        steps = Steps(f, states, lane)
        steps.carry_out(function.tape)
        steps.write(function.tape.outputs)
    f.line("ret void")
    return f.text()


def _iteration(hamiltonian_form: TableFunction, states: int, width: int, size: int) -> str:
    def form(f: LlvmFunction, lane: int | str, reached: list[str]) -> list[str]:
        given = {
            (array, k): reached[first + k] for array, first in (("q", 0), ("p", size)) for k in range(size)
        }
        steps = Steps(f, states, lane, given)
        steps.carry_out(hamiltonian_form.tape)
        outputs = hamiltonian_form.tape.outputs
        return [steps.names[outputs[array, k]] for array in ("v", "f") for k in range(size)]

    head = f"internal {{ double, double }} @iterate_{states}(ptr readonly %at, ptr readonly %on)"
    return iteration(LlvmFunction(head, width), states, size, form)
