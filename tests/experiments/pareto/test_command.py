from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.built_in import problem_text
from tests.experiments.command_line import Command, strict

STATE = ["x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"]
EXAMPLE = problem_text("pareto-2008")


def changed(old: str, new: str, text: str = EXAMPLE) -> str:
    """The example with its first `old` replaced."""
    assert old in text
    return text.replace(old, new, 1)


def test_the_published_example(infoset: Command) -> None:
    code, out, _ = infoset("pareto", "--prefer", "x_m=0,z_m=50", "--json", "x.json")
    assert code == 0
    results = strict(Path("x.json").read_text())
    meeting = [
        -40.25672153628559,
        0.0,
        36.755682761552535,
        0.0,
        0.0,
        0.0,
    ]  # of the acceptance, w = 0.001176
    assert results["meeting"] == pytest.approx(dict(zip(STATE, meeting, strict=True)), rel=1e-9)
    assert [each["name"] for each in results["craft"]] == ["first", "second", "third"]
    excess = [
        each["cost_squared_m2_s3"] - each["ideal_cost_squared_m2_s3"] for each in results["craft"]
    ]
    assert [each["excess_m2_s3"] for each in results["craft"]] == pytest.approx(excess, rel=1e-12)
    assert results["group_loss_m2_s3"] == pytest.approx(18.58690436675526, rel=1e-9)
    assert results["coalitions"]["first+third"]["excess_m2_s3"] == pytest.approx(
        10.45954394, rel=1e-9
    )
    assert results["core"]["verdict"] == "empty"
    assert set(results["selections"]) == {
        "min_group_loss",
        "min_sum_of_costs",
        "minimax_excess",
        "preferred",
    }
    assert len(results["sweep"]["group_loss_m2_s3"]) == len(results["sweep"]["meeting_time_s"])
    for piece in (
        "group loss",
        "18.6",
        "Shapley value",
        "the core is empty: each craft alone has zero",
        "preferred",
    ):
        assert piece in out


def test_an_intercept_and_craft_that_start_later(
    infoset: Command, mine: Callable[[str], Path]
) -> None:
    text = changed('free = ["x", "z"] ', 'free = ["x", "y", "z"]\nmeet = "intercept"\n#')
    file = mine(
        changed("weight = 1.0", "weight = 2.0\nstart_s = 5.0", text.replace("y_m = 0.0\n", "", 1))
    )
    code, out, _ = infoset("pareto", file, "--json", "x.json", "--csv", "-")
    assert code == 0
    results = strict(Path("x.json").read_text())
    assert list(results["meeting"]) == STATE[:3]  # each arrives with a velocity of its own
    assert all(each["ideal_cost_squared_m2_s3"] < 1e-20 for each in results["craft"])
    assert "distances" not in results  # durations differ, and so do the matrices
    assert len(results["matrix"]) == 3
    rows = [line.split(",") for line in out.splitlines()[1:]]
    assert float(rows[0][1]) == 5.0
    ends = np.array([[float(cell) for cell in row[2:5]] for row in rows if float(row[1]) == 30.0])
    np.testing.assert_allclose(ends, np.tile(ends[0], (3, 1)), atol=1e-8)


def test_bound_above_the_peaks_changes_nothing(infoset: Command) -> None:
    without = infoset.json("pareto", "-q")
    bounded = infoset.json("pareto", "-q", "--set", "max_control_m_s2=1.6")
    assert bounded | {"problem_hash": ""} == without | {"problem_hash": ""}
    assert without["imposed_bound"] is None


