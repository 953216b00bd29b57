"""Runs that succeed: reference values, summary, trajectory."""

import json
import math
import re
import subprocess

import pytest
from conftest import Trajectory, program, settings

# Double pendulum, m = l = 1, g = 9.81, released from the horizontal, after 10 s.
DOUBLE_X, DOUBLE_Y = -1.0407657832461712, -1.7073476624693271
# One link in space, θ = 1.2, φ = 0.3, θ̇ = 0.4, φ̇ = 0.9, after 10 s.
SPHERICAL_BOB = (0.7537413353382605, 0.5511731684705575, -0.35788564900065833)

REQUIRED = {
    "space": str,
    "links": int,
    "method": str,
    "stages": int,
    "form": str,
    "solver": str,
    "iteration": str,
    "kernel": str,
    "step": float,
    "duration": float,
    "steps": int,
    "rejected_steps": int,
    "newton_iterations": int,
    "energy_initial": float,
    "energy_final": float,
    "energy_error_max": float,
    "wall_seconds": float,
    "final": dict,
}


# Either form, by the dense solver, and whatever "auto" means.
WAYS = pytest.mark.parametrize(
    "ways",
    [
        ["run.form=momentum"],
        ["run.form=velocity"],
        ["run.form=momentum", "run.solver=dense"],
        ["run.form=velocity", "run.solver=dense"],
    ],
    ids=" ".join,
)


@WAYS
def test_double_pendulum_with_two_stages(pendula, double, ways):
    run = pendula("simulate", double, "--json", *settings("run.step=5e-4", "run.duration=10", *ways))
    assert run.status == 0
    x, y = run.json["final"]["bobs"][1]
    assert abs(x - DOUBLE_X) < 1e-8  # measured 9.7e-12 (momentum), 6.2e-12 (velocity)
    assert abs(y - DOUBLE_Y) < 1e-8  # measured 6.5e-13, 5.5e-13


@WAYS
def test_double_pendulum_with_six_stages(pendula, double, ways):
    run = pendula("simulate", double, "--json", *settings("run.stages=6", "run.duration=10", *ways))
    assert run.status == 0
    x, y = run.json["final"]["bobs"][1]
    assert abs(x - DOUBLE_X) < 1e-12  # measured 1.6e-15
    assert abs(y - DOUBLE_Y) < 1e-12  # measured 1.1e-15


@WAYS
def test_spherical_pendulum_with_four_stages(pendula, spherical, ways):
    run = pendula("simulate", spherical, "--json", *settings(*ways))
    assert run.status == 0
    bob = run.json["final"]["bobs"][0]
    assert math.dist(bob, SPHERICAL_BOB) < 1e-9  # measured 4.9e-11 (dense), 3.5e-15 (chain)


@pytest.mark.parametrize(
    ("overrides", "limit"),
    [
        (["run.method=rk4", "run.step=5e-4"], 1e-9),  # measured 4.8e-12
        (["run.method=dopri5", "run.tolerance=1e-11"], 1e-7),  # measured 3.4e-10
        (["run.method=fehlberg78", "run.tolerance=1e-12"], 1e-8),  # measured 5.5e-12
        (["run.method=taylor", "run.tolerance=1e-12"], 1e-9),  # measured 4.7e-12
    ],
)
def test_explicit_methods_find_the_same_end(pendula, double, overrides, limit):
    run = pendula("simulate", double, "--json", *settings("run.duration=10", *overrides))
    assert run.status == 0
    assert math.dist(run.json["final"]["bobs"][1], (DOUBLE_X, DOUBLE_Y)) < limit


def test_summary_has_the_keys_of_the_interface(pendula, double):
    summary = pendula("simulate", double, "--json", *settings("run.solver=dense")).json
    for key, kind in REQUIRED.items():
        assert type(summary[key]) is kind, key
    assert summary["space"] == "planar"
    assert summary["links"] == 2
    assert summary["method"] == "gauss"
    assert summary["solver"] == "dense"
    assert summary["iteration"] == "fixed-point"
    assert (summary["kernel"], summary["kernel_by"]) == ("planar_2", "build")
    assert summary["steps"] == 200
    assert summary["newton_iterations"] >= summary["steps"]
    assert summary["outcome"] == {"status": "ok"}
    assert set(summary["final"]) == {"t", "q", "v", "points", "theta", "theta_dot", "bobs", "velocities"}
    assert len(summary["final"]["bobs"]) == len(summary["final"]["velocities"]) == 2
    assert all(len(vector) == 2 for vector in summary["final"]["bobs"] + summary["final"]["velocities"])


