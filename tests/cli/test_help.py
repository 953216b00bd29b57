"""What the program says of itself: help, examples that run, completion in shells, the manual page."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import program

ROOT = Path(__file__).parents[2]


def commands(pendula) -> list[str]:
    listed = pendula("help").out.split("\nCommands:\n")[1].split("\n\n")[0]
    return re.findall(r"^  ([\w-]+)", listed, re.MULTILINE)


def examples(text: str) -> list[str]:
    return re.findall(r"^  (pendula .*)$", text.split("\nExamples:\n")[1], re.MULTILINE)


def test_every_command_has_help_and_examples(pendula):
    assert len(commands(pendula)) == 17
    for command in commands(pendula):
        text = pendula("help", command).out
        assert f"\nUsage: pendula {command}" in text
        assert all(f"pendula {command} " in f"{call} " for call in examples(text))
        assert max(map(len, text.split("\nExamples:\n")[0].splitlines())) <= 80


# These take minutes, or write where the user's things are.
UNTRIED = ["pendula gallery out/gallery", "pendula completion bash >"]


def test_the_examples_run(pendula, tmp_path):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    path = f"{Path(program()).parent}:{os.environ['PATH']}"
    tried = []
    for command in ["", *commands(pendula)]:
        for call in examples(pendula("help", *([command] if command else [])).out):
            if call.startswith(tuple(UNTRIED)) or call in tried:
                continue
            done = subprocess.run(
                ["bash", "-c", call],
                cwd=tmp_path,
                env=os.environ | {"PATH": path},
                capture_output=True,
                text=True,
                check=False,
            )
            unfinished = 3 if "--shard" in call else 0
            assert done.returncode == unfinished, f"{call}\n{done.stderr}"
            tried.append(call)
    assert len(tried) > 15


@pytest.mark.parametrize(
    ("command", "table", "looks"),
    [
        ("simulate", "[output]", True),
        ("simulate", "[ensemble]", False),
        ("ensemble", "[[ensemble.axis]]", True),
        ("lyapunov", "[run]", True),
        ("linearize", "[start]", True),
        ("lyapunov", "[output]", False),
        ("plot", "[run]", False),
    ],
)
def test_help_has_the_keys_that_a_command_reads(pendula, command, table, looks):
    assert (f"\n  {table} " in pendula("help", command).out) is looks


def test_help_of_scenarios_has_units_and_defaults(pendula):
    text = pendula("help", "scenario").out
    words = " ".join(text.split())
    assert "masses the masses of the bobs number > 0, or an array of one a link; kg; must be given" in words
    assert "gravity acceleration of gravity, downwards number; m/s^2; default: 9.81" in words
    assert '"gauss" | "radau"' in words
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(
    ("words", "instead"),
    [
        (["--set", "run.duration", "3"], "run.duration=3"),
        (["--set", "run.duration", "=", "3"], "run.duration=3"),
        (["--set", "run.duration=", "3"], "run.duration=3"),
        (["--set", "run.duration", "=3"], "run.duration=3"),
        (["--set", "gravity", "-1"], "gravity=-1"),
        (["--set", "start.theta", "90 deg"], '"start.theta=90 deg"'),
        (["--set", "run.duration", "other.toml"], "run.duration=VALUE"),
    ],
)
def test_a_setting_is_one_word(pendula, double, words, instead):
    for arguments in (["simulate", double, *words], ["simulate", *words, double]):
        run = pendula(*arguments)
        assert (run.status, run.out) == (2, "")
        got = " ".join(words[:3])
        expected = "expected KEY=VALUE without blanks around '=', got two words; write --set "
        assert run.err == f"pendula: {got}: {expected}{instead}\n"


def test_a_key_may_be_taken_out_before_the_scenario(pendula, double):
    assert pendula("simulate", "--set", "run.step=", double, "--quiet").status == 0
    assert pendula("simulate", "--set", "run.step= 0.01", double, "--quiet").status == 0


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([""], {"simulate", "ensemble", "help", "completion"}),
        (["sim"], {"simulate"}),
        (["--v"], {"--version"}),
        (["simulate", "--re"], {"--resume"}),
        (["simulate", ""], {":files .toml"}),
        (["simulate", "a.toml", ""], set()),
        (["simulate", "a.toml", "-o", ""], {":files .csv .h5 .hdf5 .nc"}),
        (["simulate", "--view=", ""], {":files .toml"}),
        (["simulate", "--view="], {":files .html"}),
        (["simulate", "--set", "run.st"], {"run.stages=", "run.step="}),
        (["simulate", "--set", "chain.drive[1].p"], {"chain.drive[1].phase="}),
        (["simulate", "--set", "run.method=ga"], {"run.method=gauss"}),
        (["simulate", "--set=run.estimate="], {"--set=run.estimate=true", "--set=run.estimate=false"}),
        (["simulate", "--set", "ensemble"], set()),
        (["lyapunov", "--set", "output."], set()),
        (["ensemble", "--set", "ensemble.s"], {"ensemble.seed="}),
        (
            ["simulate", "--set", "run.step=1", "--set", "run.form="],
            {"run.form=momentum", "run.form=velocity"},
        ),
        (["plot", "a.csv", "b.csv", ""], {":files .csv .h5 .hdf5 .nc"}),
        (["check", "--space", "s"], {"spatial"}),
        (["help", "s"], {"scenario", "summary", "simulate"}),
        (["completion", ""], {"bash", "zsh", "fish"}),
        (["nonsense", ""], {"simulate"}),
    ],
)
def test_candidates(pendula, words, expected):
    run = pendula("completion", "--words", *words)
    assert (run.status, run.err) == (0, "")
    found = {line.split("\t")[0] for line in run.out.splitlines()}
    whole = words not in ([""], ["nonsense", ""])
    assert found == expected if whole else expected <= found


def in_shell(shell: str, folder: Path, script: str) -> list[str]:
    """Lines that a shell prints, with the program on its path."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not here (scripts/setup --tests installs it)")
    done = subprocess.run(
        [shell, "-c", script],
        cwd=folder,
        env=os.environ | {"PATH": f"{Path(program()).parent}:{os.environ['PATH']}", "HOME": str(folder)},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.fixture
def files(tmp_path) -> Path:
    """A folder with files of several endings."""
    for name in ("run.toml", "run.csv", "run.h5", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / "runs").mkdir()
    return tmp_path


LINES = [
    ("pendula sim", {"simulate"}),
    ("pendula simulate ru", {"run.toml", "runs"}),
    ("pendula simulate run.toml -o ru", {"run.csv", "run.h5", "runs"}),
    ("pendula simulate run.toml --set run.st", {"run.stages=", "run.step="}),
    ("pendula simulate run.toml --set run.method=ra", {"run.method=radau"}),
    ("pendula completion ", {"bash", "zsh", "fish"}),
]


@pytest.mark.parametrize(("line", "expected"), LINES)
def test_completion_in_bash(files, line, expected):
    """As readline hands a line over: KEY=VALUE are three words there, and only the last is completed."""
    words = [word for word in re.split(r"(=)| ", line) if word is not None]
    given = " ".join(f"'{word}'" for word in words)
    script = f"""
        compopt() {{ :; }}  # works in readline only
        source <(pendula completion bash)
        COMP_WORDS=({given}) COMP_CWORD={len(words) - 1}
        _pendula
        printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    before = line.split()[-1].rpartition("=")[0]
    found = {f"{before}={word}" if before else word for word in in_shell("bash", files, script)}
    assert found == expected


@pytest.mark.parametrize(("line", "expected"), LINES)
def test_completion_in_fish(files, line, expected):
    found = in_shell("fish", files, f"pendula completion fish | source; complete -C '{line}'")
    assert {word.split("\t")[0].rstrip("/") for word in found} == expected


@pytest.mark.parametrize(("line", "expected"), LINES)
def test_completion_in_zsh(files, line, expected):
    """In a terminal of its own, since zsh completes nowhere else; what it may become comes behind marks."""
    script = f"""
        zmodload zsh/zpty
        zpty z zsh -f -i
        zpty -w z 'autoload -Uz compinit; compinit -u -d {files}/dump; source <(pendula completion zsh)'
        zpty -w z 'compadd() {{
          if [[ ${{@[(I)-O|-A|-D]}} -eq 0 ]] {{
            builtin compadd -O __matches "$@"; print -l -- "${{(@)__matches/#/<<}}" }}
          builtin compadd "$@" }}'
        zpty -w z 'zle -C complete-word complete-word _main_complete; bindkey "^I" complete-word; print rea""dy'
        zpty -r -m z line '*ready*'
        zpty -n -w z $'{line}\\t'
        for ((quiet = 0; quiet < 20; ++quiet)) {{
          zpty -r -t z line && print -r -- $line && quiet=0
          sleep 0.1
        }}
    """
    found = set(re.findall(r"<<([^\r\n]+)", "\n".join(in_shell("zsh", files, script))))
    assert found == expected


def test_the_manual_page(pendula):
    page = pendula("help", "--man").out
    for command in commands(pendula):
        assert f'\n.SS "pendula {command} '.replace("-", r"\-") in page
    for name in ("NAME", "SYNOPSIS", "EXIT STATUS", "ENVIRONMENT"):
        assert f"\n.SH {name}\n" in page
    assert r"\fB" not in page
    if shutil.which("groff"):
        done = subprocess.run(
            ["groff", "-man", "-ww", "-Tutf8", "-P-cbou"],
            input=page,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stderr == ""
        assert "pendula simulate [OPTIONS] [SCENARIO]" in done.stdout
        assert '--set "start.theta=120 deg"' in done.stdout


def test_what_an_install_has_beside_the_program(pendula):
    shared = Path(program()).parents[1] / "share"
    kept = {
        "man/man1/pendula.1": ["help", "--man"],
        "bash-completion/completions/pendula": ["completion", "bash"],
        "zsh/site-functions/_pendula": ["completion", "zsh"],
        "fish/vendor_completions.d/pendula.fish": ["completion", "fish"],
        "pendula/scenario.schema.json": ["help", "scenario", "--json"],
        "pendula/summary.schema.json": ["help", "summary", "--json"],
    }
    for file, asked in kept.items():
        assert (shared / file).read_text() == pendula(*asked).out
