"""Compiled kernels are programs that are kept: only whole ones run, and only the user's own."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

OTHER_USER = 54321
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files to others")


@pytest.fixture
def kept(pendula, tmp_path):
    """A cache that has a kernel, and its file."""
    made = pendula("build", "spring_pendulum").stdout.splitlines()[-1]
    cache = tmp_path / "cache"
    (cache / "pendula").mkdir(mode=0o700, parents=True)
    kernel = Path(made.split(maxsplit=2)[2])
    return cache, Path(shutil.copy(kernel, cache / "pendula"))


def makes_it_anew(cache: Path, environment: dict[str, str], why: str = "") -> bool:
    """Whether a build begins to make the kernel, and says `why`; it is not awaited."""
    command = [os.environ["PENDULA_PROGRAM"], "build", "spring_pendulum"]
    with subprocess.Popen(
        command,
        env={**environment, "XDG_CACHE_HOME": str(cache)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as build:
        told = build.stderr.readline()
        build.terminate()
        out, rest = build.communicate()
    assert build.returncode in (0, -15), rest
    assert (told == "") == out.endswith(
        f"kept in {cache}/pendula/{next((cache / 'pendula').glob('*.so')).name}\n"
    )
    return (
        told.startswith("pendula: derived the kernel of spring_pendulum, once; compiled by ") and why in told
    )


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 16]) + data[middle + 1 :]


DAMAGES = {
    "cut": lambda data: data[:8192],
    "empty": lambda data: b"",
    "flipped": flipped,
    "longer": lambda data: data + b"\0",
    "unsealed": lambda data: data[:-32],
}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_kernel_that_is_not_what_was_written_is_made_anew(name, kept, environment):
    cache, kernel = kept
    assert not makes_it_anew(cache, environment)
    kernel.write_bytes(DAMAGES[name](kernel.read_bytes()))
    assert makes_it_anew(cache, environment)


def test_a_kernel_is_whole_again_after_that_and_the_owners(kept, pendula):
    """The one test here that compiles. The umask lets everybody write."""
    cache, kernel = kept
    whole = kernel.read_bytes()
    kernel.write_bytes(whole[:8192])
    before = os.umask(0)
    try:
        made = pendula("build", "spring_pendulum", XDG_CACHE_HOME=str(cache))
    finally:
        os.umask(before)
    assert made.stdout.endswith(f"made as {kernel}\n") and kernel.read_bytes() == whole
    assert f"(not loaded: {kernel}: it is not what was written)" in made.stderr
    assert kernel.stat().st_mode & 0o022 == 0
    assert "kept in" in pendula("build", "spring_pendulum", XDG_CACHE_HOME=str(cache)).stdout


def test_a_link_is_not_followed(kept, environment):
    cache, kernel = kept
    kernel.rename(cache / "elsewhere.so")
    kernel.symlink_to(cache / "elsewhere.so")
    assert makes_it_anew(cache, environment)


@as_root
def test_a_kernel_of_somebody_else_is_not_run(kept, environment):
    cache, kernel = kept
    os.chown(kernel, OTHER_USER, OTHER_USER)
    assert makes_it_anew(cache, environment)


def test_a_kernel_that_others_may_write_to_is_not_run(kept, environment):
    cache, kernel = kept
    kernel.chmod(0o757)
    assert makes_it_anew(cache, environment, f"(not loaded: {kernel}: others may write to it)")


def test_a_folder_in_place_of_a_kernel_is_told(kept, pendula):
    cache, kernel = kept
    kernel.unlink()
    kernel.mkdir()
    ended = pendula("build", "spring_pendulum", XDG_CACHE_HOME=str(cache))
    told = f"pendula: expected to keep the compiled kernel in {kernel}, got: a folder in its place\n"
    assert (ended.returncode, ended.stdout, ended.stderr) == (2, "", told)


def refused(pendula, cache: Path | str, **variables) -> str:
    ended = pendula("build", "spring_pendulum", XDG_CACHE_HOME=str(cache), **variables)
    assert (ended.returncode, ended.stdout) == (2, "")
    begin, end = (
        "pendula: expected a folder of your own for compiled kernels, got ",
        " (XDG_CACHE_HOME names another one)\n",
    )
    assert ended.stderr.startswith(begin) and ended.stderr.endswith(end), ended.stderr
    return ended.stderr.removeprefix(begin).removesuffix(end)


@pytest.mark.parametrize("folder", ["", "cache", "cache/pendula"])
@pytest.mark.parametrize("mode", [0o777, 0o1777])
def test_a_folder_that_others_write_to_is_refused(folder, mode, kept, pendula, tmp_path):
    """But on the way, one like /tmp, where nobody takes another's file away."""
    cache, _ = kept
    (tmp_path / folder).chmod(mode)
    if mode == 0o1777 and folder != "cache/pendula":
        assert "kept in" in pendula("build", "spring_pendulum", XDG_CACHE_HOME=str(cache)).stdout
    else:
        assert refused(pendula, cache) == f"{tmp_path / folder}, which others may write to"
    (tmp_path / folder).chmod(0o700)


@as_root
def test_a_folder_that_a_group_writes_to_is_refused_but_for_a_group_of_one(kept, pendula):
    cache, _ = kept
    cache.chmod(0o775)
    assert "kept in" in pendula("build", "spring_pendulum", XDG_CACHE_HOME=str(cache)).stdout
    os.chown(cache, 0, OTHER_USER)
    assert refused(pendula, cache) == f"{cache}, which others may write to"


@as_root
@pytest.mark.parametrize("by_link", [False, True])
def test_a_folder_below_one_of_somebody_else_is_refused(by_link, kept, pendula, tmp_path):
    cache, _ = kept
    home = tmp_path / "home"
    home.mkdir()
    shutil.move(cache, home)
    os.chown(home, OTHER_USER, OTHER_USER)
    if by_link:
        cache.symlink_to(home / "cache")
    got = refused(pendula, cache if by_link else home / "cache")
    assert got == f"{home}, which belongs to the user {OTHER_USER}"


@pytest.mark.parametrize("name", ["", "cache"])
def test_there_is_no_other_folder_where_none_is_named(name, pendula, tmp_path):
    """A path that is not absolute would lead into whatever folder the program is started in."""
    assert refused(pendula, name, HOME=name) == "none by XDG_CACHE_HOME, nor by HOME"


def test_a_home_is_enough(kept, pendula, tmp_path):
    cache, kernel = kept
    cache.rename(tmp_path / ".cache")
    ended = pendula("build", "spring_pendulum", XDG_CACHE_HOME="cache", HOME=str(tmp_path))
    assert ended.stdout.endswith(f"kept in {tmp_path}/.cache/pendula/{kernel.name}\n"), ended.stderr
