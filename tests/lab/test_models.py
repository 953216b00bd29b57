"""Pages of models: carts, rails, springs and pivots are drawn as such, and the motion goes on in a laboratory."""

import json
import math
import os
import re
import subprocess
from pathlib import Path

import pytest
from conftest import program, until
from playwright.sync_api import Browser, Page

# A cart on a slope, between two springs, and what hangs on it; scalars come before what there is one of a link.
SPRUNG = """from sympy import cos, sin

def define(model, links):
    s, theta = model.coordinate("s", "m"), model.coordinate("theta", "rad")
    k = model.parameter("stiffness", "N/m", default=20.0)
    m = model.parameter("masses", "kg", default=1.0, per_link=True)
    push = model.input("push", "N")
    cart = (0.8 * s, 0.6 * s)
    bob = (cart[0] + sin(theta), cart[1] - cos(theta))
    speed = lambda place: model.rate(place[0])**2 + model.rate(place[1])**2
    model.lagrangian = (2 * model.rate(s)**2 + m[0] * speed(bob)) / 2 - k * s**2 / 2 - 9.81 * m[0] * bob[1]
    model.force(s, push)
    wall = model.point("wall", (-0.8, -0.6), kind="pivot")
    model.point("cart", cart, kind="cart")
    model.point("bob", bob)
    model.spring(wall, "cart")
    model.thread("origin", "bob")
"""
KINDS = ["pivot", "cart", "bob"]

SCENARIOS = {
    "cart": """[system]
model = "cart_chain"
links = 2
parameters = { masses = [1, 0.5], cart_mass = 2.0 }
[[system.drive]]
input = "push"
constant = 1.5
[start]
theta_1 = 1.0
theta_2 = 0.3
""",
    "driven": """[system]
model = "driven_chain"
links = 1
parameters = { y_amplitude = 0.1, frequency = 7.0 }
[start]
theta_1 = 1.0
""",
    "own": """[system]
model = "sprung.py"
links = 1
parameters = { stiffness = 15.0, masses = 0.5 }
[[system.drive]]
input = "push"
constant = -2.0
[start]
s = 0.3
theta = 1.0
""",
}
RUN = "[run]\ntolerance = 1e-11\nduration = 3\n[output]\ninterval = 0.01\n"


@pytest.fixture
def scenario(tmp_path):
    """scenario(name, more) -> its file."""
    (tmp_path / "sprung.py").write_text(SPRUNG)

    def write(name: str, more: str = "") -> Path:
        file = tmp_path / f"{name}.toml"
        file.write_text(SCENARIOS[name] + more + RUN)
        return file

    return write


@pytest.fixture
def context(browser: Browser):
    context = browser.new_context(reduced_motion="reduce")
    wrong = []
    context.on("weberror", lambda error: wrong.append(str(error.error)))
    yield context
    context.close()
    assert not wrong


def view(file: Path, by: str = "interpreter") -> Path:
    page = file.with_suffix(".html")
    environment = {**os.environ, "PENDULA_KERNELS_BY": by}
    subprocess.run(
        [os.environ["PENDULA_PROGRAM"], "simulate", file, "--quiet", "--view", page],
        check=True,
        env=environment,
        timeout=120,
    )
    return page


def scene_in(page: Path) -> dict:
    found = re.search(
        r'<script type="application/json" id="scene">(.*?)</script>', page.read_text(), re.DOTALL
    )
    return json.loads(found[1])


def state_at(file: Path, time: float) -> list[float]:
    told = program("simulate", str(file), "--json", "--quiet", "--set", f"run.duration={time!r}")
    final = json.loads(told.stdout)["final"]
    return [*final["q"].values(), *final["v"].values()]


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_page_of_a_model_goes_on_in_a_laboratory(name, scenario, context):
    """From where the page is, and then as the program goes: parameters, held inputs and the time came along."""
    file = scenario(name)
    page = context.new_page()
    page.goto(f"file://{view(file)}")
    page.locator("#scrub").fill("2")
    with context.expect_page() as opened:
        page.get_by_role("button", name="Go on from here").click()
    laboratory = opened.value
    until(laboratory, "window.pendulaLab?.history.rows > 0")
    time = laboratory.evaluate("pendulaLab.row[0]")
    assert time == pytest.approx(2, abs=0.02)
    state = "Array.from({}.subarray(1, 1 + 2 * pendulaLab.size))"
    begun = laboratory.evaluate(state.format("pendulaLab.row"))
    assert furthest(begun, state_at(file, time)) < 1e-11  # measured 2.7e-15
    end = [time]
    while end[0] < time + 0.5 - 1e-9:  # an answer has the rows of 25 ms of work
        end = laboratory.evaluate(
            f"""pendulaLab.computer.ask("advance", {{ until: {time} + 0.5, hand: null }}).then(({{ rows, rowSize }}) =>
                  [rows.at(-rowSize), {state.format("rows.subarray(-rowSize)")}])"""
        )
    assert furthest(end[1], state_at(file, end[0])) < 1e-11  # measured 6.5e-14


def furthest(here: list[float], there: list[float]) -> float:
    return max(abs(a - b) for a, b in zip(here, there, strict=True))


