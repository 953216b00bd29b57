"""The site leads where its links say, answers a newcomer's questions, and can be read by everybody."""

import re
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

WIDE, NARROW = (1280, 900), (390, 844)

# What a newcomer asks, a page that answers it, and words of the answer.
QUESTIONS = {
    "install": ("how-to/install.html", "pip install"),
    "first run": ("tutorials/first-pendulum.html", "simulate"),
    "own model": ("tutorials/own-mechanism.html", "model.lagrangian"),
    "linkage": ("tutorials/linkage.html", "model.constraint"),
    "event": ("how-to/events.html", "t_events"),
    "gradient": ("how-to/gradients.html", "by_start"),
    "ensemble": ("how-to/ensembles.html", "pendula.ensemble"),
    "C++": ("tutorials/cpp.html", "find_package"),
    "trust": ("explanation/trust.html", "trusted_until"),
    "speed": ("reference/benchmarks.html", "heyoka"),
    "cite": ("cite.html", "@software"),
}
# A page of each kind; the C++ reference would take a minute.
READ = [
    "index",
    "tutorials/first-pendulum",
    "how-to/events",
    "explanation/method",
    "reference/scenario",
    "reference/models",
    "gallery",
]


class Reader(HTMLParser):
    """Links and places of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src", "srcset") and value:
                self.links.append(value)
            elif name in ("id", "name") and value:
                self.places.add(value)


@cache
def read(page: Path) -> Reader:
    return Reader(page.read_text(encoding="utf-8"))


def pages(site: Path) -> list[Path]:
    """Those that Sphinx wrote; live pages and the laboratory are tested where they are made."""
    others = ("live", "_static", "_downloads")
    return [page for page in site.rglob("*.html") if page.relative_to(site).parts[0] not in others]


def inner_links(site: Path, page: Path) -> Iterator[tuple[str, Path, str]]:
    """Of a page: the link as it stands there, the file that it leads to, and the place in it."""
    for link in read(page).links:
        parts = urlsplit(link)
        if not parts.scheme and not parts.netloc:
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            yield link, target / "index.html" if target.is_dir() else target, unquote(parts.fragment)


def test_every_link_leads_somewhere(site):
    wrong, seen = [], 0
    for page in pages(site):
        for link, target, place in inner_links(site, page):
            seen += 1
            # What is behind # of the laboratory is a motion.
            there = target.exists() and (
                not place or target.parent.name == "live" or place in read(target).places
            )
            if not there:
                wrong.append(f"{page.relative_to(site)}: {link}")
    assert wrong == [] and seen > 1000


def test_every_page_is_in_the_menu(site):
    menu = {target for _, target, _ in inner_links(site, site / "index.html")}
    without = {site / name for name in ("genindex.html", "search.html", "index.html", "py-modindex.html")}
    missing = [str(page.relative_to(site)) for page in pages(site) if page not in menu | without]
    assert missing == []


def test_nothing_comes_from_elsewhere(site):
    """Neither a script nor a font nor a picture: the site works without a network."""
    for page in pages(site):
        text = re.sub(r"<a [^>]*>|srcdoc=\"[^\"]*\"", "", page.read_text(encoding="utf-8"))
        assert not re.findall(r"(?:src|href)=\"(https?:)?//[^\"]+\"", text), page


def test_the_site_is_small(site):
    size = sum(file.stat().st_size for file in site.rglob("*") if file.is_file())
    assert size < 60e6  # bytes; measured 58.4e6, 48e6 of them pages of the gallery


@pytest.mark.parametrize("question", QUESTIONS)
def test_questions_are_answered_within_two_clicks(site, question):
    answer, words = QUESTIONS[question]
    first = {target for _, target, _ in inner_links(site, site / "index.html")}
    second = {target for page in first if page.suffix == ".html" for _, target, _ in inner_links(site, page)}
    assert site / answer in first | second
    assert words in re.sub(r"<[^>]+>", "", (site / answer).read_text(encoding="utf-8"))


@pytest.fixture
def open_page(site: Path, browser: Browser) -> Iterator:
    contexts = []

    def open_one(name: str, size=WIDE, scheme="light") -> tuple[Page, list[str]]:
        """A page from the disk, and what goes wrong in it."""
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, offline=True
        )
        contexts.append(context)
        page, wrong = context.new_page(), []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
        page.on("requestfailed", lambda request: wrong.append(request.url))
        page.goto((site / f"{name}.html").as_uri())
        return page, wrong

    yield open_one
    for context in contexts:
        context.close()


@pytest.mark.parametrize(
    ("words", "page"), [("Lyapunov", "lyapunov"), ("resume", "resume"), ("advance_to", "cpp")]
)
def test_search_finds(open_page, words, page):
    found, wrong = open_page("search")
    found.goto(f"{found.url}?q={words}")
    found.wait_for_selector("ul.search li a")
    found.wait_for_timeout(500)
    links = found.eval_on_selector_all("ul.search li a", "all => all.map((one) => one.getAttribute('href'))")
    assert any(page in link for link in links), links
    assert wrong == []


@pytest.mark.parametrize(
    ("size", "scheme"), [(WIDE, "light"), (NARROW, "dark")], ids=["wide, light", "narrow, dark"]
)
@pytest.mark.parametrize("name", READ)
def test_everybody_can_read_it(open_page, name, size, scheme):
    page, wrong = open_page(name, size, scheme)
    page.wait_for_timeout(300)
    found = Axe().run(page, options={"preload": False, "resultTypes": ["violations"]}).response["violations"]
    grave = [one for one in found if one["impact"] in ("serious", "critical")]
    told = [f"{one['id']}: {one['help']}: {one['nodes'][0]['html'][:200]}" for one in grave]
    assert told == []
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert wrong == []


def test_the_laboratory_moves(open_page):
    page, _ = open_page("index")
    frame = page.frame_locator("iframe.live")
    frame.locator("canvas").first.wait_for()
    first = frame.locator("canvas").first.screenshot()
    page.wait_for_timeout(500)
    assert frame.locator("canvas").first.screenshot() != first
