from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import load_problem, read_text
from infoset.experiments.reachability.command import Reach
from infoset.experiments.reachability.figures import draw_controls
from infoset.experiments.reachability.file import Rendezvous
from infoset.experiments.reachability.page import reachability_page
from infoset.experiments.reachability.run import COMMAND
from infoset.rendezvous.reachability import minimum_energy, optimal_controls
from infoset.rendezvous.reachability.conic import ConeProgram
from tests.built_in import problem_text
from tests.experiments.command_line import Command
from tests.rendezvous.reachability.conftest import printed

CASES = Path(__file__).parents[2] / "rendezvous" / "reachability" / "cases"


def test_the_published_problem(infoset: Command) -> None:
    found = infoset.json("reach", "--select", "energy,l1,vertices,samples:3", "--replan")
    assert (found["optimal_miss"], found["min_periods"], found["optimal_dimension"]) == (0.0, 3, 6)
    tube = found["sets"][1]["tube"]
    assert [tube[key] for key in ("vertices", "facets", "dimension")] == [27, 9, 6]
    assert tube["min"][1] == pytest.approx(-2032.6346647262549, rel=1e-9)
    assert [each["period"] for each in found["sets"]] == [1, 2, 3, 4]
    names = [each["name"] for each in found["controls"]]
    assert names == [
        "energy",
        "l1",
        *(f"vertex {k}" for k in range(1, 28)),
        *(f"sample {k}" for k in range(1, 4)),
    ]
    energy = found["controls"][0]
    assert energy["energy"] == pytest.approx(0.14323052820, abs=1e-11)
    assert energy["nonlinear_miss"] == pytest.approx(1.668028, abs=1e-6)
    assert np.abs(energy["linear"][-1]).max() < 1e-9
    for each in found["controls"]:
        within = np.array(each["controls"])[..., None] - found["control_ranges"]
        assert (within[..., 0] >= -1e-9).all()
        assert (within[..., 1] <= 1e-9).all()
    assert found["replan"]["miss"] < 1.3


@pytest.mark.parametrize("thrust", ["box", "ball"])
def test_delta_v(infoset: Command, thrust: str) -> None:
    settings = ("--set", f'thrust="{thrust}"', "--select", "energy", "--replan")
    found = infoset.json("reach", *settings)
    for result in (found["controls"][0], found["replan"]):
        control = 0.15 * np.array(result["controls"])
        used = result["delta_v_m_s"]
        assert [used[axis] for axis in "xyz"] == pytest.approx(
            (180.0 * np.abs(control).sum(axis=0)).tolist()
        )
        engines = (
            np.abs(control).sum() if thrust == "box" else np.sqrt((control**2).sum(axis=1)).sum()
        )
        assert used["sum"] == pytest.approx(180.0 * float(engines))


def test_impulses_of_the_example_of_curtis(infoset: Command) -> None:
    # Orbital Mechanics for Engineering Students, example 7.4, with n = 0.00115697 rad/s.
    impulses = np.array([[29.357, -66.751, 13.030], [25.821, 0.472, 24.493]])
    found = infoset.json("reach", "two-impulses", "--replan", "--csv", "states.csv")
    least = found["controls"][0]
    assert least["name"] == "delta-v"
    np.testing.assert_allclose(least["controls"], impulses, atol=6e-4)
    # Six components with three printed decimals.
    lengths = float(np.linalg.norm(impulses, axis=1).sum())
    assert least["delta_v_m_s"]["sum"] == pytest.approx(lengths, abs=2e-3)
    assert (found["min_periods"], found["optimal_dimension"]) == (2, 0)
    assert "impulses at the starts of the periods, in m/s" in found["units"]["controls"]
    # The plan is solved again from the nonlinear state, which the first impulse does not change.
    np.testing.assert_allclose(found["replan"]["controls"][0], impulses[0], atol=6e-4)
    assert Path("states.csv").read_text().splitlines()[0].endswith("impulse_z_m_s")


