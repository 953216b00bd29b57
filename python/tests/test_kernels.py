"""Kernels that are loaded while the program runs."""

import ctypes
import os
import re
from pathlib import Path

import pendula


def test_a_kernel_that_stays_loaded_is_not_taken_for_another() -> None:
    """The loader may keep an object that is closed: its name must not become that of the next kernel."""
    first = pendula.Simulation(pendula.Model("rods", links=2), {"theta": [1.0, 0.5]})
    [path] = {*re.findall(r"/\S*/rods_2-\S+\.so", Path("/proc/self/maps").read_text())}
    ctypes.CDLL(path, mode=os.RTLD_NOW | 0x1000)  # RTLD_NODELETE
    del first
    second = pendula.Simulation(pendula.Model("cart_chain", links=1), {"theta": 0.5})
    assert second.names == ["x", "theta_1", "x_dot", "theta_dot_1"]
