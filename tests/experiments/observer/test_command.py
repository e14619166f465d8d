"""`infoset observe`: published numbers, files, data of CSV files, simulations and
contradictions.
"""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments.common.built_in_files import built_in_files
from infoset.experiments.common.input_file import load_problem
from infoset.experiments.observer.command import Errors
from infoset.experiments.observer.data import simulate
from tests.experiments.command_line import Command, strict

PUBLISHED = json.loads(
    (Path(__file__).parents[2] / "data" / "observer" / "alamo-2005.json").read_text()
)
FOUR_STATES = """kind = "observer"
name = "four"
[system]
A = [[1, 0.5, 0, 0], [0, 0.9, 0.1, 0], [0, 0, 1, 0.5], [0.1, 0, 0, 0.9]]
C = [[1, 0, 0, 0], [0, 0, 1, 0]]
[initial]
lower = [-1, -1, -1, -1]
upper = [1, 1, 1, 1]
[disturbance]
center = [0, 0, 0, 0]
generators = [[0, 0.1, 0, 0], [0, 0, 0, 0.1]]
[noise]
half_width = [0.2, 0.2]
[simulation]
steps = 10
"""


def test_the_published_example_has_the_exact_bounds(infoset: Command) -> None:
    results = infoset.json("observe", "observer-2005")
    assert [step["k"] for step in results["steps"]] == list(range(20))
    for step, hull in zip(
        results["steps"], PUBLISHED["exact_rational"]["hull_of_each_step"], strict=True
    ):
        assert step["empty"] is False
        np.testing.assert_allclose([step["lower"], step["upper"]], hull, rtol=0.0, atol=1e-12)
    assert [len(step["vertices"]) for step in results["steps"]] == PUBLISHED["exact_rational"][
        "counts"
    ]
    assert results["final"] == {
        "lower": results["steps"][-1]["lower"],
        "upper": results["steps"][-1]["upper"],
    }
    assert results["inconsistency"] is None
    assert results["excess_widths"] is None


def test_bounds_of_a_simulation(infoset: Command) -> None:
    code, out, _ = infoset("observe", "vehicle", "--smooth", "--json", "x.json", "--csv", "x.csv")
    assert code == 0
    assert "true state inside the set: 40 of 40 steps" in out
    rows = list(csv.DictReader(io.StringIO(Path("x.csv").read_text())))
    results = strict(Path("x.json").read_text())
    assert len(rows) == len(results["steps"]) == 40
    for row, step in zip(rows, results["steps"], strict=True):
        assert float(row["x2_lower"]) == step["lower"][1]
        assert float(row["x1_smoothed_upper"]) == step["smoothed"]["upper"][0]
        assert (
            step["lower"][0] <= step["smoothed"]["lower"][0] <= step["state"][0] <= step["upper"][0]
        )


def test_a_csv_file_gives_the_same_as_the_problem_file(infoset: Command) -> None:
    lines = ["y1", *(repr(y) for y in PUBLISHED["y"][0])]
    Path("data.csv").write_text("\n".join(lines) + "\n", encoding="utf-8-sig")
    own = infoset.json("observe", "observer-2005", "--data", "data.csv")
    assert own["steps"] == infoset.json("observe", "observer-2005")["steps"]
    assert own["data"] == "measurements of data.csv"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"y1,u1\n", "has 0 steps"),
        (b"y1,u1\n1,1\n\n1,1\n", "line 3: y1,u1 must be numbers"),
        (b"y1,u1\n1,1\nfast,1\n", 'only measurements may be empty or NaN; found "fast,1"'),
        (b"y1,u1\n1,nan\n", 'found "1,nan"'),
        (b"y1,thrust\n1,1\n", "the header must have each of y1,u1 once (see --columns)"),
        (b"\xff\xfe\x00", "is not a CSV file in UTF-8"),
    ],
)
def test_wrong_data_are_refused(content: bytes, told: str, infoset: Command) -> None:
    Path("data.csv").write_bytes(content)
    assert told in infoset.refused("observe", "vehicle", "--data", "data.csv")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_files_of_spreadsheets_give_the_same(
    separator: str, encoding: str, newline: str, infoset: Command
) -> None:
    rows = [["note", "y1", "u1"], ["a, b", "0.0", "1.0"], ["", "", "0.5"], ["", "12.0", "0"]]
    text = newline.join(
        separator.join(cell if separator not in cell else f'"{cell}"' for cell in row)
        for row in rows
    )
    Path("data.csv").write_bytes(f"{text}{newline}".encode(encoding))
    Path("plain.csv").write_text("y1,u1\n0.0,1.0\n,0.5\n12.0,0\n")
    steps = infoset.json("observe", "vehicle", "--data", "data.csv")["steps"]
    assert steps == infoset.json("observe", "vehicle", "--data", "plain.csv")["steps"]