def test_summary_says_what_auto_ran(pendula, double):
    def ran(*given):
        summary = pendula("simulate", double, "--json", *settings(*given)).json
        return summary["solver"], summary["iteration"], summary["kernel"]

    chain = [("chain", "newton", None), ("chain", "fixed-point", None)]
    assert ran() in chain
    assert ran("run.stages=1") in chain
    assert ran("run.form=velocity") == ("dense", "newton", "planar_2")


@pytest.mark.parametrize("iteration", ["newton", "fixed-point"])
def test_summary_says_the_iteration_that_was_asked_for(pendula, double, iteration):
    summary = pendula("simulate", double, "--json", *settings(f"run.iteration={iteration}")).json
    assert summary["iteration"] == iteration


def test_chains_without_a_kernel_run(pendula, double):
    given = settings("chain.masses=1", "chain.lengths=0.01", "chain.links=97", "run.duration=0.05")
    summary = pendula("simulate", double, "--json", *given).json
    assert (summary["links"], summary["kernel"], summary["outcome"]) == (97, None, {"status": "ok"})
    assert summary["kernel_by"] is None
    assert len(summary["final"]["bobs"]) == 97


def test_spatial_chains_pass_the_pole(pendula, spherical):
    """Started at rest, one link swings in a plane through the pole, as in the plane."""
    at_rest = settings("start.theta=1.0", "start.theta_dot=0", "start.phi_dot=0", "run.stages=6")
    space = pendula("simulate", spherical, "--json", *at_rest).json
    flat = settings("chain.space=planar", "start={theta=1.0}", "run.stages=6")
    plane = pendula("simulate", spherical, "--json", *flat).json
    (x, y, z), (across, up) = space["final"]["bobs"][0], plane["final"]["bobs"][0]
    assert (x, y, z) == pytest.approx(
        (across * math.cos(0.3), across * math.sin(0.3), up), abs=1e-12
    )  # measured 0


def test_summary_in_space_has_phi_and_vectors_of_three(pendula, spherical):
    final = pendula("simulate", spherical, "--json").json["final"]
    arrays = {"theta", "phi", "theta_dot", "phi_dot", "bobs", "velocities"}
    assert set(final) == {"t", "q", "v", "points"} | arrays
    assert [len(final["bobs"][0]), len(final["velocities"][0])] == [3, 3]


def test_what_does_not_apply_is_null(pendula, double):
    rk4 = pendula("simulate", double, "--json", *settings("run.method=rk4")).json
    assert [rk4[key] for key in ("stages", "form", "solver", "iteration", "tolerance")] == [None] * 5
    assert rk4["newton_iterations"] == 0
    assert rk4["kernel"] is None
    adaptive = pendula("simulate", double, "--json", *settings("run.method=dopri5")).json
    assert adaptive["step"] is None
    assert adaptive["tolerance"] == 1e-9


def test_bobs_and_velocities_follow_from_the_angles(pendula, spherical):
    final = pendula("simulate", spherical, "--json").json["final"]
    (theta,), (phi,), (theta_dot,), (phi_dot,) = (final[k] for k in ("theta", "phi", "theta_dot", "phi_dot"))
    bob = (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), -math.cos(theta))
    velocity = (
        math.cos(theta) * math.cos(phi) * theta_dot - math.sin(theta) * math.sin(phi) * phi_dot,
        math.cos(theta) * math.sin(phi) * theta_dot + math.sin(theta) * math.cos(phi) * phi_dot,
        math.sin(theta) * theta_dot,
    )
    assert math.dist(final["bobs"][0], bob) < 1e-15  # measured 0
    assert math.dist(final["velocities"][0], velocity) < 1e-14  # measured 0


