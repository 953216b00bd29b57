"""Puts what takes minutes to make into the committed page of the laboratory: refresh_lab.py PAGE MODELS [MODULE].

MODELS are the built-in models as lab_models.py writes them, MODULE its WebAssembly: the page keeps its own without one.
What is the same as in the page is left as it is.
"""

import base64
import gzip
import json
import re
import sys
from pathlib import Path


def script(page: str, name: str) -> slice:
    """Where the text of a script stands."""
    found = re.search(rf'<script type="[a-z/]+" id="{name}">([^<]*)</script>', page)
    assert found, f"expected a script {name}"
    return slice(*found.span(1))


def module_of(page: str) -> bytes:
    """The WebAssembly that stands in a page."""
    return gzip.decompress(base64.b64decode(page[script(page, "module")]))


def models_of(page: str) -> dict:
    return json.loads(page[script(page, "models")])


def put(page: str, name: str, text: str) -> str:
    place = script(page, name)
    return page[: place.start] + text + page[place.stop :]


def main() -> None:
    file, models, *module = map(Path, sys.argv[1:])
    page = file.read_text(encoding="utf-8")
    made = json.loads(models.read_text(encoding="utf-8"))
    if made != models_of(page):
        text = json.dumps(made, separators=(",", ":"), ensure_ascii=False)
        page = put(page, "models", text.replace("<", "\\u003c"))
    if module and module[0].read_bytes() != module_of(page):
        packed = gzip.compress(module[0].read_bytes(), mtime=0)
        page = put(page, "module", base64.b64encode(packed).decode())
    file.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