def test_a_last_measurement_that_is_missing_in_a_file_with_tabs_is_a_step(infoset: Command) -> None:
    Path("data.csv").write_text("u1\ty1\n1.0\t0.0\n0.5\t\n")
    assert len(infoset.json("observe", "vehicle", "--data", "data.csv")["steps"]) == 2


def test_decimal_commas_are_refused_and_not_read_as_other_numbers(infoset: Command) -> None:
    Path("data.csv").write_text("y1;u1\n1,234;0\n")
    told = infoset.refused("observe", "vehicle", "--data", "data.csv")
    assert "line 2: y1,u1 must be numbers of at most 1e+60 in size, with a decimal point" in told


def test_an_empty_cell_is_a_missing_measurement(infoset: Command) -> None:
    Path("data.csv").write_text("y1,u1\n0.0,1.0\n ,0.5\n12.0,0\n")
    results = infoset.json("observe", "vehicle", "--data", "data.csv")
    Path("other.csv").write_text("thrust,time_s,range_m\n1,0,0\n0.5,0.5,NaN\n0,1,12\n")
    columns = "--columns", "y1=range_m,u1=thrust"
    assert (
        infoset.json("observe", "vehicle", "--data", "other.csv", *columns)["steps"]
        == results["steps"]
    )
    told = infoset.refused("observe", "vehicle", "--data", "other.csv", "--columns", "y2=range_m")
    assert '--columns: "y2=range_m": must be NAME=COLUMN with a name of y1, u1' in told
    first, second, third = results["steps"]
    assert first["upper"][0] == pytest.approx(3.0)
    # Without a measurement: from 0 to 20 m/s, 1 m/s^2 and the disturbance.
    assert second["lower"] == pytest.approx([-3.0 + 0.125 - 0.05, 0.5 - 0.2])
    assert second["upper"] == pytest.approx([3.0 + 10.0 + 0.125 + 0.05, 20.5 + 0.2])
    assert third["lower"][0] == pytest.approx(9.0)
    Path("data.csv").write_text("y1\n0.0\n\n0.1\n\n\n")  # of a file of one column, an empty line
    assert len(infoset.json("observe", "observer-2005", "--data", "data.csv")["steps"]) == 3


def changed(old: str, new: str, name: str = "vehicle") -> str:
    text = built_in_files()[name].text
    assert old in text
    return text.replace(old, new)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("system.A=[[1, 2], [3]]", "state_matrix must be an array, its rows of equal length"),
        ("system.A=[[1, 2, 3], [3, 4, 5]]", "state_matrix must have the shape (3, 3): got (2, 3)"),
        ("system.c=[1]", "offset must have the shape (2,)"),
        ("noise.half_width=[3, 1]", "noise must"),
        (
            "initial.center=[0, 0]",
            "initial: must have lower and upper, or center and generators, or vertices",
        ),
        ("initial.lower=[11, 0]", "initial: the box is reversed"),
        (
            "measurements.y=[[1, 2], []]",
            "measurements.y must be an array, its rows of equal length",
        ),
        (
            "simulation.missing=[3, -1]",
            "simulation.missing: number 2 must be at least 0, found [3, -1]",
        ),
    ],
)
def test_wrong_problems_are_refused(setting: str, told: str, infoset: Command) -> None:
    err = infoset.refused("observe", "vehicle", "--set", setting)
    assert told in err
    assert err.count("\n") == 1