def test_impulses_are_drawn_as_stems_and_jumps() -> None:
    report = COMMAND.report(Reach(problem="two-impulses", select="delta-v"))
    ((member, path),) = report.shown
    times_s = report.shown_times_s
    assert len(path) == len(times_s)
    places = np.flatnonzero(np.diff(times_s) == 0.0)
    np.testing.assert_array_equal(times_s[places], [0.0, 28800.0])
    jumps = path[places + 1] - path[places]
    np.testing.assert_allclose(jumps[:, 3:], member.controls, atol=1e-9)
    assert draw_controls(report).axes[0].get_ylabel().endswith(", m/s")
    assert "Impulse along x (radial)" in reachability_page(report)
    printed = "\n".join(map(str, COMMAND.lines(report)))
    assert "u is an impulse at the start of a period, in m/s" in printed


def test_backward_sets_are_written_and_printed(infoset: Command) -> None:
    arguments = ("reach", "--backward", "--select", "energy", "--set", "bounds.control=0.2")
    found = infoset.json(*arguments)
    bounds = np.array(found["backward"])
    assert bounds.shape == (5, 6, 2)
    # The tube is inside.
    for each in found["sets"]:
        at_time = bounds[each["period"]]
        assert (np.array(each["tube"]["min"]) >= at_time[:, 0] - 1e-5).all()
        assert (np.array(each["tube"]["max"]) <= at_time[:, 1] + 1e-5).all()
    assert "x of the backward set" in infoset(*arguments)[1]


def test_samples_follow_the_seed() -> None:
    one, same, other = (
        COMMAND.report(Reach(select="samples:2", seed=seed)).members for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one[1].controls, same[1].controls)
    assert (one[1].controls != other[1].controls).any()


@pytest.mark.parametrize(
    ("selected", "hidden"),
    [("energy,l1,norms,analytic", "minimum norms"), ("samples:20", "15 of 20")],
)
def test_figures_name_the_controls_that_they_do_not_draw(selected: str, hidden: str) -> None:
    (legend,) = draw_controls(COMMAND.report(Reach(select=selected))).legends
    assert (
        legend.get_title().get_text()
        == f"not drawn, as equal to others or beyond the first 5: {hidden}"
    )


def test_constraints_between_the_periods_bind() -> None:
    # Short of the bound at whole periods only, a control may break it between them.
    settings = [
        "model=time-varying",
        "initial.position_m=[-2540, -2990, 2120]",
        "initial.velocity_m_s=[2, -1, 3]",
    ]
    loose, kept = (
        COMMAND.report(
            Reach(settings=[*settings, f"checks_between_periods={checks}"], select="energy")
        ).members[0]
        for checks in (0, 5)
    )
    assert loose.between > 1e-3
    assert kept.between < 0.2 * loose.between


def test_speed_behind_the_target_is_bounded_by_its_distance() -> None:
    # y + 200 s vy <= 80 m from t = 2 to 10: the speed is at most (80 m - y) / 200 s. And the thrust
    # along the motion is at most 0.3 in the first two periods.
    text = problem_text("approach-cone").split("[disturbance]")[0]
    text += (
        "[[keep_in]]\nnormals = [[0, 1, 0]]\nvelocity_normals_s = [[0, 200, 0]]\n"
        "offsets_m = [80]\nfrom_period = 2\nuntil_period = 10\n"
        "[[control_limits]]\nnormals = [[0, 1, 0]]\noffsets = [0.3]\nuntil_period = 1\n"
    )
    rendezvous = read_text(Rendezvous, text, "mine.toml")
    optimal = optimal_controls(rendezvous.problem)
    controls = minimum_energy(optimal)
    states = rendezvous.problem.run(controls)
    sums = states[:, 1] + 200.0 * states[:, 4]

    assert optimal.miss == 0.0
    # Both bind: without them the control of minimum energy breaks them.
    assert sums[2:11].max() == pytest.approx(80.0, abs=1e-5)
    assert controls[:2, 1].max() == pytest.approx(0.3, abs=1e-7)


