"""Pages of models: carts, rails, springs and pivots are drawn as such, and the motion goes on in a laboratory."""

import json
import math
import os
import re
import subprocess
from pathlib import Path

import pytest
from conftest import await_frame, program, until
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
    model.rod("origin", wall)
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
amplitude = 3.0
frequency = 2.5
phase = 0.4
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
    "balanced": """[system]
model = "cart_chain"
links = 1
[[system.feedback]]
input = "push"
value = "2*x + 4*x_dot - 60*(theta_1 - pi) - 16*theta_dot_1"
[start]
theta_1 = 3.0
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
        ('[[system.feedback]]\ninput = "push"\nvalue = "-x"\nsample = 0.1\n', "sampled feedback"),
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
    assert scene["connections"] == [["spring", 0, 1], ["thread", -1, 2], ["rod", -1, 0]]


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
        "(({ kinds, connections, rails, rods }) => ({ kinds, connections, rails, rods }))(pendulaLab.stage)"
    )
    assert stage["kinds"] == KINDS
    assert [(each["kind"], each["ends"]) for each in stage["connections"]] == [
        ("spring", [0, 1]),
        ("thread", [-1, 2]),
    ]
    assert stage["rails"][0] is None
    assert stage["rails"][1] == pytest.approx([0.8, 0, 0.6], abs=1e-12)  # measured 1e-16
    # The bob on the cart, and what the model says.
    assert [(rod["on"], rod["i"]) for rod in stage["rods"]] == [(1, 2), (-1, 0)]


@pytest.fixture
def own_lab(scenario, open_lab, tmp_path):
    """The laboratory of the cart on its slope, which has begun to move."""
    moving = "s_dot = 0.7\ntheta_dot = -1.3\n"
    told = program("lab", str(scenario("own", moving)), "-o", str(tmp_path / "lab.html"))
    assert (told.returncode, told.stderr) == (0, "")
    return open_lab(file=tmp_path / "lab.html")


def test_velocities_of_points_are_drawn(own_lab):
    own_lab.evaluate(
        """(() => {
          const { stage } = pendulaLab;
          const draw = stage.draw.bind(stage);
          stage.draw = (what) => draw((window.told = what));
        })()"""
    )
    own_lab.get_by_role("button", name="Velocities").click()
    until(own_lab, "window.told?.rates")
    cart = [0.7 * 0.8, 0, 0.7 * 0.6]
    bob = [cart[0] - 1.3 * math.cos(1.0), 0, cart[2] - 1.3 * math.sin(1.0)]
    rates = own_lab.evaluate("Array.from(told.rates)")
    assert furthest(rates, [0, 0, 0, *cart, *bob]) < 1e-8  # measured 6.6e-12


def test_a_driven_pivot_has_a_velocity(open_lab):
    page = open_lab("model=driven_chain&n=1&p=1,1,0,0.1,0.2,7,0,0,9.81")
    row = page.evaluate("Array.from(pendulaLab.row)")
    speed = [7 * 0.1, 7 * 0.2]  # frequency times amplitudes
    assert furthest(row[-4:-2], speed) < 1e-8  # measured 1.1e-9


# Words on the canvas.
WORDS = """(() => {
  const pen = CanvasRenderingContext2D.prototype;
  const before = pen.fillText;
  window.words = [];
  pen.fillText = function (text, ...place) {
    if (this.canvas.id === "canvas") window.words.push(text);
    return before.call(this, text, ...place);
  };
})()"""


def angles_told(page: Page) -> list[str]:
    page.evaluate(WORDS)
    page.get_by_role("button", name="Angles").click()
    until(page, "words.some((each) => each.endsWith('°'))")
    await_frame(page)
    page.evaluate("words.length = 0")
    await_frame(page)
    return page.evaluate("words.filter((each) => each.endsWith('°'))")


def test_angles_of_what_turns_are_drawn(own_lab):
    """Of the rod and the thread, not of the spring along the slope."""
    bob = (0.3 * 0.8 + math.sin(1.0), 0.3 * 0.6 - math.cos(1.0))
    thread = math.degrees(math.atan2(bob[0], -bob[1]))
    assert angles_told(own_lab) == ["57°", f"{thread:.0f}°"]


@pytest.mark.parametrize(
    ("link", "angles"),
    [
        ("model=furuta&q=0.3,2&v=0", ["115°"]),  # not of the arm, which stays level
        ("model=swinging_atwood&q=1,0.5&v=0", ["29°"]),
        ("n=2&th=0.5,4", ["29°", "−131°"]),
        ("n=1&space=3&th=0.5&ph=2", ["29°"]),
    ],
)
def test_angles_are_from_the_vertical(link, angles, open_lab):
    assert angles_told(open_lab(link)) == angles


def test_copies_of_a_model_part(open_lab):
    """A cart's place has no part in its motion: copies that differ in it alone would stay together."""
    page = open_lab("model=cart_chain&copies=50&apart=1e-6", motion="no-preference")
    until(page, "pendulaLab.copies?.count === 50")
    copies = 'pendulaLab.panels.find((panel) => panel.key === "copies").values'
    until(page, f"{copies}.some(([, far]) => far > 1e-2)")
    page.keyboard.press("Space")
    await_frame(page)
    # The last bob of the first and of the last copy.
    spread = page.evaluate(
        """(() => {
          const { places, count } = pendulaLab.copies;
          const each = places.length / count;
          return Math.hypot(...[1, 2, 3].map((k) => places.at(-k) - places[each - k]));
        })()"""
    )
    assert 1e-3 < spread < 10


def test_built_in_models_say_what_they_are(open_lab):
    page = open_lab()
    told = page.evaluate(
        """Object.entries(JSON.parse(document.getElementById("models").textContent)).map(([name, { first, made }]) => {
             const { points, connections } = made[first].model;
             return [name, points.map(({ kind }) => kind).join(), connections.map(({ kind }) => kind).join()];
           })"""
    )
    assert {name: (kinds, connections) for name, kinds, connections in told} == {
        "cart_chain": ("cart,bob,bob", ""),
        "driven_chain": ("pivot,bob,bob", ""),
        "four_bar": ("pivot,bob,bob", "rod,rod"),
        "furuta": ("pivot,bob", ""),
        "hanging_chain": ("pivot" + 7 * ",bob", "rod,rod"),
        "joint_springs": ("bob,bob,bob", ""),
        "peaucellier": ("pivot" + 4 * ",bob", ",".join(7 * ["rod"])),
        "rods": ("bob", ""),
        "slider_crank": ("bob,cart", "rod"),
        "spring_pendulum": ("bob", "spring"),
        "swinging_atwood": ("floor,weight,bob", "pulleys,thread"),
        "walking_leg": ("pivot" + 6 * ",bob", ",".join(11 * ["rod"])),
    }
