"""The committed page of the laboratory is what its sources make."""

import json
import os
from pathlib import Path

import pytest
from conftest import COMMITTED, module_of
from refresh_lab import models_of

REFRESH = "refresh with: cmake --build build/release --target refresh-generated"
BUILT = Path(os.environ["PENDULA_LAB"])
WRITTEN = COMMITTED.read_text(encoding="utf-8")


def test_it_is_the_page_that_the_program_writes(lab_file):
    assert lab_file.read_text(encoding="utf-8") == WRITTEN, REFRESH


def test_its_models_are_what_the_generator_makes():
    fresh = json.loads((BUILT / "models.json").read_text(encoding="utf-8"))
    kept = models_of(WRITTEN)
    assert sorted(kept) == sorted(fresh), REFRESH
    assert [name for name in fresh if kept[name] != fresh[name]] == [], REFRESH


def test_its_module_is_what_emscripten_makes():
    if not (BUILT / "module.wasm").exists():
        pytest.skip("its bytes are those of Debian 12's emscripten")
    assert (BUILT / "module.wasm").read_bytes() == module_of(WRITTEN), REFRESH