def test_a_contradiction_is_reported(infoset: Command) -> None:
    Path("odd.toml").write_text(changed("[-0.1292621672249405]", "[-1.5]", "observer-2005"))
    code, out, _ = infoset("observe", "odd.toml", "--out", "o", "--html", "page.html", "--smooth")
    assert code == 0
    assert (
        "the measurements contradict the model at step 10: no state is possible; the bound of "
        "output 1"
    ) in out
    results = strict(Path("o/results.json").read_text())
    assert [step["empty"] for step in results["steps"]] == [False] * 10 + [True] * 10
    assert results["final"] == {"lower": None, "upper": None}
    assert results["inconsistency"]["k"] == 10
    assert '"empty_from":10' in Path("page.html").read_text(encoding="utf-8")
    # With the bound enlarged by the excess a state is possible.
    width = 0.2 + results["inconsistency"]["excess"]
    alone = (
        Path("odd.toml")
        .read_text()
        .replace("half_width = [0.2]", f"half_width = [{width + 1e-9!r}]")
    )
    Path("wide.toml").write_text(alone)
    assert infoset.json("observe", "wide.toml")["steps"][10]["empty"] is False


@pytest.mark.parametrize("errors", list(Errors))
def test_simulated_errors_are_within_their_bounds(errors: Errors) -> None:
    problem = load_problem("vehicle")
    data = simulate(problem, errors, 5)
    assert data.states is not None
    off = np.abs(data.measured - data.states @ np.transpose(problem.system.C)).ravel()
    assert np.isnan(off).sum() == 9
    known = off[~np.isnan(off)]
    assert known.max() <= 3.0 + 1e-12
    assert np.allclose(known, 3.0) == (errors is Errors.EXTREMAL)
    again = simulate(problem, errors, 5)
    np.testing.assert_array_equal(again.measured, data.measured)


def test_a_set_may_be_given_by_its_vertices(infoset: Command) -> None:
    corners = "vertices = [[-10.0, 0.0], [10.0, 0.0], [10.0, 20.0], [-10.0, 20.0]]"
    Path("mine.toml").write_text(changed("lower = [-10.0, 0.0]\nupper = [10.0, 20.0]", corners))
    Path("data.csv").write_text("y1,u1\n0.0,1.0\n1.0,0.0\n")
    one, other = (
        infoset.json("observe", name, "--data", "data.csv")["final"]
        for name in ("mine.toml", "vehicle")
    )
    np.testing.assert_allclose(one["lower"] + one["upper"], other["lower"] + other["upper"])
    for errors in Errors:
        states = simulate(load_problem("mine.toml"), errors, 1).states
        assert states is not None
        assert (np.abs(states[0] - [0.0, 10.0]) <= 10.0).all()


def test_four_states_are_polytopes(infoset: Command) -> None:
    Path("four.toml").write_text(FOUR_STATES)
    results = infoset.json("observe", "four.toml")
    assert "vertices" not in results["steps"][0]
    assert all(0.0 <= excess < 1.0 for excess in results["excess_widths"])
    assert "the sets have a bounded number of facets" in infoset("observe", "four.toml")[1]
    for step in results["steps"]:
        assert (np.array(step["lower"]) <= step["state"]).all()
        assert (np.array(step["upper"]) >= step["state"]).all()


