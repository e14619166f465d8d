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
from infoset.experiments.reachability.run import COMMAND
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


def test_more_periods_are_searched_if_zero_is_out_of_reach(infoset: Command) -> None:
    found = infoset.json("reach", "--set", "periods=2", "--select", "energy")
    assert found["optimal_miss"] == printed("611.79357068")
    assert (found["min_periods"], found["min_periods_searched"]) == (3, 8)
    assert found["optimal_dimension"] == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--select", "enrgy"], "did you mean energy?"),
        (["--select", "samples"], "--select samples: invalid literal"),
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
    assert "with disturbances, with feedback: terminal norm at most" in printed
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
    ],
)
def test_contradictions_are_refused(problem: str, old: str, new: str, line: str) -> None:
    with pytest.raises(InputError, match=re.escape(line)) as caught:
        read_text(Rendezvous, problem_text(problem).replace(old, new, 1), "mine.toml")
    assert str(caught.value).startswith("mine.toml: ")
