"""Headers from kernels: the one Jinja environment, the one banner, files written whole or not at all."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import jinja2
from sympy import Expr

from pendula_codegen import __version__
from pendula_codegen.backends import cpp
from pendula_codegen.backends.cpp import Counts
from pendula_codegen.backends.cpp_series import kernel_series, render_series, series_constants
from pendula_codegen.chain import Chain
from pendula_codegen.chain_kernel import ChainKernel
from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.errors import GenerationError
from pendula_codegen.linear_solve import UNROLLED, solve_lines
from pendula_codegen.link import LinkKernel
from pendula_codegen.links import find_link
from pendula_codegen.model import Connection, Constraint, Coordinate, Input, Model, Parameter
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.system_info import depends_on_time, has_constant_masses, is_periodic
from pendula_codegen.tableau import DIGITS, MATRICES, MAX_STAGES, RADAU_STAGES, VECTORS, gauss, radau

PACKAGE = Path(__file__).parent

ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FileSystemLoader(PACKAGE / "templates"),
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
ENVIRONMENT.globals.update(
    signature=cpp.signature, using=cpp.using_declarations, solve_lines=solve_lines, unrolled=UNROLLED
)


@dataclass(frozen=True)
class Header:
    """A generated header, and what its functions cost."""

    text: str
    counts: Mapping[str, Counts] = field(default_factory=dict)


# Sources that only some kinds of headers are made from; all others go into each. Those of no kind write none.
KINDS = {
    "backends/bytecode.py": {"program"},
    "backends/c.py": {"program"},
    **{
        f"backends/{name}.py": {"program"}
        for name in ("llvm", "llvm_functions", "llvm_loops", "llvm_series", "llvm_steps", "llvm_text")
    },
    "backends/c99.py": {"export"},
    "backends/c_series.py": {"program"},
    "backends/cpp_series.py": {"kernel", "model"},
    "blocks.py": {"export", "kernel"},
    "casadi_face.py": {"export"},
    "chain.py": {"export", "kernel"},
    "chain_kernel.py": {"export", "kernel"},
    "entry_points.py": {"export", "kernel", "model", "program"},
    "fmu.py": set(),
    "forward.py": {"export", "program"},
    "kernel_program.py": {"program"},
    "linear_solve.py": {"export", "kernel", "model", "program"},
    "mechanics.py": {"export", "kernel", "model", "program"},
    "recording.py": {"export", "program"},
    "series.py": {"kernel", "model", "program"},
    "series_graph.py": {"kernel", "model", "program"},
    "series_next.py": {"kernel", "model", "program"},
    "series_start.py": {"kernel", "model", "program"},
    "series_tape.py": {"kernel", "model", "program"},
    "simplify.py": {"export", "kernel", "model", "program"},
    "system_info.py": {"kernel", "model", "program"},
    "table.py": {"program"},
    "tape.py": {"export", "kernel", "model", "program"},
    "templates/kernel.hpp.j2": {"kernel", "model"},
    "comparison.py": set(),
    "export.py": {"export"},
    "exact.py": {"export", "model", "program"},
    "model.py": {"export", "model", "program"},
    "model_kernel.py": {"export", "model", "program"},
    "link.py": {"link"},
    "templates/link.hpp.j2": {"link"},
    "tableau.py": {"export", "tableaux"},
    "written.py": set(),
    "templates/gauss_tableaux.hpp.j2": {"tableaux"},
    **{
        f"templates/export{name}.j2": {"export"}
        for name in (".c", ".h", "_solve.c", "_pieces.c", "_casadi.c")
    },
    **{f"templates/export_fmu{name}.j2": set() for name in (".c", ".xml")},
    **{
        f"templates/{name}.c.j2": {"program"}
        for name in ("kernel", "sincos", "exp", "log", "solve", "iterate", "series")
    },
    "__main__.py": set(),
    "counts.py": set(),
    "describe.py": set(),
}


def inputs_hash(kind: str, model: str | None, file: Path | None = None) -> str:
    """SHA-256 (16 digits) over the sources of a header of `kind`, of a link model or a model file among them."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*")):
        name = path.relative_to(PACKAGE).as_posix()
        if path.suffix not in (".py", ".j2") or kind not in KINDS.get(name, {kind}):
            continue
        if path.parent.name == "models" or (
            path.parent.name == "links" and path.stem not in ("__init__", model)
        ):
            continue
        digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    if file is not None:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def banner(title: str, kind: str, model: str | None, arguments: str, file: Path | None = None) -> str:
    return (
        f"// {title}\n"
        f"// Generated by pendula_codegen {__version__} with SymPy {version('sympy')}, "
        f"mpmath {version('mpmath')}; inputs {inputs_hash(kind, model, file)}.\n"
        f"// Do not edit; make it again with:\n"
        f"//   PYTHONPATH=codegen python -m pendula_codegen {kind} {arguments}\n"
    )