@pytest.mark.parametrize(
    ("more", "left_out"),
    [
        (
            '[[system.drive]]\ninput = "push"\namplitude = 1.0\nfrequency = 2.0\n',
            "drives that change with time",
        ),
        ('[[system.feedback]]\ninput = "push"\nvalue = "-x"\n', "feedback"),
    ],
)
def test_what_a_laboratory_leaves_out_of_a_model_is_said(more, left_out, scenario, tmp_path):
    file = scenario("cart", more)
    assert 'id="laboratory"' not in view(file).read_text()
    told = program("lab", str(file), "-o", str(tmp_path / "lab.html"))
    assert told.returncode == 0
    assert told.stderr == f"pendula: warning: the laboratory leaves out {left_out}\n"


@pytest.mark.parametrize("by", ["compiler", "interpreter"])
def test_the_page_knows_what_points_are(by, scenario):
    scene = scene_in(view(scenario("own"), by))
    assert [point[0] for point in scene["points"]] == ["wall", "cart", "bob"]
    assert [point[4] for point in scene["points"]] == KINDS
    assert scene["connections"] == [["spring", 0, 1], ["thread", -1, 2]]


# Counts boxes and the corners of lines while a page draws.
PEN = """(() => {
  const pen = CanvasRenderingContext2D.prototype;
  window.drawn = { boxes: [], corners: [] };
  let corners = 0;
  const watch = (name, note) => {
    const before = pen[name];
    pen[name] = function (...all) {
      note(this, all);
      return before.apply(this, all);
    };
  };
  watch("beginPath", () => (corners = 0));
  watch("lineTo", () => ++corners);
  watch("stroke", () => window.drawn.corners.push(corners));
  watch("rect", (of) => {
    const { a, b, e, f } = of.getTransform();
    window.drawn.boxes.push([Math.atan2(b, a), e, f]);
  });
})()"""


def drawn(page: Page, act: str) -> tuple[list, int]:
    """Boxes, and how many lines have the corners of a spring: of the frame after an action."""
    page.evaluate(f"() => {{ {act}; window.drawn = {{ boxes: [], corners: [] }}; }}")
    until(page, "window.drawn.boxes.length > 0")
    found = page.evaluate("window.drawn")
    return found["boxes"], found["corners"].count(SPRING) / len(found["boxes"])


SPRING = 22  # corners: ten zigzags, and the straight ends


def test_a_cart_and_a_spring_are_drawn(scenario, context):
    """The cart stands on its slope, where the row says; the spring has as many zigzags when it is longer."""
    page = context.new_page()
    page.add_init_script(PEN)
    page.goto(f"file://{view(scenario('own'))}")
    until(page, "performance.getEntriesByName('pendula first frame').length === 1")
    places = []
    for time in ("0.5", "1.2"):
        scrub = f"const s = document.getElementById('scrub'); s.value = {time}; s.dispatchEvent(new Event('input'))"
        boxes, springs = drawn(page, scrub)
        assert springs == 1
        places.append(boxes[-1])
        assert boxes[-1][0] == pytest.approx(-math.atan2(0.6, 0.8), abs=1e-6)  # measured 2e-16
    (_, x0, y0), (_, x1, y1) = places
    assert abs(x1 - x0) > 10  # pixels
    assert (y1 - y0) / (x1 - x0) == pytest.approx(-0.75, abs=1e-6)


def test_a_laboratory_draws_the_same(scenario, open_lab, tmp_path):
    told = program("lab", str(scenario("own")), "-o", str(tmp_path / "lab.html"))
    assert (told.returncode, told.stderr) == (0, "")
    page = open_lab(file=tmp_path / "lab.html")
    stage = page.evaluate(
        "(({ kinds, connections, rails, hangs }) => ({ kinds, connections, rails, hangs }))(pendulaLab.stage)"
    )
    assert stage["kinds"] == KINDS
    assert [(each["kind"], each["ends"]) for each in stage["connections"]] == [
        ("spring", [0, 1]),
        ("thread", [-1, 2]),
    ]
    assert stage["rails"][0] is None
    assert stage["rails"][1] == pytest.approx([0.8, 0, 0.6], abs=1e-12)  # measured 1e-16
    assert stage["hangs"] == [-2, -2, 1]  # the bob by a rod on the cart


def test_built_in_models_say_what_they_are(open_lab):
    page = open_lab()
    told = page.evaluate(
        """Object.entries(JSON.parse(document.getElementById("models").textContent)).map(([name, { model }]) =>
             [name, model.points.map(({ kind }) => kind).join(), model.connections.map(({ kind }) => kind).join()])"""
    )
    assert {name: (kinds, connections) for name, kinds, connections in told} == {
        "cart_chain": ("cart,bob,bob", ""),
        "driven_chain": ("pivot,bob,bob", ""),
        "furuta": ("pivot,bob", ""),
        "joint_springs": ("bob,bob,bob", ""),
        "rods": ("bob", ""),
        "spring_pendulum": ("bob", "spring"),
        "swinging_atwood": ("bob", "thread"),
    }
