"""generated/ is what the generator makes today."""

from conftest import REPOSITORY
from pendula_codegen import __version__

REFRESH = "refresh with: cmake --build build/release --target refresh-generated"


def test_generated_headers_are_up_to_date(fresh_headers):
    kept = {path.name: path.read_text(encoding="utf-8") for path in (REPOSITORY / "generated").glob("*.hpp")}
    assert sorted(kept) == sorted(fresh_headers), f"generated/ has other files than it should; {REFRESH}"
    stale = [name for name, text in fresh_headers.items() if kept[name] != text]
    assert stale == [], f"{', '.join(stale)} differ from what the generator makes; {REFRESH}"


def test_committed_set():
    names = {path.stem for path in (REPOSITORY / "generated").glob("*.hpp")}
    planar, spatial = {f"planar_{n}" for n in range(1, 5)}, {f"spatial_{n}" for n in range(1, 4)}
    assert names == planar | spatial | {"four_bar", "planar_link", "spatial_link", "gauss_tableaux"}


def test_the_generator_has_the_version_of_the_project():
    assert f"project(pendula VERSION {__version__} " in (REPOSITORY / "CMakeLists.txt").read_text()


def test_banner_says_how_to_make_the_header_again(fresh_headers):
    head = fresh_headers["spatial_3.hpp"].splitlines()[:4]
    assert head[0] == "// Kernel of the spatial chain with 3 links."
    assert "SymPy 1.14.0" in head[1] and "inputs " in head[1]
    command = "PYTHONPATH=codegen python -m pendula_codegen kernel --space spatial --links 3"
    assert command in head[3]
