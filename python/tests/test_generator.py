"""The generator in the process of Python: what it leaves as it was, and when another process runs it instead."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pendula
import pytest

MODEL = """
import os
from sympy import cos

def define(model, links):
    theta = model.coordinate("theta", "rad")
    model.parameter(f"made_by_{os.getpid()}", "1", default=1.0)
    model.lagrangian = model.rate(theta) ** 2 / 2 + 9.81 * cos(theta)
"""
BEGIN = """
import os, sys, pendula
from pathlib import Path
def maker(file):
    return int(next(iter(pendula.Model(file).parameters)).removeprefix("made_by_"))
file = Path("own.py")
"""


def run(tmp_path, code: str, **environment: str) -> str:
    """What a script says, with a cache of its own and a model in own.py."""
    (tmp_path / "own.py").write_text(MODEL)
    given = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PENDULA_KERNELS_BY": "interpreter"}
    given.pop("PENDULA_PYTHON", None)
    done = subprocess.run(
        [sys.executable, "-B", "-c", BEGIN + code],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**given, **environment},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_runs_here_and_leaves_things_as_they_are(tmp_path):
    code = """
import mpmath
mpmath.mp.dps = 5
before = [*sys.path], sys.stdout, sys.stderr
assert maker(file) == os.getpid()
assert ([*sys.path], sys.stdout, sys.stderr) == before and mpmath.mp.dps == 5
assert Path(sys.modules["pendula_codegen"].__file__).parts[-2] == "pendula_codegen"
print("done")
"""
    assert run(tmp_path, code) == "done\n"


def test_it_runs_here_by_any_sympy_of_the_range(tmp_path):
    code = """
import mpmath, sympy
sympy.__version__, mpmath.__version__ = "1.11.1", "1.10.0a1"
assert maker(file) == os.getpid()
print("done")
"""
    assert run(tmp_path, code) == "done\n"


def test_it_runs_in_the_python_that_is_asked_for(tmp_path):
    other = tmp_path / "python"
    other.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    other.chmod(0o755)
    code = "assert maker(file) != os.getpid() and 'sympy' not in sys.modules; print('done')"
    assert run(tmp_path, code, PENDULA_PYTHON=str(other)) == "done\n"


@pytest.mark.parametrize(
    "before",
    [
        "import sympy; sympy.__version__ = '1.9'",
        "import types; sys.modules['sympy'] = types.ModuleType('sympy')",
        "import types; sys.modules['jinja2'] = types.ModuleType('jinja2')",
        "import types; sys.modules['pendula_codegen'] = types.ModuleType('pendula_codegen')",
    ],
    ids=["another SymPy", "no SymPy", "no Jinja", "another generator"],
)
def test_it_runs_elsewhere_where_packages_here_are_others(before, tmp_path):
    code = f"{before}\nassert maker(file) != os.getpid(); print('done')"
    assert run(tmp_path, code).splitlines()[-1] == "done"


def test_a_generator_that_has_changed_since_it_was_imported_runs_elsewhere(tmp_path):
    code = """
import shutil
from pendula import _generator
seen, generate = [], _generator.generate
_generator.generate = lambda codegen, *more: seen.append(codegen)
maker(file)
shutil.copytree(seen[0], "codegen")
ask = lambda: generate("codegen", sys.executable, ["describe", "--model", "furuta"])
assert ask()[0] == 0
os.utime("codegen/pendula_codegen/model.py", (1, 1))
assert ask() is None
print("done")
"""
    assert run(tmp_path, code) == "done\n"


def test_a_model_that_ends_the_process_does_not(tmp_path):
    file = tmp_path / "own.py"
    for end in ("raise SystemExit(3)", "import sys; sys.exit('no more')"):
        file.write_text(f"{end}\n{MODEL}")
        with pytest.raises(pendula.InputError, match=r"own.py:1: expected a model that lets Python go on"):
            _ = pendula.Model(file).coordinates


def test_what_a_model_prints_is_not_seen_and_what_others_print_is(tmp_path, capsys):
    """A model waits until another thread has printed."""
    file, begun, told = tmp_path / "own.py", tmp_path / "begun", tmp_path / "told"
    file.write_text(
        "import sys, time\nfrom pathlib import Path\n"
        "print('of the model')\nsys.stdout.buffer.write(b'\\xff')\n"
        f"Path({str(begun)!r}).touch()\nwhile not Path({str(told)!r}).exists():\n    time.sleep(0.01)\n{MODEL}"
    )

    def other() -> None:
        while not begun.exists():
            pass
        print("of another thread")
        told.touch()

    thread = threading.Thread(target=other)
    thread.start()
    assert pendula.Model(file).coordinates == ["theta"]
    thread.join()
    assert capsys.readouterr().out == "of another thread\n"


def test_threads_may_derive_models_at_once(tmp_path):
    names = [f"q_{k}" for k in range(8)]
    found: dict[str, list[str]] = {}

    def derive(name: str) -> None:
        file = Path(tmp_path / f"of_{name}.py")
        file.write_text(MODEL.replace('"theta"', f'"{name}"'))
        found[name] = pendula.Model(file).coordinates

    threads = [threading.Thread(target=derive, args=[name]) for name in names]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {name: [name] for name in names}


def test_a_model_may_use_a_model(tmp_path):
    inner, outer = tmp_path / "inner.py", tmp_path / "outer.py"
    inner.write_text(MODEL.replace('"theta"', '"phi"'))
    outer.write_text(
        f"import pendula\n{MODEL}    assert pendula.Model({str(inner)!r}).coordinates == ['phi']\n"
    )
    assert pendula.Model(outer).coordinates == ["theta"]