def test_trajectory_columns_in_the_plane(pendula, double, tmp_path):
    pendula("simulate", double, "-o", "out.csv")
    trajectory = Trajectory.read(tmp_path / "out.csv")
    assert trajectory.header == [
        "t",
        "theta_1",
        "theta_dot_1",
        "theta_2",
        "theta_dot_2",
        "x_1",
        "y_1",
        "x_2",
        "y_2",
        "energy",
    ]
    assert all(len(row) == len(trajectory.header) for row in trajectory.rows)


def test_trajectory_columns_in_space(pendula, spherical, tmp_path):
    pendula("simulate", spherical, "-o", "out.csv", *settings("chain.links=2", "run.duration=0.1"))
    assert Trajectory.read(tmp_path / "out.csv").header == [
        "t",
        "theta_1",
        "phi_1",
        "theta_dot_1",
        "phi_dot_1",
        "theta_2",
        "phi_2",
        "theta_dot_2",
        "phi_dot_2",
        "x_1",
        "y_1",
        "z_1",
        "x_2",
        "y_2",
        "z_2",
        "energy",
    ]


def test_trajectory_begins_at_the_start_and_ends_at_the_final_state(pendula, spherical, tmp_path):
    summary = pendula("simulate", spherical, "-o", "out.csv", "--json").json
    trajectory = Trajectory.read(tmp_path / "out.csv")
    assert trajectory.rows[0][:5] == [0, 1.2, 0.3, 0.4, 0.9]
    last, final = trajectory.rows[-1], summary["final"]
    assert last[:5] == [final["t"], *(final[k][0] for k in ("theta", "phi", "theta_dot", "phi_dot"))]
    assert last[5:8] == final["bobs"][0]
    assert last[8] == summary["energy_final"]
    assert len(trajectory.rows) == summary["rows"]
    assert summary["trajectory"] == "out.csv"


def test_numbers_have_seventeen_digits(pendula, double, tmp_path):
    pendula("simulate", double, "-o", "out.csv")
    last = (tmp_path / "out.csv").read_text().splitlines()[-1]
    for cell in last.split(","):
        assert cell == f"{float(cell):.17g}"


def test_energy_error_is_the_largest_over_the_rows(pendula, double, tmp_path):
    summary = pendula("simulate", double, "-o", "out.csv", "--json", *settings("run.step=0.02")).json
    energies = Trajectory.read(tmp_path / "out.csv").column("energy")
    largest = max(abs(energy - energies[0]) for energy in energies) / (2 * 9.81 + 1 * 9.81)
    assert summary["energy_initial"] == energies[0]
    assert math.isclose(summary["energy_error_max"], largest, rel_tol=1e-14)  # measured 0
    assert largest > 1e-12  # the step is large enough for an error to be seen


def test_energy_error_without_gravity_is_relative_to_the_energy(pendula, double, tmp_path):
    summary = pendula(
        "simulate",
        double,
        "-o",
        "out.csv",
        "--json",
        *settings("chain.gravity=0", "start.theta=[0.5, 1.5]", "start.theta_dot=[8, -3]", "run.step=0.02"),
    ).json
    energies = Trajectory.read(tmp_path / "out.csv").column("energy")
    largest = max(abs(energy - energies[0]) for energy in energies) / energies[0]
    assert math.isclose(summary["energy_error_max"], largest, rel_tol=1e-14)  # measured 0
    assert largest > 1e-12


@pytest.mark.parametrize(("every", "times"), [(1, 11), (3, 5), (10, 2), (1000, 2)])
def test_every_counts_steps_and_the_last_state_is_a_row(pendula, double, tmp_path, every, times):
    pendula("simulate", double, "-o", "out.csv", *settings("run.step=0.1", f"output.every={every}"))
    t = Trajectory.read(tmp_path / "out.csv").column("t")
    assert len(t) == times
    assert t[0] == 0
    assert t[-1] == pytest.approx(1, abs=1e-15)  # measured 0
    assert t[1] == pytest.approx(min(1, 0.1 * every), abs=1e-15)  # measured 0


