"""An exported system on an emulated Cortex-M4, where a compiler for it and QEMU are there (scripts/setup --export)."""

import re
import shutil
import subprocess

import pytest
from conftest import EXAMPLES

BOARD = EXAMPLES / "cortex_m4"
COMPILER = "arm-none-eabi-gcc"
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror")
PROCESSOR = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")


@pytest.mark.skipif(
    not (shutil.which(COMPILER) and shutil.which("qemu-system-arm")),
    reason="no compiler, or no QEMU, for ARM",
)
def test_a_cortex_m4_balances_two_links_where_one_is_emulated(pendula, tmp_path):
    ended = pendula(
        "export", "cart_chain", "--links", 2, "--as", "c", "--float", "--name", "cart", "-o", tmp_path
    )
    assert ended.returncode == 0, ended.stderr
    program = tmp_path / "cart.elf"
    files = [BOARD / "main.c", BOARD / "board.c", tmp_path / "cart.c"]
    more = (
        "-O2",
        "-ffreestanding",
        "-ffunction-sections",
        "-Wl,--gc-sections",
        "-nostartfiles",
        f"-I{tmp_path}",
    )
    command = [COMPILER, *FLAGS, *PROCESSOR, *more, "-T", BOARD / "board.ld", *files, "-o", program, "-lm"]
    subprocess.run(command, check=True)
    emulator = [
        "qemu-system-arm",
        "-M",
        "mps2-an386",
        "-nographic",
        "-semihosting",
        "-icount",
        "shift=0",
        "-kernel",
    ]
    piped = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    ran = subprocess.run([*emulator, program], timeout=60, **piped)
    assert ran.returncode == 0, ran.stdout
    told = {name: [*map(float, rest.split())] for name, rest in lines(ran.stdout)}
    x, first, second, *rates = told["x, theta_1, theta_2 and rates"]
    assert abs(x) < 0.1 and max(map(abs, rates)) < 0.1  # measured 0.047, 0.05
    away = max(abs(first - 3.1416), abs(second - 3.1416))  # they began 0.05 and 0.03 away
    assert away < 0.01  # measured 0.0041
    assert told["instructions a step"][0] < 15_000  # measured 10,307
    sizes = subprocess.run(["arm-none-eabi-size", program], capture_output=True, text=True, check=True)
    flash, data, rest = map(int, sizes.stdout.splitlines()[1].split()[:3])
    assert flash + data < 24_000  # measured 15,740: the loop, the gains, and libm
    reserved = 8192  # for the stack, of which only so much is used
    assert (
        data + rest - reserved + told["bytes of stack"][0] < 4400
    )  # measured 4100, of which 1080 are the C library's


def lines(text: str) -> list[tuple[str, str]]:
    """Words and the numbers after them."""
    return re.findall(r"^(.*?)((?: -?\d+\.\d+)+)$", text, re.MULTILINE)
