"""The command line as a user or CMake runs it."""

import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from sympy import Symbol

from conftest import REPOSITORY
from pendula_codegen.__main__ import main
from pendula_codegen.links import LINKS


def run(*arguments: str, seed: str = "0") -> subprocess.CompletedProcess:
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY / "codegen"), "PYTHONHASHSEED": seed}
    command = [sys.executable, "-m", "pendula_codegen", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_kernel_into_a_file_and_into_a_folder(tmp_path, fresh_headers):
    command = ["kernel", "--space", "planar", "--links", "1", "--paper-blocks", "--output"]
    assert main([*command, str(tmp_path / "mine.hpp")]) == 0
    assert main([*command, str(tmp_path / "new")]) == 0
    assert (tmp_path / "mine.hpp").read_text() == fresh_headers["planar_1.hpp"]
    assert (tmp_path / "new" / "planar_1.hpp").read_text() == fresh_headers["planar_1.hpp"]


def test_the_blocks_of_the_paper_are_there_where_asked_for(tmp_path, fresh_headers):
    assert main(["kernel", "--space", "spatial", "--links", "2", "--output", str(tmp_path)]) == 0
    kernel = (tmp_path / "spatial_2.hpp").read_text()
    blocks = ["block_A11", "block_B22", "block_C1", "block_g"]
    assert not [block for block in blocks if block in kernel]
    assert not [block for block in blocks if block not in fresh_headers["spatial_2.hpp"]]
    assert "residual_with_jacobians" in kernel


def test_link_and_tableaux(tmp_path, fresh_headers):
    assert main(["link", "--space", "spatial", "--output", str(tmp_path)]) == 0
    assert main(["tableaux", "--output", str(tmp_path)]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gauss_tableaux.hpp", "spatial_link.hpp"]
    for path in tmp_path.iterdir():
        assert path.read_text() == fresh_headers[path.name]


@pytest.mark.parametrize(("space", "links"), [("planar", "2"), ("spatial", "2")])
def test_same_bytes_whatever_the_hash_seed(space, links, tmp_path, fresh_headers):
    for seed in ("1", "20261121"):
        command = ["kernel", "--space", space, "--links", links, "--paper-blocks"]
        done = run(*command, "--output", str(tmp_path), seed=seed)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        name = f"{space}_{links}.hpp"
        assert (tmp_path / name).read_bytes() == fresh_headers[name].encode()


@pytest.mark.parametrize("language", ["c", "bytecode"])
def test_programs_have_the_same_bytes_whatever_the_hash_seed(language, tmp_path):
    files = [tmp_path / seed / "cart_chain_2.c" for seed in ("1", "20261121")]
    for file in files:
        command = [
            "program",
            "--model",
            "cart_chain",
            "--links",
            "2",
            "--as",
            language,
            "--output",
            str(file),
        ]
        done = run(*command, seed=file.parent.name)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    first, second = (file.read_bytes() for file in files)
    assert first == second


WRONG = [
    (["kernel", "--space", "planar", "--links", "0"], "a chain has at least one link: got --links 0"),
    (["kernel", "--space", "planar", "--links", "-2"], "a chain has at least one link: got --links -2"),
    (
        ["kernel", "--space", "cubic", "--links", "2"],
        "unknown model 'cubic': expected one of planar, spatial",
    ),
    (["link", "--space", "cubic"], "unknown model 'cubic': expected one of planar, spatial"),
    (["kernel", "--space", "planar", "--links", "two"], "argument --links: invalid int value: 'two'"),
    (["kernel", "--space", "planar"], "the following arguments are required: --links"),
    (
        ["program", "--model", "cubic"],
        "unknown model 'cubic': expected a file ending in .py, or one of cart_chain, driven_chain, four_bar, "
        "furuta, hanging_chain, joint_springs, peaucellier, rods, slider_crank, spring_pendulum, swinging_atwood, "
        "walking_leg",
    ),
    (["tableaux", "--depth", "3"], "unrecognized arguments: --depth 3"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG, ids=lambda value: " ".join(value)[:40])
def test_wrong_requests_say_so_in_one_line(arguments, message, tmp_path, capsys):
    assert status_of([*arguments, "--output", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == f"pendula_codegen: error: {message}\n"
    assert list(tmp_path.iterdir()) == []


def status_of(arguments: list[str]) -> int:
    try:
        return main(arguments)
    except SystemExit as stop:  # argparse leaves this way
        return int(stop.code or 0)


def test_exit_status_of_the_process(tmp_path):
    done = run("kernel", "--space", "planar", "--links", "0", "--output", str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "pendula_codegen: error: a chain has at least one link: got --links 0\n"


def test_symbol_that_the_model_does_not_declare(tmp_path, capsys, monkeypatch):
    planar = LINKS["planar"]
    heavy = replace(planar, up=planar.up * Symbol("k"))
    monkeypatch.setitem(LINKS, "planar", heavy)
    assert main(["kernel", "--space", "planar", "--links", "2", "--output", str(tmp_path)]) == 2
    message = "the Lagrangian of model 'planar' holds the symbol 'k', which the model does not declare"
    assert capsys.readouterr().err == f"pendula_codegen: error: {message}\n"
    assert list(tmp_path.iterdir()) == []


def test_file_where_a_folder_should_be(tmp_path, capsys):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    for target, reason in [
        (blocked / "planar_link.hpp", f"{blocked} is not a folder"),
        (blocked / "deeper" / "planar_link.hpp", "Not a directory"),
    ]:
        assert main(["link", "--space", "planar", "--output", str(target)]) == 2
        assert capsys.readouterr().err == f"pendula_codegen: error: cannot write {target}: {reason}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_folder_without_permission(tmp_path, capsys, monkeypatch):
    """Simulated, because root may write anywhere."""

    def forbidden(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "mkstemp", forbidden)
    target = tmp_path / "planar_link.hpp"
    assert main(["link", "--space", "planar", "--output", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"pendula_codegen: error: cannot write {target}: Permission denied\n"
    assert list(tmp_path.iterdir()) == []


def test_failed_write_leaves_the_old_file(tmp_path, capsys, monkeypatch):
    kept = tmp_path / "planar_link.hpp"
    kept.write_text("old")

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full_disk)
    assert main(["link", "--space", "planar", "--output", str(tmp_path)]) == 2
    expected = f"pendula_codegen: error: cannot write {kept}: No space left on device\n"
    assert capsys.readouterr().err == expected
    assert [path.name for path in tmp_path.iterdir()] == ["planar_link.hpp"]
    assert Path(kept).read_text() == "old"