def test_the_last_step_is_cut_to_end_at_the_duration(pendula, double, tmp_path):
    summary = pendula(
        "simulate", double, "-o", "out.csv", "--json", *settings("run.step=0.3", "output.every=1")
    ).json
    assert summary["steps"] == 4
    assert summary["final"]["t"] == 1
    t = Trajectory.read(tmp_path / "out.csv").column("t")
    assert t == pytest.approx([0, 0.3, 0.6, 0.9, 1.0], abs=1e-15)  # measured 1.1e-16


def test_no_duration_gives_the_start_alone(pendula, double, tmp_path):
    summary = pendula("simulate", double, "-o", "out.csv", "--json", *settings("run.duration=0")).json
    assert (summary["steps"], summary["rows"], summary["final"]["t"]) == (0, 1, 0)
    assert len(Trajectory.read(tmp_path / "out.csv").rows) == 1


def test_adaptive_methods_end_at_the_duration(pendula, double):
    summary = pendula("simulate", double, "--json", *settings("run.method=dopri5")).json
    assert summary["final"]["t"] == pytest.approx(1, abs=1e-15)  # measured 0
    assert summary["steps"] > 10


def test_wall_seconds_are_of_the_stepping_loop(pendula, double):
    summary = pendula("simulate", double, "--json", *settings("run.duration=10")).json
    assert 0 < summary["wall_seconds"] < 10


def test_json_is_alone_on_standard_output(pendula, double):
    run = pendula("simulate", double, "--json")
    assert run.out.startswith("{") and run.out.endswith("}\n") and run.out.count("\n") == 1
    assert run.err == ""


def test_json_stays_pure_beside_warnings(pendula, double):
    run = pendula("simulate", double, "--json", *settings("run.tolerance=1e-6"))
    assert run.json["outcome"]["status"] == "ok"
    [warning] = run.json["warnings"]
    assert warning == "--set run.tolerance=1e-6: run.tolerance: has no effect with run.step"
    assert run.err == f"pendula: warning: {warning}\n"
    assert pendula("simulate", double, "--json").json["warnings"] == []


def test_degrees_are_radians_in_other_words(pendula, double):
    def final(*start):
        return pendula("simulate", double, "--json", *settings(*start)).json["final"]

    assert final("start.theta=90 deg") == final()  # the same bits
    assert final('start.theta_dot=["180 deg/s", 1]') == final(f"start.theta_dot=[{math.pi}, 1]")


def test_momenta_at_the_start(pendula, spherical):
    """p_θ = m l² θ̇ and p_φ = m l² sin²θ φ̇ of one link."""
    given = settings("chain.masses=2.0", "chain.lengths=0.5", "run.duration=0")
    by_momenta = spherical.with_name("momenta.toml")
    text = spherical.read_text().replace("theta_dot = 0.4", "p_theta = 0.2")
    by_momenta.write_text(text.replace("phi_dot   = 0.9", f"p_phi = {0.45 * math.sin(1.2) ** 2}"))
    final = pendula("simulate", by_momenta, "--json", *given).json["final"]
    assert final["theta_dot"] == pytest.approx([0.4], abs=1e-15)  # measured 1.1e-16
    assert final["phi_dot"] == pytest.approx([0.9], abs=1e-15)  # measured 1.1e-16


def test_an_angle_that_looks_like_degrees_is_warned_of(pendula, double):
    run = pendula("simulate", double, "--json", *settings("start.theta=90"))
    [warning] = run.json["warnings"]
    assert warning.endswith('start.theta: 90 rad is more than a turn; did you mean "90 deg"?')
    assert (run.status, run.err) == (0, f"pendula: warning: {warning}\n")


def test_quiet_leaves_warnings_and_errors(pendula, double):
    run = pendula("simulate", double, "--quiet")
    assert (run.status, run.out, run.err) == (0, "", "")
    doubtful = pendula("simulate", double, "--quiet", "--json", *settings("run.tolerance=1e-6"))
    [warning] = doubtful.json["warnings"]
    assert (doubtful.json["steps"], doubtful.err) == (200, f"pendula: warning: {warning}\n")