EIGHT_STATES = """kind = "observer"
name = "eight"
[system]
A = [
  [1, 0.5, 0, 0, 0, 0, 0, 0],
  [0, 0.9, 0, 0, 0, 0, 0, 0],
  [0, 0, 1, 0.5, 0, 0, 0, 0],
  [0, 0, 0, 0.9, 0, 0, 0, 0],
  [0, 0, 0, 0, 1, 0.5, 0, 0],
  [0, 0, 0, 0, 0, 0.9, 0, 0],
  [0, 0, 0, 0, 0, 0, 1, 0.5],
  [0, 0.1, 0, 0, 0, 0, 0, 0.9],
]
C = [
  [1, 0, 0, 0, 0, 0, 0, 0],
  [0, 0, 1, 0, 0, 0, 0, 0],
  [0, 0, 0, 0, 1, 0, 0, 0],
  [0, 0, 0, 0, 0, 0, 1, 0],
]
[initial]
lower = [-1, -1, -1, -1, -1, -1, -1, -1]
upper = [1, 1, 1, 1, 1, 1, 1, 1]
[disturbance]
center = [0, 0, 0, 0, 0, 0, 0, 0]
generators = [[0, 0.1, 0, 0.1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0.1, 0, -0.1]]
[noise]
half_width = [0.2, 0.2, 0.2, 0.2]
[simulation]
steps = 13
missing = [3]
"""


def test_eight_states_have_bounds_figures_and_a_page(infoset: Command) -> None:
    Path("eight.toml").write_text(EIGHT_STATES)

    code, out, _ = infoset("observe", "eight.toml", "--smooth", "--out", "o", "--html", "page.html")

    assert code == 0
    assert "true state inside its bounds: 13 of 13 steps" in out
    assert "the bounds are those of the last measurements" in out
    results = strict(Path("o/results.json").read_text())
    assert "vertices" not in results["steps"][0]
    assert all(0.0 <= excess < 0.1 for excess in results["excess_widths"])
    for step in results["steps"]:
        for ends in (step, step["smoothed"]):
            assert (np.array(ends["lower"]) <= step["state"]).all()
            assert (np.array(ends["upper"]) >= step["state"]).all()
    assert '"centre":null' in Path("page.html").read_text(encoding="utf-8")
    assert list(Path("o").glob("figure-bounds*"))
    assert not list(Path("o").glob("figure-sets*"))


@pytest.mark.parametrize("states", [2, 3])
@pytest.mark.parametrize("data", ["simulated", "measured"])
def test_unstable_systems_are_refused_before_numbers_overflow(
    infoset: Command, data: str, states: int
) -> None:
    ones = [1.0] * states
    Path("big.toml").write_text(
        f'kind = "observer"\n[system]\nA = {[[1e15] * states] * states}\nC = {[ones]}\n'
        f"[initial]\nlower = {[0.5] * states}\nupper = {ones}\n[noise]\nhalf_width = [0.2]\n"
    )
    Path("data.csv").write_text("y1\n" + '""\n' * 30)
    err = infoset.refused(
        "observe", "big.toml", *(["--data", "data.csv"] if data == "measured" else [])
    )
    assert "a state is larger than 1e+40; the system is unstable" in err


WRONG = (
    *("--set", "wrong_measurements={number=1, size=[20.0, 50.0], steps=[25, 30]}"),
    *("--set", "noise.wrong_measurements=1"),
)
"""A wrong measurement after the tunnel of the vehicle, which has no measurements 14 to 22."""