def test_bound_below_a_peak_is_imposed(infoset: Command) -> None:
    without = infoset.json("pareto", "-q")
    code, screen, _ = infoset(
        "pareto",
        "--set",
        "max_control_m_s2=1.1",
        "--json",
        "x.json",
        "--csv",
        "x.csv",
        "--html",
        "x.html",
    )
    assert code == 0
    bounded = strict(Path("x.json").read_text())

    peaks = [craft["peak_control_m_s2"] for craft in bounded["craft"]]
    assert peaks[0] < 1.1
    assert peaks[1:] == pytest.approx([1.1, 1.1], rel=1e-9)
    loss = sum(craft["excess_m2_s3"] for craft in bounded["craft"])
    assert bounded["group_loss_m2_s3"] == pytest.approx(loss, rel=1e-12)
    assert loss > without["group_loss_m2_s3"]
    imposed = bounded["imposed_bound"]
    assert imposed["without"]["meeting"] == without["meeting"]
    assert imposed["without"]["group_loss_m2_s3"] == without["group_loss_m2_s3"]
    # What does not depend on the bound stays.
    for key in ("selections", "coalitions", "sweep", "matrix"):
        assert bounded[key] == without[key]
    rows = [line.split(",") for line in Path("x.csv").read_text().splitlines()[1:]]
    controls = np.array([[float(cell) for cell in row[8:11]] for row in rows])
    assert np.linalg.norm(controls, axis=1).max() <= 1.1 * (1.0 + 1e-9)
    ends = np.array([[float(cell) for cell in row[2:8]] for row in rows if float(row[1]) == 30.0])
    np.testing.assert_allclose(ends, np.tile([*bounded["meeting"].values()], (3, 1)), atol=1e-8)
    words = "the bound of 1.1 m/s^2 is imposed: without it the controls reach 1.501 m/s^2"
    assert words in " ".join(screen.split())
    assert words[1:] in Path("x.html").read_text()


def test_bound_that_no_meeting_keeps_is_refused_with_the_smallest_one(infoset: Command) -> None:
    err = infoset.refused("pareto", "--set", "max_control_m_s2=0.5")
    assert (
        "no meeting is possible with controls of at most 0.5 m/s^2; second and third need at least"
        in err
    )
    minimum = float(err.split("at least ")[1].split(" m/s^2")[0])
    assert f"{minimum / 0.5:.4g} times the bound" in err
    # Just over what is said, it is possible; at it, the reason is the same.
    assert infoset("pareto", "--set", f"max_control_m_s2={minimum * 1.001}", "-q")[0] == 0
    close = infoset.refused("pareto", "--set", f"max_control_m_s2={minimum * (1.0 + 1e-6)}")
    assert f"{minimum:.6g} m/s^2" in close


@pytest.mark.parametrize(
    "preferred",
    [
        "x_m=0",
        "x_m=0,z_m=1,y_m=2",
        "x_m=0,x_m=1",
        "x_m=0,x_m=1,z_m=2",
        "x_m=0,z_m=far",
        "x_m=0,z_m=nan",
        "x_m=0,z_m=1e300",
    ],
)
def test_malformed_preferred_meeting_is_refused(infoset: Command, preferred: str) -> None:
    err = infoset.refused("pareto", "--prefer", preferred)
    assert "--prefer: must be a finite number for each free component" in err
    assert "for example --prefer x_m=0,z_m=0" in err


def test_a_preferred_meeting_of_craft_that_start_apart(infoset: Command) -> None:
    err = infoset.refused("pareto", "--set", "craft.1.start_s=5", "--prefer", "x_m=0,z_m=50")
    assert "known only for craft that start at the same time" in err


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            changed("duration_s = 30.0", "duration_s = 1e9"),
            "duration_s is 1.18e+06 radians of the orbit",
        ),
        (
            changed('free = ["x", "z"]', 'free = ["x", "x"]'),
            "name one or more free components",
        ),
        (changed('free = ["x", "z"]', 'free = ["vy"]\nmeet = "intercept"'), "free only x, y and z"),
        (
            EXAMPLE.replace("weight = 1.0", "").replace("velocity_m_s", "weight = 0\nvelocity_m_s"),
            "weights are zero",
        ),
        (
            changed("weight = 1.0", "start_s = 30.0"),
            "craft 'first': it must start before the meeting at 30.0 s",
        ),
    ],
)
def test_unsound_files_are_refused(
    text: str, told: str, infoset: Command, mine: Callable[[str], Path]
) -> None:
    assert told in infoset.refused("pareto", mine(text), "--json", "x.json")
    assert not Path("x.json").exists()
