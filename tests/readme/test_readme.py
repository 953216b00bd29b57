"""What the README and docs/ show is what their commands print; what they do not show runs."""

import json
import re
import struct
import subprocess
from base64 import b64decode
from pathlib import Path

import pytest

import readme

TOUR = readme.ROOT / "docs/how-to/command-line.md"
WITH_CALLS = [page for page in readme.PAGES if readme.calls(page)]


def test_the_scenario_runs(tmp_path) -> None:
    [scenario] = readme.blocks(TOUR, "toml")
    file = tmp_path / "scenario.toml"
    file.write_text(scenario)
    subprocess.run([readme.program(), "simulate", file, "--quiet"], check=True)


def test_there_are_pages_with_calls() -> None:
    assert TOUR in WITH_CALLS and len(WITH_CALLS) > 10


@pytest.mark.parametrize("page", WITH_CALLS, ids=lambda page: page.stem)
def test_calls_without_their_output_run(page: Path) -> None:
    readme.run_pendula(readme.calls(page), check=True)


def test_the_copies_part() -> None:
    """What is said of them is to be seen in their page."""
    page = readme.ROOT / "docs/how-to/share.md"
    [command] = re.findall(r"^pendula .* --copies \d+$", page.read_text(), re.MULTILINE)
    [view] = re.findall(r"--view (\S+)", command)
    text = "\n".join(readme.run_pendula([command, f"cat {view}"], check=True))
    [scene] = re.findall(r'<script type="application/json" id="scene">(.*?)</script>', text)
    run = json.loads(scene)["runs"][-1]
    assert run["separation"] and not run["steps"]  # which would stand behind it
    rows = b64decode(re.findall(r'class="run">(.*?)</script>', text)[-1])
    apart = struct.unpack(f"<{run['rows']}f", rows[-4 * run["rows"] :])
    assert apart[0] < 1e-6
    assert max(apart[: 2 * len(apart) // 3]) < 1 < max(apart)  # m; measured 0.32 by 8 of 12 s, and 4.4


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
