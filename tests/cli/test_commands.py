"""The commands beside `simulate`."""

import re

import pytest


def test_version(pendula):
    run = pendula("--version")
    assert run.status == 0
    assert re.fullmatch(r"pendula \d+\.\d+\.\d+ \(\w+(, on processors with \w+ only)?\)\n", run.out)


def test_help_lists_the_commands(pendula):
    run = pendula("--help")
    assert run.status == 0
    for command in ("simulate", "check", "kernels"):
        assert re.search(rf"^  {command} ", run.out, re.MULTILINE)


def test_every_command_has_help(pendula):
    for command in ("simulate", "check", "kernels"):
        run = pendula(command, "--help")
        assert run.status == 0
        assert f"Usage: pendula {command}" in run.out


def test_help_of_simulate_names_its_options(pendula):
    text = pendula("simulate", "--help").out
    for option in ("SCENARIO", "--set", "-o, --output FILE", "--json", "--quiet"):
        assert option in text


def kernels(pendula) -> list[list[str]]:
    header, *rows = [line.split() for line in pendula("kernels").out.splitlines()]
    assert header == ["kernel", "space", "links"]
    return rows


def test_kernels_are_listed(pendula):
    rows = kernels(pendula)
    assert ["planar_2", "planar", "2"] in rows
    assert ["spatial_1", "spatial", "1"] in rows
    assert all(name == f"{space}_{links}" for name, space, links in rows)


def test_check_passes_for_one_kernel_and_shows_what_it_measured(pendula):
    run = pendula("check", "--space", "spatial", "--links", "2")
    assert run.status == 0, run.out
    lines = [line for line in run.out.splitlines() if line.startswith("spatial_2 ")]
    [moved] = [line for line in lines if re.search(r" moved for \S+ s$", line)]
    lines.remove(moved)
    assert run.out.splitlines()[-1] == f"all {len(lines)} checks passed"
    for what in ("functions of 2, 4 and 8 states", "order, 3 stages, momentum form", "energy, 6 stages"):
        assert any(what in line for line in lines), what
    assert all(re.search(r" [<>]= +\S+ +ok$", line) for line in lines)


def test_check_passes_for_the_whole_build(pendula):
    run = pendula("check")
    assert run.status == 0, run.out
    checked = {line.split()[0] for line in run.out.splitlines() if "<=" in line}
    assert checked == {row[0] for row in kernels(pendula)}


def test_check_of_a_kernel_that_is_not_there(pendula):
    run = pendula("check", "--links", "97")
    assert (run.status, run.out) == (2, "")
    assert run.err.startswith("pendula: check: expected --space and --links of a kernel in this build (")


@pytest.mark.parametrize("command", [["lab"], ["export", "--as", "c"], ["build"], ["describe"]])
def test_a_name_that_is_no_model_is_wrong_input(command, pendula):
    output = {"lab": ["-o", "out.html"], "export": ["-o", "out"]}.get(command[0], [])
    run = pendula(*command, "nosuch", *output)
    assert (
        run.status == 2 and "expected a model file ending in .py, or a built-in model: cart_chain" in run.err
    )
