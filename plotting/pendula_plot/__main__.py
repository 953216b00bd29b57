"""python -m pendula_plot: what `pendula plot`, `pendula gallery` and `simulate --video` call."""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

REQUIREMENTS = Path(__file__).resolve().parents[1] / "requirements.txt"
ROOT = REQUIREMENTS.parents[1]
# Of an install, or of a checkout.
SETUP = next((path for path in (ROOT / "setup", ROOT / "scripts/setup") if path.exists()), "scripts/setup")

try:
    import h5py  # noqa: F401
    import matplotlib as mpl
    import PIL  # noqa: F401

    from .errors import PlotError, told_of_numbers
    from .run import read_run
except ImportError as missing:
    print(
        f"pendula: pictures take a Python with the packages of {REQUIREMENTS}, which {SETUP} installs; "
        f"{sys.executable}: {missing} (PENDULA_PYTHON names another one)",
        file=sys.stderr,
    )
    sys.exit(2)


def plot(arguments: argparse.Namespace) -> None:
    from .drawing import draw, read
    from .figure import Choice, write
    from .motion import trouble
    from .run import Run

    output = Path(arguments.output)
    paths = [Path(run) for run in arguments.runs]
    if any(output.exists() and path.exists() and output.samefile(path) for path in paths):
        raise PlotError(f"{output}: expected a file for the picture, got a run itself")
    files = [read(path).between(arguments.start, arguments.end) for path in paths]
    choice = Choice(
        tuple(filter(None, arguments.show.split(","))),
        tuple(filter(None, arguments.coordinates.split(","))),
        arguments.wrapped,
        tuple(filter(None, arguments.phase.split(","))),
        arguments.event,
    )
    for run in files:
        if isinstance(run, Run) and (told := trouble(run)):
            print(f"pendula: warning: {told}", file=sys.stderr)
    with told_of_numbers(files[0].name):
        write(draw(files, choice), output)


def draw_map(arguments: argparse.Namespace) -> None:
    from .figure import write
    from .map import MapChoice, figure, read

    contour, _, level = arguments.contour.rpartition("=")
    choice = MapChoice(arguments.scale, float(level) if contour else None)
    ensemble = read(Path(arguments.file), arguments.key, contour)
    with told_of_numbers(ensemble.name):
        write(figure(ensemble, choice), Path(arguments.output))


def film(arguments: argparse.Namespace) -> None:
    from .film import check, write

    check(Path(arguments.output))
    if not arguments.runs:
        return
    runs = [read_run(Path(run)).between(arguments.start, arguments.end) for run in arguments.runs]
    with told_of_numbers(runs[0].name):
        write(runs, Path(arguments.output), arguments.fps, arguments.size, arguments.speed)


def gallery(arguments: argparse.Namespace) -> None:
    from .gallery import write

    write(Path(arguments.folder), Path(arguments.scenarios), arguments.program, arguments.only)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="pendula_plot")
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("plot")
    command.add_argument("runs", nargs="+")
    command.add_argument("--output", required=True)
    command.add_argument("--show", default="")
    command.add_argument("--coordinates", default="")
    command.add_argument("--from", dest="start", type=float, default=float("-inf"))
    command.add_argument("--to", dest="end", type=float, default=float("inf"))
    command.add_argument("--wrapped", action="store_true")
    command.add_argument("--phase", default="")
    command.add_argument("--event", default="")
    command.set_defaults(run_command=plot)
    command = commands.add_parser("map")
    command.add_argument("file")
    command.add_argument("key")
    command.add_argument("--output", required=True)
    command.add_argument("--scale", default="", choices=("", "log", "linear"))
    command.add_argument("--contour", default="")
    command.set_defaults(run_command=draw_map)
    command = commands.add_parser("film")
    command.add_argument("runs", nargs="*", help="none: only look whether a film of that name can be made")
    command.add_argument("--output", required=True)
    command.add_argument("--fps", type=float, default=30)
    command.add_argument("--size", type=int, default=640)
    command.add_argument("--speed", type=float, default=1)
    command.add_argument("--from", dest="start", type=float, default=float("-inf"))
    command.add_argument("--to", dest="end", type=float, default=float("inf"))
    command.set_defaults(run_command=film)
    command = commands.add_parser("gallery")
    command.add_argument("folder")
    command.add_argument("--scenarios", required=True)
    command.add_argument("--program", required=True)
    command.add_argument("--only", default="")
    command.set_defaults(run_command=gallery)
    return parser.parse_args()


def main() -> int:
    arguments = parse()
    mpl.rcdefaults()  # whatever a matplotlibrc of the working folder says
    mpl.use("agg")
    warnings.simplefilter("ignore")  # of NumPy and Matplotlib, about numbers that are large
    try:
        arguments.run_command(arguments)
    except PlotError as error:
        print(f"pendula: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
