"""What the README shows is what its commands print, and its code is code that is compiled and run."""

import json
import re
import struct
import subprocess
from base64 import b64decode

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


def test_the_copies_part() -> None:
    """What the README says of them is to be seen in their page."""
    [command] = re.findall(r"^pendula .* --copies \d+$", readme.README.read_text(), re.MULTILINE)
    [page] = re.findall(r"--view (\S+)", command)
    text = "\n".join(readme.run_pendula([command, f"cat {page}"], check=True))
    [scene] = re.findall(r'<script type="application/json" id="scene">(.*?)</script>', text)
    run = json.loads(scene)["runs"][-1]
    assert run["separation"] and not run["steps"]  # which would stand behind it
    rows = b64decode(re.findall(r'class="run">(.*?)</script>', text)[-1])
    apart = struct.unpack(f"<{run['rows']}f", rows[-4 * run["rows"] :])
    assert apart[0] < 1e-6
    assert max(apart[: 2 * len(apart) // 3]) < 1 < max(apart)  # m; measured 0.32 by 8 of 12 s, and 4.4


def test_the_program_is_the_example_that_is_compiled() -> None:
    [program] = blocks("cpp")
    assert program in (readme.ROOT / "examples/double_pendulum.cpp").read_text()


def test_the_cmake_lines_are_the_consumers() -> None:
    [lines] = blocks("cmake")
    assert lines in (readme.ROOT / "tests/consumers/installed/CMakeLists.txt").read_text()


def test_every_link_leads_somewhere() -> None:
    text = re.sub(r"^```.*?^```", "", readme.README.read_text(), flags=re.DOTALL | re.MULTILINE)
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