def test_more_periods_are_searched_if_zero_is_out_of_reach(infoset: Command) -> None:
    found = infoset.json("reach", "--set", "periods=2", "--select", "energy")
    assert found["optimal_miss"] == printed("611.79357068")
    assert (found["min_periods"], found["min_periods_searched"]) == (3, 8)
    assert found["optimal_dimension"] == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--select", "enrgy"], "did you mean energy?"),
        (["--select", "samples"], 'a whole number N between 1 and 1000, found "samples"'),
        (["--select", "samples:two"], 'a whole number N between 1 and 1000, found "samples:two"'),
        (["--select", "samples:1001"], 'a whole number N between 1 and 1000, found "samples:1001"'),
        (["--select", "energy:5"], '--select energy: takes no number, found "energy:5"'),
        (["--select", "samples:3,samples:4"], "--select samples: is given twice"),
        (["approach-cone", "--select", "vertices"], "choose for example --select samples:20"),
        (
            [CASES / "s4_1_59.toml", "--select", "vertices"],
            "the optimal controls have 22875 vertices, more than the",
        ),
        (
            [
                *("--set", "orbit.eccentricity=0.9", "--set", "orbit.semi_major_axis_km=65000"),
                *("--set", "periods=40", "--set", "period_s=1000"),
            ],
            "the linear model multiplies deviations by over 1e+10",
        ),
    ],
)
def test_wrong_options_are_refused(arguments: list[str], told: str, infoset: Command) -> None:
    assert told in infoset.refused("reach", *arguments)