def kernel_name(space: str, links: int) -> str:
    return f"{space}_{links}"


@dataclass(frozen=True)
class Words:
    """What a kernel says of itself, and what people are told of it.

    struct    what its structure is called
    about     lines of its documentation
    sizes     names and values of integer constants
    types     names of further types, and what they are, in C++
    fields    of the structure Parameters
    number    what that calls the type of a number
    bases     of what functions are taken of, whether it is a base
    switches  what decides between pieces of functions
    held      what moves it
    kinds     of points, and what is drawn between them, where the system says so
    alias     a further name of the structure
    own       names that somebody else has chosen, and that stand in the header as they are
    """

    name: str
    model: str
    struct: str
    banner: str
    about: list[str]
    sizes: dict[str, int]
    coordinates: list[Coordinate]
    parameters: list[Parameter]
    inputs: list[Input]
    points: list[tuple[str, int]]  # name, components
    types: dict[str, str]
    fields: list[str]
    holds_time: bool = False
    has_hamiltonian: bool = False
    number: str = "Real"
    bases: list[bool] = field(default_factory=list)
    switches: list[str] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    held: list[Expr] = field(default_factory=list)
    alias: str = ""
    own: list[str] = field(default_factory=list)


def render_kernel(space: str, links: int, paper_blocks: bool = False) -> Header:
    """<space>_<links>.hpp; raises GenerationError on an unknown space or links < 1."""
    return render_chain(ChainKernel(Chain(find_link(space), links), paper_blocks))


def render_chain(kernel: ChainKernel) -> Header:
    chain, model, n = kernel.chain, kernel.chain.model, kernel.chain.links
    name = kernel_name(model.name, n)
    plural = "" if n == 1 else "s"
    declared = kernel.declared
    number = len(chain.coordinates)
    words = Words(
        name=name,
        model=model.name,
        struct=cpp.struct_name(name),
        banner=banner(
            f"Kernel of the {model.name} chain with {n} link{plural}.",
            "kernel",
            model.name,
            f"--space {model.name} --links {n}{' --paper-blocks' if kernel.paper_blocks else ''} "
            f"--output {name}.hpp",
        ),
        about=[
            f"Pure functions of the {model.name} chain with {n} link{plural}.",
            "",
            "Arguments of all functions (SI units):",
            "  chain    masses m_i (kg), lengths l_i (m), damping λ_i (N m s), gravity g (m/s²)",
            f"  q, v, a  angles (rad), rates (rad/s), accelerations (rad/s²), ({number}): "
            + ", ".join(q.name for q in chain.coordinates),
            f"  p        momenta conjugate to q, ({number}) (N m s)",
            f"  torque   torque on each link at the time in question, ({len(model.torque)} x {n}) (N m)",
        ],
        sizes={
            "links": n,
            "dof": model.dof,
            "dimension": model.dimension,
            "coordinates": number,
            "torque_components": len(model.torque),
        },
        coordinates=declared.coordinates,
        parameters=declared.parameters,
        inputs=declared.inputs,
        points=declared.points,
        types={
            "LinkVector": cpp.matrix("links", 1),
            "LinkMatrix": cpp.matrix("links", "links"),
            "Points": cpp.matrix("dimension", "links"),
            "Inputs": cpp.matrix("torque_components", "links"),
            "Torque": "Inputs<Real>",
        },
        fields=["LinkVector<Real> masses, lengths, damping;", "Real gravity;"],
        has_hamiltonian=True,
        held=[kernel.system.lagrangian, *kernel.system.forces],
    )
    return _render(kernel, words)


