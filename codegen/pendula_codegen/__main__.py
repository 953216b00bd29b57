"""Command line: python -m pendula_codegen COMMAND …; COMMAND --help tells the rest."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from pendula_codegen.backends.llvm import INSTRUCTION_SETS
from pendula_codegen.chain import Chain
from pendula_codegen.chain_kernel import ChainKernel, declared_by
from pendula_codegen.comparison import Start, comparison
from pendula_codegen.counts import as_json, count_table
from pendula_codegen.describe import describe, describe_all
from pendula_codegen.drives import Drive, driven
from pendula_codegen.entry_points import Declared
from pendula_codegen.errors import GenerationError
from pendula_codegen.export import (
    LANGUAGES,
    MOST_COORDINATES,
    Request,
    Values,
    render_export,
    require_free,
    require_free_rates,
    require_size,
)
from pendula_codegen.feedback import SampledLaw, close_loops, sampled_laws, sampled_laws_of_chain
from pendula_codegen.fmu import DEFAULT_TOLERANCE, EQUATIONS, MARK, Runtime, packed_fmu
from pendula_codegen.kernel_program import render_bytecode, render_c, render_llvm
from pendula_codegen.links import LINKS, find_link
from pendula_codegen.model import Model, read_model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.models import find_model
from pendula_codegen.render import (
    Header,
    kernel_name,
    links_argument,
    render_kernel,
    render_link,
    render_model,
    render_tableaux,
    write_atomically,
)

COMMITTED = {"planar": range(1, 5), "spatial": range(1, 4)}


def main(arguments: list[str] | None = None) -> int:
    """Exit status 0; 2 with one line on standard error when the request or a model is wrong."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except GenerationError as error:
        print(f"pendula_codegen: error: {error}", file=sys.stderr)
        return 2
    return 0


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> None:  # one line, without the usage text
        self.exit(2, f"pendula_codegen: error: {message}\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="pendula_codegen", description="Generates pendula's C++ kernels from SymPy models.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    kernel = commands.add_parser("kernel", help="the dense kernel of a chain with a fixed number of links")
    kernel.add_argument("--space", required=True, help=f"model: {', '.join(LINKS)}")
    kernel.add_argument("--links", required=True, type=int, help="number of links, from 1")
    kernel.add_argument(
        "--paper-blocks", action="store_true", help="also the paper's A, B, C, S, h and g as functions"
    )
    kernel.set_defaults(run=_run_kernel)

    link = commands.add_parser("link", help="direction of one link and its derivatives")
    link.add_argument("--space", required=True, help=f"model: {', '.join(LINKS)}")
    link.set_defaults(run=_run_link)

    model = commands.add_parser("model", help="the kernel of a model file")
    model.add_argument(
        "--model", required=True, help="a file that defines define(model, links), or a built-in model's name"
    )
    model.add_argument("--links", type=int, help="number of links, from 1, where the model has links")
    model.add_argument("--alias", default="", help="a further name of its structure, for programs")
    model.set_defaults(run=_run_model)

    program = commands.add_parser("program", help="the kernel of a model as the program loads it")
    program.add_argument("--model", required=True, help="as of the command model")
    program.add_argument("--links", type=int, help="as of the command model")
    _add_feedback(program)
    program.add_argument(
        "--as",
        dest="language",
        choices=("c", "bytecode", "llvm"),
        default="c",
        help="bytecode is interpreted",
    )
    program.add_argument(
        "--for",
        dest="instruction_set",
        choices=[*INSTRUCTION_SETS],
        default="baseline",
        help="of what LLVM compiles",
    )
    program.add_argument("--output", required=True, type=Path, help="a file")
    program.set_defaults(run=_run_program)

    written = commands.add_parser(
        "written", help="what a model says at points about a start, for pendula check: numbers in a line"
    )
    written.add_argument("--model", required=True, help="as of the command model")
    written.add_argument("--links", type=int, help="as of the command model")
    for name, words in (
        ("parameters", "numbers of all parameters, those of links first"),
        ("q", "coordinates of the start"),
        ("v", "rates of the start"),
    ):
        written.add_argument(f"--{name}", required=True, type=_numbers, help=f"{words}, with commas")
    _add_feedback(written)
    written.add_argument("--time", required=True, type=float, help="of the start")
    written.add_argument("--seed", required=True, type=int, help="of the points")
    written.set_defaults(run=_run_written)

    export = commands.add_parser("export", help="a system in another program's language: NAME.h and NAME.c")
    export.add_argument("--model", help="as of the command model")
    export.add_argument("--space", help="of a chain, in place of a model")
    export.add_argument("--links", type=int, help="as of the command model; of a chain, its number")
    _add_feedback(export)
    export.add_argument(
        "--sampled",
        action="append",
        default=[],
        help="LIMIT=INPUT=WORDS, a law of a controller: see feedback.py",
    )
    export.add_argument("--as", dest="language", choices=[*LANGUAGES], default="c")
    export.add_argument("--name", required=True, help="what its names begin with")
    export.add_argument("--number", default="double", help="double or float")
    export.add_argument("--stages", type=int, default=2, help="of the Gauss step")
    for name in ("parameters", "inputs", "q", "v"):
        export.add_argument(f"--{name}", type=_numbers, help="numbers to begin with, with commas")
    export.add_argument("--time", type=float, default=0.0, help="to begin with")
    export.add_argument("--step", type=float, help="to begin with")
    export.add_argument("--duration", type=float, default=Values.duration, help="of an FMU's run, by default")
    export.add_argument("--library", type=Path, help="pendula's static library, which an FMU takes")
    export.add_argument("--headers", type=Path, help="the folder of pendula/pendula.h")
    export.add_argument("--flag", action="append", default=[], help="of the compiler, with that library")
    export.add_argument("--tolerance", type=float, default=DEFAULT_TOLERANCE, help="of adaptive steps")
    export.add_argument(
        "--drive",
        type=_numbers,
        action="append",
        default=[],
        help="link from 0, amplitude, frequency, phase of a chain's drive",
    )
    export.add_argument("--output", required=True, type=Path, help="a folder; of an FMU, or a .fmu file")
    export.set_defaults(run=_run_export)

    what = commands.add_parser("describe", help="what a model has, as JSON")
    what.add_argument("--model", required=True, help="as of model")
    what.add_argument("--links", type=int, help="as of model")
    what.set_defaults(
        run=lambda options: print(json.dumps(describe(find_model(options.model), options.links)))
    )

    everything = commands.add_parser("models", help="what the built-in models have, as JSON")
    everything.set_defaults(run=lambda _: print(json.dumps(describe_all())))

    tableaux = commands.add_parser("tableaux", help="Gauss–Legendre coefficients")
    tableaux.set_defaults(run=_run_tableaux)

    refresh = commands.add_parser("refresh", help="everything that the repository keeps, into a folder")
    refresh.set_defaults(run=_run_refresh)

    counts = commands.add_parser("counts", help="operation counts of what the repository keeps, as JSON")
    counts.set_defaults(run=_run_counts)
    counts.add_argument("--output", required=True, type=Path, help="a .json file")

    for command in (kernel, link, model, tableaux, refresh):
        command.add_argument(
            "--output", required=True, type=Path, help="a .hpp file, or a folder to put it in"
        )
    return parser


def _add_feedback(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--feedback",
        action="append",
        default=[],
        help="INPUT=WORDS, what is added to an input: see feedback.py",
    )


def _write(output: Path, name: str, header: Header) -> None:
    write_atomically(output if output.suffix == ".hpp" else output / name, header.text)


def _run_kernel(options: argparse.Namespace) -> None:
    header = render_kernel(options.space, options.links, options.paper_blocks)
    _write(options.output, f"{kernel_name(options.space, options.links)}.hpp", header)


def _run_link(options: argparse.Namespace) -> None:
    _write(options.output, f"{options.space}_link.hpp", render_link(options.space))


def _run_model(options: argparse.Namespace) -> None:
    model = _moved_model(options.model, options.links)
    _write(options.output, f"{model.name}.hpp", render_model(model, Path(options.model).name, options.alias))


def _moved_model(name: str, links: int | None = None) -> Model:
    model = read_model(find_model(name), links)
    model.move({})
    return model


def _run_program(options: argparse.Namespace) -> None:
    model = _fed_model(options)
    if options.language == "bytecode":
        text = render_bytecode(model)
    elif options.language == "llvm":
        text = render_llvm(model, options.instruction_set)
    else:
        text = render_c(model, Path(options.model).name, options.output.name)
    write_atomically(options.output, text)


def _fed_model(options: argparse.Namespace) -> Model:
    model = read_model(find_model(options.model), options.links)
    if options.feedback or model.motions:
        close_loops(model, options.feedback)
        model.system  # noqa: B018  the checks of the whole
    return model


def _run_export(options: argparse.Namespace) -> None:
    files = _exported_chain(options) if options.space is not None else _exported_model(options)
    is_file = options.language == "fmu" and options.output.suffix == ".fmu"
    for name, content in files.items():
        path = options.output if is_file else options.output / name
        _require_own(path)
        write_atomically(path, content)
        print(path)


def _exported_chain(options: argparse.Namespace) -> Mapping[str, str | bytes]:
    chain = Chain(find_link(options.space), 1 if options.links is None else options.links)
    drives = [Drive.of(numbers) for numbers in options.drive]
    wanted = _request(options, sampled_laws_of_chain(chain, options.sampled))
    command = f"--space {options.space} --links {chain.links} {_export_words(options)} --output ."

    def equations(request: Request) -> dict[str, str]:
        require_size(len(chain.coordinates))
        return render_export(ChainKernel(driven(chain, drives)), request, command, options.space)

    if options.language != "fmu":
        return equations(wanted)
    return _fmu(options, wanted, declared_by(chain), equations, chain=chain, drives=drives)


def _exported_model(options: argparse.Namespace) -> Mapping[str, str | bytes]:
    model = _fed_model(options)
    require_free_rates(model.constraints)
    if options.language != "fmu":
        require_free(model.constraints)
    wanted = _request(options, sampled_laws(model, options.sampled))
    command = f"--model {Path(options.model).name}{links_argument(model)} {_export_words(options)} --output ."
    kernel, file = ModelKernel(model), Path(model.file)

    def equations(request: Request) -> dict[str, str]:
        return render_export(kernel, request, command, None, file)

    if options.language != "fmu":
        return equations(wanted)
    own = render_c(model, Path(options.model).name, "kernel.c")
    return _fmu(options, wanted, kernel.declared, equations, kernel=own)


def _fmu(
    options: argparse.Namespace,
    request: Request,
    declared: Declared,
    equations: Callable[[Request], dict[str, str]],
    **moved: object,
) -> dict[str, bytes]:
    """An FMU of what is `moved`, fields of Runtime; `equations` are written out where they are not too many."""
    if options.library is None or options.headers is None:
        raise GenerationError("export: expected --library and --headers with fmu, got none")
    request.check()
    runtime = Runtime(options.library, options.headers, options.flag, options.tolerance, **moved)
    is_written_out = len(declared.coordinates) <= MOST_COORDINATES and not declared.forces
    texts = equations(replace(request, name=EQUATIONS)) if is_written_out else {}
    return {f"{options.name}.fmu": packed_fmu(declared, request, runtime, texts)}


def _request(options: argparse.Namespace, laws: list[SampledLaw]) -> Request:
    values = Values(
        options.parameters, options.inputs, options.q, options.v, options.time, options.step, options.duration
    )
    return Request(options.name, options.language, options.number, options.stages, values, laws)


def _export_words(options: argparse.Namespace) -> str:
    """The options of an export, besides what is exported and where to."""
    words = [
        f"--as {options.language} --name {options.name} --stages {options.stages} --number {options.number}"
    ]
    words += [
        f"--{key}={shlex.quote(law)}" for key in ("feedback", "sampled") for law in getattr(options, key)
    ]
    for key in ("parameters", "inputs", "q", "v"):
        numbers = getattr(options, key)
        words += [f"--{key}={','.join(map(repr, numbers))}"] if numbers else []
    words += [f"--drive={','.join(map(repr, numbers))}" for numbers in options.drive]
    words += [f"--time {options.time!r}"] if options.time else []
    words += [f"--step {options.step!r}"] if options.step else []
    words += [f"--duration {options.duration!r}"] if options.duration != Values.duration else []
    return " ".join(words)


def _require_own(path: Path) -> None:
    """Raises GenerationError if the path has something that was not generated: that is not overwritten."""
    if path.is_dir() or (path.exists() and MARK not in path.read_bytes()):
        raise GenerationError(f"export: expected a new file, or one that was exported before, got {path}")


def _run_written(options: argparse.Namespace) -> None:
    model = _fed_model(options)
    start = Start(options.parameters, options.time, options.q, options.v)
    print(comparison(model, start, options.seed))


def _numbers(text: str) -> list[float]:
    return [float(number) for number in text.split(",") if number]


def _run_tableaux(options: argparse.Namespace) -> None:
    _write(options.output, "gauss_tableaux.hpp", render_tableaux())


def _run_refresh(options: argparse.Namespace) -> None:
    for name, header in committed_headers().items():
        write_atomically(options.output / name, header.text)


def _run_counts(options: argparse.Namespace) -> None:
    write_atomically(options.output, as_json(count_table(committed_headers())))


def committed_headers() -> dict[str, Header]:
    """File name and header of every header that the repository keeps under generated/."""
    kernels = {
        f"{kernel_name(space, links)}.hpp": render_kernel(space, links, paper_blocks=True)
        for space, numbers in COMMITTED.items()
        for links in numbers
    }
    links = {f"{space}_link.hpp": render_link(space) for space in COMMITTED}
    linkage = {"four_bar.hpp": render_model(_moved_model("four_bar"), "four_bar")}
    return {**kernels, **links, **linkage, "gauss_tableaux.hpp": render_tableaux()}


if __name__ == "__main__":
    sys.exit(main())