def test_inaccurate_solution_is_refused(infoset: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    # Which programs a solver fails on depends on the machine, so here every answer fails the check.
    monkeypatch.setattr(ConeProgram, "violation_and_gap", lambda *_: (0.0, 1.0))
    err = infoset.refused("reach", CASES / "s2_2_68.toml")
    assert (
        "a convex program was not solved to 1e-07: relative gap 1, constraints violated by 0" in err
    )


def test_conflict_is_reported_with_period_and_amount(infoset: Command) -> None:
    settings = ["--set", "bounds.control=0.01", "--set", "initial.velocity_m_s=[2.0, -7.0, 3.0]"]
    err = infoset.refused("reach", *settings)
    assert "they conflict at t = 1 (the bound on y at t = 1" in err
    by = float(err.split("relaxed by ")[1].split(" %")[0]) / 100.0
    # Relaxed by so much and a little more, it can be kept.
    relaxed = [
        f"bounds.{key}={value * (1.0 + by * 1.01)}"
        for key, value in (("position_m", 3e3), ("velocity_m_s", 7.5))
    ]
    assert (
        infoset("reach", *settings, "--set", relaxed[0], "--set", relaxed[1], "--select", "energy")[
            0
        ]
        == 0
    )


def test_the_published_problem_with_less_thrust(infoset: Command) -> None:
    found = infoset.json("reach", "--set", "bounds.control=0.15")
    assert found["optimal_miss"] == printed("1.62757318")


@pytest.mark.thorough
def test_the_cone_is_inside_its_angle_and_kept() -> None:
    given = load_problem("approach-cone")
    problem = given.problem
    assert problem.normals is not None
    assert problem.offsets is not None
    # Points of the pyramid are inside the circular cone, and its edges are on it.
    generator = np.random.default_rng(0)
    points = generator.uniform(-900.0, 500.0, (20000, 3))
    inside = (points @ problem.normals[:, :3].T <= problem.offsets[0]).all(axis=1)
    away = points[inside] - [0.0, 15.0, 0.0]
    angles = np.degrees(np.arctan2(np.linalg.norm(away[:, ::2], axis=1), -away[:, 1]))
    assert 19.0 < angles.max() <= 20.0 + 1e-9
    report = COMMAND.report(Reach(problem="approach-cone", select="energy,analytic", replan=True))
    printed = "\n".join(map(str, COMMAND.lines(report)))
    assert "with navigation errors, 10 simulations: median" in printed
    assert (
        "with the errors of [disturbance], with feedback of the exact state, without the errors of "
        "[navigation]: terminal norm at most"
    ) in printed
    for each in report.members:
        gaps = each.linear @ problem.normals.T - problem.offsets
        assert gaps.max() < 1e-6
    assert report.robustness is not None
    assert report.robustness.plan is not None
    assert report.min_periods == 9


POSITION = "[-2540.0, -2650.0, 2120.0]"
CONE = "[cone]\napex_m = [0.0, 20.0, 0.0]\naxis = {}\nhalf_angle_deg = 20.0\n[orbit]"
KEEP_IN = "[[keep_in]]\nnormals = {}\noffsets_m = {}\n[orbit]"


@pytest.mark.parametrize(
    ("problem", "old", "new", "line"),
    [
        (
            "rendezvous-2021",
            "[orbit]",
            KEEP_IN.format("[[1, 0, 0]]", "[1, 2]"),
            "offsets_m: must have 1 numbers",
        ),
        (
            "rendezvous-2021",
            "[orbit]",
            CONE.format("[0, -1, 0]"),
            "is outside its constraints: face 3 of the cone by",
        ),
        (
            "rendezvous-2021",
            POSITION,
            "[3200.0, -2650.0, 2120.0]",
            "is outside its constraints: x by 200",
        ),
        (
            "rendezvous-2021",
            "10000.0",
            "6000.0",
            "orbit: semi_major_axis_m: the orbit meets the planet",
        ),
        (
            "rendezvous-2021",
            "180.0",
            "1e9",
            "period_s, in all periods, is 2.53e+06 radians of the orbit",
        ),
        (
            "rendezvous-16-periods",
            "control = 1.0",
            "control = [1, 1, 0.5]",
            "in a ball the bounds on controls must",
        ),
        (
            "approach-cone",
            "[orbit]",
            "checks_between_periods = 1\n[orbit]",
            "checks_between_periods: must be 0 with",
        ),
        (
            "rendezvous-2021",
            "[orbit]",
            KEEP_IN.format("[[0, 0, 0]]", "[1]"),
            "normals: must have no row of zeros",
        ),
        (
            "rendezvous-2021",
            "[orbit]",
            KEEP_IN.format(
                "[[1, 0, 0]]", "[1]\nvelocity_normals_s = []\nfrom_period = 3\nuntil_period = 2"
            ),
            "until_period: must be at least from_period, 3",
        ),
        (
            "rendezvous-2021",
            "[orbit]",
            "[[control_limits]]\nnormals = [[1, 0, 0]]\noffsets = [-1.0]\nfrom_period = 1\n[orbit]",
            "the limits on the controls leave no room at t = 1",
        ),
        ("approach-cone", "acceleration_m_s2 = 0.01\n", "", "acceleration_m_s2: is missing"),
        (
            "approach-cone",
            "periods = 12",
            "periods = 12\nmax_impulse_m_s = 1.0",
            'max_impulse_m_s: needs engine = "impulses"',
        ),
        (
            "approach-cone",
            "periods = 12",
            'periods = 12\nengine = "impulses"',
            "max_impulse_m_s: is missing",
        ),
        (
            "two-impulses",
            "velocity_m_s = 100.0",
            "velocity_m_s = 100.0\ncontrol = 1.0",
            "engine: impulses are limited by max_impulse_m_s",
        ),
        (
            "two-impulses",
            "max_impulse_m_s = 100.0",
            "max_impulse_m_s = 1e8",
            "max_impulse_m_s: full control over a period changes",
        ),
    ],
)
def test_contradictions_are_refused(problem: str, old: str, new: str, line: str) -> None:
    with pytest.raises(InputError, match=re.escape(line)) as caught:
        read_text(Rendezvous, problem_text(problem).replace(old, new, 1), "mine.toml")
    assert str(caught.value).startswith("mine.toml: ")