def render_model(model: Model, source: str, alias: str = "") -> Header:
    """The header of a model; `source` is how the banner names its file, `alias` a further name of its structure."""
    kernel = ModelKernel(model)
    declared = kernel.declared
    ordered = declared.parameters
    inputs, points = len(model.inputs), sum(count for _, count in declared.points)
    names = [c.symbol.name for c in model.coordinates]
    holds_time = depends_on_time(model)
    bases = [is_base for _, is_base in kernel.call_arguments]
    switches = [switch.text for switch in model.switches]
    words = Words(
        name=model.name,
        model=Path(model.file).stem,
        struct=f"{model.name}_kernel",
        banner=banner(
            f"Kernel of the system {model.name}.",
            "model",
            None,
            f"--model {source}{links_argument(model)}{f' --alias {alias}' if alias else ''} --output {model.name}.hpp",
            Path(model.file),
        ),
        about=[
            f"Pure functions of the system {model.name}.",
            "",
            "Arguments of all functions:",
            "  parameters  what the model declares, by name" + ("; time, s" if holds_time else ""),
            f"  q, v, a     coordinates, rates, accelerations, ({len(names)}): {', '.join(names)}",
            f"  p           momenta conjugate to q, ({len(names)})",
            f"  inputs      at the time in question, ({inputs})",
            *_about_switches(switches),
        ],
        sizes={"links": model.links, "coordinates": len(names), "point_components": points},
        coordinates=model.coordinates,
        parameters=ordered,
        inputs=model.inputs,
        points=declared.points,
        types={
            "Points": cpp.matrix("point_components", 1),
            "Inputs": cpp.matrix(inputs, 1),
            **({"Arguments": cpp.matrix(len(bases), 1)} if bases else {}),
            **({"Switches": cpp.matrix(len(switches), 1)} if switches else {}),
            **(_constraint_types(len(model.constraints), len(names)) if model.constraints else {}),
        },
        fields=[cpp.parameter_field(parameter) for parameter in ordered],
        holds_time=holds_time,
        number="_real",
        bases=bases,
        switches=switches,
        kinds=[point.kind for point in model.points],
        connections=model.connections,
        constraints=model.constraints,
        held=model.held_expressions(),
        alias=alias,
        own=[parameter.name for parameter in ordered] + [alias] * bool(alias),
    )
    return _render(kernel, words)


def _constraint_types(count: int, coordinates: int) -> dict[str, str]:
    return {"Constraints": cpp.matrix(count, 1), "ConstraintSlopes": cpp.matrix(count, coordinates)}


def _about_switches(switches: Sequence[str]) -> list[str]:
    if not switches:
        return []
    return [
        "",
        "Functions of several pieces: above_k is 1 and below_k 0 where the switching function k is > 0, else the other",
        "way round. A step has to end where one of them is 0, and the next one to begin with the other numbers:",
        *(f"  {k}  {switch}" for k, switch in enumerate(switches, start=1)),
    ]


def _render(kernel: SystemKernel, words: Words) -> Header:
    periodic = [c.is_angle and is_periodic(words.held, c.symbol) for c in words.coordinates]
    functions = [cpp.render_function(kernel, function) for function in kernel.functions()]
    tapes = kernel_series(kernel)
    if tapes is not None:
        functions += render_series(kernel, tapes)
    text = ENVIRONMENT.get_template("kernel.hpp.j2").render(
        words=words,
        struct=words.struct,
        constants=[
            *cpp.constants(
                words.coordinates,
                words.parameters,
                words.inputs,
                words.points,
                has_constant_masses(kernel),
                periodic,
                words.bases,
                words.switches,
                words.kinds,
                words.connections,
                words.constraints,
            ),
            *(series_constants(tapes) if tapes is not None else []),
        ],
        assignments=cpp.read_statements(words.parameters),
        places=cpp.place_statements(words.parameters),
        casts=cpp.cast_statements(words.parameters, words.holds_time),
        functions=functions,
        size=len(kernel.system.coordinates),
    )
    return Header(text, {function.name: function.counts for function in functions})


def links_argument(model: Model) -> str:
    """What a banner says of a model's number of links."""
    return f" --links {model.links}" if model.name != Path(model.file).stem else ""


def render_link(space: str) -> Header:
    """<space>_link.hpp."""
    kernel = LinkKernel(find_link(space))
    functions = kernel.render()
    text = ENVIRONMENT.get_template("link.hpp.j2").render(
        banner=banner(
            f"One link of the {space} chain.", "link", space, f"--space {space} --output {space}_link.hpp"
        ),
        model=kernel.model,
        struct=f"{space.capitalize()}Link",
        names=kernel.index_names(),
        trig=kernel.trig_names(),
        angles=kernel.angles(),
        functions=functions,
    )
    return Header(text, {function.name: function.body.counts for function in functions})


def render_tableaux() -> Header:
    """gauss_tableaux.hpp."""
    return Header(
        ENVIRONMENT.get_template("gauss_tableaux.hpp.j2").render(
            banner=banner(
                f"Gauss–Legendre methods with 1 to {MAX_STAGES} stages.",
                "tableaux",
                None,
                "--output gauss_tableaux.hpp",
            ),
            tableaux=[*map(gauss, range(1, MAX_STAGES + 1)), *map(radau, RADAU_STAGES)],
            vectors=VECTORS,
            matrices=MATRICES,
            digits=DIGITS,
        )
    )


def write_atomically(path: Path, text: str | bytes) -> None:
    """Writes the whole file or leaves what was there; raises GenerationError where it cannot write."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except FileExistsError as error:
        raise GenerationError(f"cannot write {path}: {path.parent} is not a folder") from error
    except OSError as error:
        raise GenerationError(f"cannot write {path}: {error.strerror}") from error
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(text if isinstance(text, bytes) else text.encode())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        Path(temporary).unlink(missing_ok=True)
        raise GenerationError(f"cannot write {path}: {error.strerror}") from error
