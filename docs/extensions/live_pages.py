"""Pages that move: the laboratory, and the page of each motion of the gallery. The program writes them."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from sphinx.addnodes import download_reference
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "plotting"))
from pendula_plot.film import Film  # noqa: E402
from pendula_plot.gallery import CASES, FPS, SIZE, Case, runs_of  # noqa: E402


def pendula(*arguments: str) -> subprocess.CompletedProcess:
    command = [os.environ["PENDULA_PROGRAM"], *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


def folder_of(app: Sphinx) -> Path:
    """What is copied into the site; the pages are in `live` there."""
    return Path(app.doctreedir) / "extra"


def require(done: subprocess.CompletedProcess) -> None:
    if done.returncode != 0:
        raise ExtensionError(f"{' '.join(done.args)}: {done.stderr.strip()}")


def write_case(folder: Path, case: Case) -> None:
    """The page of one motion of the gallery, and a picture that leads there."""
    copies = ["--copies", str(case.copies)] if case.copies else []
    scenario = f"examples/{case.scenario}.toml"
    require(pendula("simulate", scenario, "--quiet", "--view", str(folder / f"{case.name}.html"), *copies))
    runs = runs_of(os.environ["PENDULA_PROGRAM"], ROOT / scenario, case)
    Film(runs, FPS, SIZE).still().save(folder / f"{case.name}.png", optimize=True)


def write_pages(app: Sphinx) -> None:
    folder = folder_of(app) / "live"
    require(pendula("lab", "-o", str(folder / "lab.html")))
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda case: write_case(folder, case), CASES))


def frame(page: str, title: str) -> nodes.raw:
    html = f'<iframe class="live" src="{page}" title="{title}" loading="lazy"></iframe>'
    return nodes.raw("", html, format="html")


class Laboratory(SphinxDirective):
    """The laboratory in a frame. `:link:` is what it begins with: `n=3&th=120deg`."""

    has_content = True
    final_argument_whitespace = True
    option_spec: ClassVar = {"link": str}

    def run(self) -> list[nodes.Node]:
        up = "../" * self.env.docname.count("/")
        link = self.options.get("link", "")
        shown = frame(f"{up}live/lab.html#{link}" if link else f"{up}live/lab.html", "The laboratory")
        return [shown, *self.parse_content_to_nodes()]


class Gallery(SphinxDirective):
    """A card for each motion of the gallery, which leads to its live page."""

    def run(self) -> list[nodes.Node]:
        up = "../" * self.env.docname.count("/")
        cards = "".join(
            f'<li><a href="{up}live/{case.name}.html">'
            f'<img src="{up}live/{case.name}.png" width="{SIZE}" height="{SIZE}" loading="lazy" alt="">'
            f"{case.title}</a><p>{case.text}</p></li>"
            for case in CASES
        )
        return [nodes.raw("", f'<ul class="motions">{cards}</ul>', format="html")]


def share_laboratory(app: Sphinx, doctree: nodes.document) -> None:
    """The laboratory of the repository is that of the site: there is one copy of it to download."""
    up = "../" * app.env.docname.count("/")
    for node in list(doctree.findall(download_reference)):
        if node["reftarget"].endswith("generated/laboratory.html"):
            link = f'<a download="laboratory.html" href="{up}live/lab.html">{escape(node.astext())}</a>'
            node.replace_self(nodes.raw("", link, format="html"))


def setup(app: Sphinx) -> ExtensionMetadata:
    app.add_directive("laboratory", Laboratory)
    app.add_directive("gallery", Gallery)
    app.connect("builder-inited", write_pages)
    app.connect("doctree-read", share_laboratory, priority=400)  # before Sphinx copies what is downloaded
    (folder_of(app) / "live").mkdir(parents=True, exist_ok=True)
    app.config.html_extra_path = [str(folder_of(app))]
    return {"parallel_read_safe": True, "parallel_write_safe": True}