def test_quiet_says_that_the_end_cannot_be_trusted(pendula, double):
    chaos = settings("run.duration=50", "run.step=0.01", "start.theta=3.0")
    told = pendula("simulate", double, "--quiet", *chaos)
    assert (told.status, told.out) == (0, "")
    assert "cannot be trusted" in told.err


def test_text_summary_tells_settings_counts_energy_and_last_bob(pendula, double):
    given = settings("run.duration=10", "run.stages=6", "run.solver=dense")
    run = pendula("simulate", double, "-o", "out.csv", *given)
    assert run.err == ""
    lines = {line[:18].strip(): line[19:] for line in run.out.splitlines() if line[:1].isalpha()}
    assert lines["chain"] == "planar, 2 links, mass 2 kg, length 2 m, gravity 9.81 m/s^2"
    assert lines["method"] == "gauss, 6 stages (order 12), momentum form"
    assert lines["solver"] == "dense, fixed-point, kernel planar_2"
    assert lines["step"] == "0.005 s"
    assert lines["duration"] == "10 s, a row every 2 steps"
    assert lines["steps"] == "2000"
    assert lines["last bob"].startswith("x = -1.0407657832")
    assert lines["trajectory"] == "out.csv, 1001 rows"
    table = [line.split() for line in run.out.splitlines() if line.startswith(" ")]
    assert table[0] == ["t", "x_2", "y_2", "energy", "error"]
    assert [float(row[0]) for row in table[1:]] == list(range(11))


def test_loads_change_the_energy_and_the_text_says_change(pendula, double):
    run = pendula("simulate", double, *settings("chain.damping=0.1"))
    assert "with loads" in run.out
    assert "largest change" in run.out


def test_overrides_replace_keys_of_the_file(pendula, double):
    summary = pendula(
        "simulate",
        double,
        "--json",
        *settings("run.stages=3", "run.form=velocity", "start.theta=[0.1, 0.2]", "run.duration=0"),
    ).json
    assert (summary["stages"], summary["form"], summary["final"]["theta"]) == (3, "velocity", [0.1, 0.2])


def test_a_scenario_from_standard_input(double):
    def simulate(text):
        command = [program(), "simulate", "-", "--json"]
        return subprocess.run(command, input=text, capture_output=True, text=True, timeout=60, check=False)

    run = simulate(double.read_text())
    assert (run.returncode, json.loads(run.stdout)["scenario"]) == (0, "-")
    run = simulate("[chain]\nspace = 1\n")
    assert run.returncode == 2
    assert run.stderr.startswith("pendula: standard input:2: chain.space: expected ")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_any_editor_may_have_written_the_scenario(pendula, double, tmp_path, encoding, newline):
    (tmp_path / "größe ☃.toml").write_bytes(double.read_text().replace("\n", newline).encode(encoding))
    run = pendula("simulate", "größe ☃.toml", "--json")
    assert (run.status, run.json["steps"], run.json["scenario"]) == (0, 200, "größe ☃.toml")


def test_overrides_may_stand_before_the_scenario(pendula, double):
    assert pendula("simulate", "--set", "run.duration=0", "--json", double).json["steps"] == 0


def test_a_run_is_the_same_every_time(pendula, double, tmp_path):
    for name in ("a.csv", "b.csv"):
        pendula("simulate", double, "-o", name, *settings("run.duration=10"))
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_an_existing_trajectory_is_replaced(pendula, double, tmp_path):
    (tmp_path / "out.csv").write_text("old\n" * 100000)
    pendula("simulate", double, "-o", "out.csv")
    assert "old" not in (tmp_path / "out.csv").read_text()


def test_what_rests_has_no_minus(pendula, double):
    """Forces on what hangs at rest are -0."""
    text = pendula("simulate", double, *settings("start.theta=0.0")).out
    assert not re.search(r"(?<!e)-0(?![.\d])", text)


def test_steps_of_one_size_are_told_once(pendula, double):
    text = pendula("simulate", double, *settings("run.step=", "run.tolerance=1e-9")).out
    least, most = re.search(r"^steps +\d+ +of (?:(\S+) to )?(\S+) s$", text, re.MULTILINE).groups()
    assert least != most
