"""What the README shows is what its commands print, and its code is code that is compiled and run."""

import re
import subprocess

import pytest

import readme


def blocks(language: str) -> list[str]:
    fences = re.finditer(r"^```(\w*)\n(.*?)^```$", readme.README.read_text(), re.DOTALL | re.MULTILINE)
    return [fence[2] for fence in fences if fence[1] == language]


def test_the_scenario_runs(tmp_path) -> None:
    [scenario] = blocks("toml")
    file = tmp_path / "scenario.toml"
    file.write_text(scenario)
    subprocess.run([readme.program(), "simulate", file, "--quiet"], check=True)


def test_commands_without_their_output_run() -> None:
    commands = [line for block in blocks("") for line in block.splitlines() if line.startswith("pendula ")]
    assert len(commands) > 3
    readme.run_pendula(commands, check=True)


def test_the_program_is_the_example_that_is_compiled() -> None:
    [program] = blocks("cpp")
    assert program in (readme.ROOT / "examples/double_pendulum.cpp").read_text()


def test_the_cmake_lines_are_the_consumers() -> None:
    [lines] = blocks("cmake")
    assert lines in (readme.ROOT / "tests/consumers/installed/CMakeLists.txt").read_text()


def test_every_link_leads_somewhere() -> None:
    text = readme.README.read_text()
    targets = re.findall(r"\]\(([^)#]+)\)", text) + re.findall(r'src="([^"]+)"', text)
    missing = [target for target in targets if "://" not in target and not (readme.ROOT / target).exists()]
    assert targets and not missing


# Last: the demo makes another program, which would compile kernels of models that are there again.
@pytest.mark.parametrize("session", readme.sessions(), ids=lambda session: session.commands[-1])
def test_console_blocks_show_what_is_printed(session: readme.Session) -> None:
    now = readme.output(session)
    refresh = "refresh with: python tests/readme/readme.py"
    assert len(session.shown) == len(now), "\n".join([refresh, *now])
    for shown, line in zip(session.shown, now, strict=True):
        assert readme.same_line(shown, line), f"{refresh}\nshown: {shown}\nnow:   {line}"