def test_wrong_measurement_is_proved_and_its_class_suspected(infoset: Command) -> None:
    code, out, _ = infoset("observe", "vehicle", *WRONG, "--out", "o", "--html", "page.html")

    assert code == 0
    results = strict(Path("o/results.json").read_text())
    wrong = int(results["data"].rpartition(" ")[2])
    assert 25 <= wrong <= 30
    found = results["wrong_measurements"]
    assert found == {
        "assumed": 1,
        "classes": 4,
        "proved_k": wrong,
        "suspected_k": [*range((wrong - 9) % 4, 14, 4), *([wrong - 4] * (wrong >= 27)), wrong],
    }
    assert f"a wrong one is proved at step {wrong} ({wrong / 2:g} s); suspected: steps" in out
    assert "true state inside the set: 40 of 40 steps" in out
    assert results["inconsistency"] is None
    for step in results["steps"]:
        points = np.array([point for polygon in step["vertices"] for point in polygon])
        assert len(step["vertices"]) == 4
        np.testing.assert_allclose(points.min(axis=0), step["lower"], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(points.max(axis=0), step["upper"], rtol=0.0, atol=1e-9)
    page = Path("page.html").read_text(encoding="utf-8")
    assert f'"proved_at":{wrong}' in page
    assert "At most 1 wrong measurement assumed; a wrong one is proved" in page


def test_more_wrong_measurements_than_assumed_are_a_contradiction(infoset: Command) -> None:
    code, out, _ = infoset("observe", "vehicle", *WRONG, "--set", "wrong_measurements.number=4")

    assert code == 0
    assert "at most 1 wrong measurement assumed; more than 1 is wrong, or the model is" in out
    assert "the measurements contradict the model at step" in out


def test_simulation_without_the_table_is_the_same_but_for_wrong_measurements(
    infoset: Command,
) -> None:
    ordinary = infoset.json("observe", "vehicle")
    wrong = infoset.json("observe", "vehicle", *WRONG)
    assert [step["state"] for step in wrong["steps"]] == [
        step["state"] for step in ordinary["steps"]
    ]
    assert ordinary["wrong_measurements"] is None
    data = simulate(load_problem("vehicle"), Errors.EXTREMAL, 0)
    text = built_in_files()["vehicle"].text
    Path("mine.toml").write_text(
        f"{text}\n[wrong_measurements]\nnumber = 3\nsize = [4.0, 5.0]\nsteps = [10, 30]\n"
    )
    other = simulate(load_problem("mine.toml"), Errors.EXTREMAL, 0)
    assert data.states is not None
    changed_steps = np.flatnonzero((data.measured != other.measured).any(axis=1))
    is_wrong = [k for k in changed_steps.tolist() if not np.isnan(other.measured[k]).any()]
    assert len(is_wrong) == 3
    errors = np.abs(other.measured - data.states[:, :1])[is_wrong] / 3.0
    assert ((errors >= 4.0 - 1e-9) & (errors <= 5.0 + 1e-9)).all()
    assert all(10 <= k <= 30 and not 14 <= k <= 22 for k in is_wrong)


def test_exact_measurements_are_not_listed_as_wrong(infoset: Command) -> None:
    Path("exact.toml").write_text(
        FOUR_STATES.replace("[0.2, 0.2]", "[0.0, 0.0]") + "[wrong_measurements]\nnumber = 2\n"
    )

    data = simulate(load_problem("exact.toml"), Errors.EXTREMAL, 0)

    assert data.states is not None
    np.testing.assert_array_equal(data.measured, data.states[:, [0, 2]])
    assert data.origin.endswith("wrong measurements at no step")


def test_wrong_measurements_of_eight_states_have_bounds_and_a_page(infoset: Command) -> None:
    Path("eight.toml").write_text(
        EIGHT_STATES.replace(
            "half_width", "wrong_measurements = 1\nmeasurement_classes = 3\nhalf_width"
        )
        + "[wrong_measurements]\nnumber = 1\nsize = [10.0, 20.0]\nsteps = [6, 8]\n"
    )

    code, out, _ = infoset("observe", "eight.toml", "--html", "page.html")

    assert code == 0
    assert "true state inside its bounds: 13 of 13 steps" in out
    assert "at most 1 wrong measurement assumed; a wrong one is proved at step" in out


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("noise.wrong_measurements=4", "noise: wrong_measurements must be at most 3: got 4"),
        ("noise.measurement_classes=4", "noise: measurement_classes belongs to wrong_measurements"),
        (
            "wrong_measurements={number=1, steps=[5, 2]}",
            "wrong_measurements: steps must be [first, last]",
        ),
        ("wrong_measurements.number=-1", "wrong_measurements.number: must be at least 0"),
    ],
)
def test_senseless_wrong_measurements_are_refused(
    setting: str, told: str, infoset: Command
) -> None:
    assert told in infoset.refused("observe", "vehicle", "--set", setting)
