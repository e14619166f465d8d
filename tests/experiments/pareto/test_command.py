from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from experiments.pareto.figures import draw_controls, draw_costs, draw_front, draw_trajectories
from experiments.pareto.file import load_pareto
from rendezvous.pareto import analyse_coalitions, solve_encounter, sweep_meeting_time, total_impulse
from sim.storage.codec import fingerprint
from sim.versions import versions
from tests.built_in import problem_text
from tests.experiments.command_line import strict

FIGURES = ["figure-controls", "figure-costs", "figure-front", "figure-trajectories"]
KEYS = [
    *("versions", "problem", "problem_hash", "units", "meeting_time_s", "meet", "free", "meeting", "craft"),
    *(
        "group_loss_m2_s3",
        "matrix",
        "distances",
        "selections",
        "coalitions",
        "shapley_m2_s3",
        "transfers_m2_s3",
        "core",
        "sweep",
    ),
    "samples",
]
STATE = ["x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"]
EXAMPLE = problem_text("pareto-2008")
HEAD, *CRAFT = EXAMPLE.split("[[craft]]")
CRAFT_TABLE = "[[craft]]" + CRAFT[1]

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def infoset(infoset: Infoset) -> Infoset:
    """Run the command in an empty folder: exit code, stdout and stderr."""
    return partial(infoset, "pareto")


def changed(old: str, new: str, text: str = EXAMPLE) -> str:
    """The example with its first `old` replaced."""
    assert old in text
    return text.replace(old, new, 1)


def test_the_published_example_into_a_folder(infoset: Infoset, tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "notes.txt").write_text("mine")
    code, out, _ = infoset("--out", "results", "--prefer", "x_m=0,z_m=50", "--samples", 4, "--overwrite")
    assert code == 0
    assert (tmp_path / "results" / "notes.txt").read_text() == "mine"
    files = [f"{name}.{kind}" for name in FIGURES for kind in ("pdf", "png")]
    assert sorted(each.name for each in (tmp_path / "results").iterdir()) == sorted(
        [*files, "notes.txt", "problem.toml", "results.json", "trajectories.csv"]
    )
    found = strict((tmp_path / "results" / "results.json").read_text())
    assert list(found) == KEYS
    assert (found["versions"], found["problem"], found["meet"]) == (versions(), "pareto-2008", "rendezvous")
    assert found["problem_hash"] == fingerprint(load_pareto("pareto-2008"))
    # Numbers of the acceptance, w = 0.001176, at nine digits.
    assert list(found["meeting"]) == STATE
    meeting = [-40.25672153628559, 0.0, 36.755682761552535, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(list(found["meeting"].values()), meeting, rtol=1e-9)
    assert [each["name"] for each in found["craft"]] == ["first", "second", "third"]
    for key, expected in (
        ("ideal_cost_squared_m2_s3", [0.7901642781355673, 8.534913129850537, 5.9364085496591095]),
        ("cost_squared_m2_s3", [2.3220013947895253, 13.953153416863753, 17.573235512747196]),
    ):
        np.testing.assert_allclose([each[key] for each in found["craft"]], expected, rtol=1e-9)
    assert found["craft"][0]["ideal"]["z_m"] == pytest.approx(80.55360965382751, rel=1e-9)
    excess = [each["cost_squared_m2_s3"] - each["ideal_cost_squared_m2_s3"] for each in found["craft"]]
    np.testing.assert_allclose([each["excess_m2_s3"] for each in found["craft"]], excess, rtol=1e-12)
    assert found["group_loss_m2_s3"] == pytest.approx(18.58690436675526, rel=1e-9)
    assert found["group_loss_m2_s3"] == pytest.approx(
        sum(each["weight"] * each["excess_m2_s3"] for each in found["craft"])
    )
    assert found["coalitions"]["first+third"]["excess_m2_s3"] == pytest.approx(10.45954394, rel=1e-9)
    assert found["coalitions"]["first+second+third"]["regret_m2_s3"] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(found["shapley_m2_s3"], [2.697786535, 5.612588912, 10.27652892], rtol=1e-9)
    assert sum(found["transfers_m2_s3"]) == pytest.approx(0.0, abs=1e-12)
    assert found["core"]["verdict"] == "empty"
    assert "the core is empty: each craft alone has zero excess" in found["core"]["reason"]
    assert set(found["selections"]) == {"min_group_loss", "min_sum_of_costs", "minimax_excess", "preferred"}
    assert len(found["sweep"]["group_loss_m2_s3"]) == len(found["sweep"]["meeting_time_s"])
    assert [each["name"] for each in found["samples"]] == ["first", "second", "third"]
    for each in found["samples"]:
        assert each["time_s"] == [0.0, 10.0, 20.0, 30.0]
        np.testing.assert_allclose(each["position_m"][-1], meeting[:3], atol=1e-9)
        assert np.shape(each["control_m_s2"]) == (4, 3)
    for piece in (
        "group loss 18.5869",
        "Shapley value",
        "the core is empty",
        "the cost of the common meeting, which is positive",
        "preferred",
    ):
        assert piece in out


def test_json_alone_and_nothing_written(infoset: Infoset, tmp_path: Path) -> None:
    code, out, err = infoset("--json", "-")
    assert code == 0
    assert strict(out)["problem"] == "pareto-2008"
    assert "group loss" in err
    assert infoset("-q") == (0, "", "")
    assert infoset("--json", "-", "-q")[2] == ""
    assert list(tmp_path.iterdir()) == []


def test_help_has_an_example(infoset: Infoset) -> None:
    code, out, _ = infoset("--help")
    assert code == 0
    assert "Example: infoset pareto" in out


def test_keys_that_may_be_left_out(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    lines = [
        line
        for line in EXAMPLE.splitlines()
        if line.split("=")[0].strip() not in ("name", "description", "weight", "y_m", "vx_m_s")
    ]
    text = "\n".join(lines)
    for name in ("first", "second", "third"):
        text = changed("[[craft]]\nposition_m", f'[[craft]]\nname = "{name}"\nposition_m', text)
    found = strict(infoset(mine(text), "--json", "-", "-q")[1])
    given = strict(infoset("--json", "-", "-q")[1])
    assert found["meeting"] == given["meeting"]
    assert found["problem"] == "encounter"
    assert [each["weight"] for each in found["craft"]] == [1.0, 1.0, 1.0]
    assert found["problem_hash"] == given["problem_hash"]


def test_an_intercept_and_craft_that_start_later(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    text = changed('free = ["x", "z"] ', 'free = ["x", "y", "z"]\nmeet = "intercept"\n#')
    file = mine(changed("weight = 1.0", "weight = 2.0\nstart_s = 5.0", text.replace("y_m = 0.0\n", "", 1)))
    code, out, _ = infoset(file, "--json", "-", "-q")
    assert code == 0
    found = strict(out)
    assert list(found["meeting"]) == STATE[:3]  # each arrives with a velocity of its own
    assert all(each["ideal_cost_squared_m2_s3"] < 1e-20 for each in found["craft"])
    assert "distances" not in found  # durations differ, and so do the matrices
    assert len(found["matrix"]) == 3
    assert found["samples"][0]["time_s"][0] == 5.0
    ends = np.array([each["position_m"][-1] for each in found["samples"]])
    np.testing.assert_allclose(ends, np.tile(ends[0], (3, 1)), atol=1e-8)


def test_a_bound_that_another_control_meets(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    file = mine(changed("duration_s", "max_control_m_s2 = 1.4\nduration_s"))
    code, out, _ = infoset(file, "--json", "found.json")
    assert code == 0
    found = strict(Path("found.json").read_text())["craft"]
    assert [each["feasibility"] for each in found] == ["within", "within", "another-control"]
    third = found[2]
    assert third["min_peak_control_m_s2"] < 1.4 < third["peak_control_m_s2"]
    assert f"exceeds the bound 1.4 m/s^2 by {third['peak_control_m_s2'] / 1.4 - 1.0:.2%}" in out


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["pareto-2007"], ["pareto-2007", "did you mean"]),
        (["service-3"], ["service-3: this is a problem of kind multipoint; use infoset multipoint service-3"]),
        (["missing.toml"], ["missing.toml: there is no such file"]),
        (["x" * 5000], ["no file and no built-in problem"]),
        (["bad\x1b[31mname"], ["bad?[31mname"]),
        (["--samples", "1"], ["--samples: must be from 2 to 10001, found 1;"]),
        (["--samples", "1" + "0" * 40], ["--samples: must be from 2 to 10001, found 1000"]),
        (["--prefer", "x_m=0"], ["--prefer: z_m is missing", "for example --prefer x_m=0,z_m=0"]),
        (["--prefer", "x_m=0,z_m=1,y_m=2"], ["--prefer: give each of x_m, z_m once", '"y_m=2"']),
        (["--prefer", "x_m=0,x_m=1"], ["--prefer: give each of", '"x_m=1"']),
        (["--prefer", "x_m=0,z_m=far"], ["--prefer", '"far" is not a number']),
        (["--prefer", "x_m=0,z_m=nan"], ["--prefer: values must be finite"]),
        (["--prefer", "x_m=0,z_m=1e300"], ["--prefer: values must be finite and at most 1e+60 in size"]),
        (["--json", "missing/x.json"], ["there is no folder missing"]),
        (["--json", "out/results.json", "--out", "out"], ["also a file of --out"]),
        (["--out", "/dev/null"], ["is a file"]),
    ],
)
def test_what_is_wrong_is_said_before_the_work(
    arguments: list[str], parts: list[str], infoset: Infoset, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("experiments.pareto.run.solve_encounter", lambda *_, **__: pytest.fail("began to work"))
    code, out, err = infoset(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("error: ") == 1
    assert "\x1b" not in err
    for part in parts:
        assert part in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (changed("duration_s = 30.0", "duration_s = 1e9"), "duration_s is 1.18e+06 radians of the orbit"),
        (changed("= 0.001176", "= 1.176"), "orbit_rate_rad_s: the orbit meets the planet"),
        (changed('free = ["x", "z"]', "free = []"), "no component of the terminal state is free"),
        (changed('free = ["x", "z"]', 'free = ["x", "x"]'), "a free component is named twice"),
        (changed('free = ["x", "z"]', 'free = ["altitude"]'), "free: number 1 must be 'x', 'y', 'z', 'vx'"),
        (changed("y_m = 0.0", "x_m = 5.0"), "terminal.x_m: must be left out, because free lists x"),
        (changed('free = ["x", "z"]', 'free = ["vy"]\nmeet = "intercept"'), "free only x, y and z"),
        (EXAMPLE.replace("weight = 1.0", "").replace("velocity_m_s", "weight = 0\nvelocity_m_s"), "weights are zero"),
        (changed("weight = 1.0", "start_s = 30.0"), "craft 'first': it must start before the meeting at 30.0 s"),
        (changed('name = "second"', 'name = "first"'), "two craft are called 'first'"),
        (changed("[60.0, 0.0, 80.0]", "[60.0, 0.0]"), "position_m: number 3 is missing, found [60.0, 0.0]"),
        (HEAD + "craft = []", "terminal.craft: is not a known key"),
        (HEAD, "craft: is missing"),
    ],
)  # fmt: skip
def test_unsound_files_are_told(
    text: str, told: str, infoset: Infoset, mine: Callable[[str], Path], tmp_path: Path
) -> None:
    code, out, err = infoset(mine(text), "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert err.count("error: ") == 1
    assert told in err
    assert [each.name for each in tmp_path.iterdir()] == ["mine.toml"]


def test_a_bound_that_no_control_meets_says_by_how_much(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    code, out, err = infoset(mine(changed("duration_s", "max_control_m_s2 = 0.5\nduration_s")))
    assert (code, out) == (2, "")
    assert "no control of at most 0.5 m/s^2 brings the craft third to the meeting" in err
    minimum = float(err.split("at least ")[1].split(" m/s^2")[0])
    assert f"{minimum / 0.5:.4g} times the bound" in err
    # Just over what is said, it can be met.
    given = changed("duration_s", f"max_control_m_s2 = {minimum * 1.00001}\nduration_s")
    assert infoset(mine(given), "-q")[0] == 0


LONG = """
kind = "pareto-encounter"
orbit_rate_rad_s = 0.0011
duration_s = 818181.8
free = ["x"]
max_control_m_s2 = 1.05e-5
[[craft]]
name = "a"
position_m = [1042.875, -544.668, -206.956]
velocity_m_s = [0.348, 0.814, 0.248]
[[craft]]
name = "b"
position_m = [-1284.581, -1098.813, -661.613]
velocity_m_s = [-1.734, 0.838, 0.126]
"""


def test_a_meeting_after_many_revolutions_is_not_refused(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    # 9.980e-6 m/s^2 suffices (test_choices.py); a fixed rule of quadrature said 1.14e-5.
    code, out, err = infoset(mine(LONG))
    assert (code, err) == (0, "")
    assert "another control satisfies the bound" in out
    assert infoset(mine(LONG.replace("1.05e-5", "9.97e-6")), "-q")[0] == 2


LATE = """
kind = "pareto-encounter"
orbit_rate_rad_s = 6.53e-05
duration_s = 28.9
free = ["x"]
meet = "intercept"
[terminal]
y_m = -66.4
z_m = 87.7
[[craft]]
name = "c0"
position_m = [-32.06, -67.6, -3.53]
velocity_m_s = [0.00448, 0.1554, -0.00445]
[[craft]]
name = "c1"
position_m = [-6724.3, 5328.8, 3198.4]
velocity_m_s = [0.0145, -0.0593, -0.0749]
weight = 0.0
start_s = 0.1
[[craft]]
name = "c2"
position_m = [-5.078, 21.6, -53.25]
velocity_m_s = [0.0015925, 0.1168, -0.0245]
weight = 4.85
start_s = 15.28
"""


@pytest.mark.parametrize(("wanted", "nearest"), [(500.0, max), (-1e5, min)])
def test_a_preferred_meeting_of_craft_that_start_late(
    wanted: float, nearest: Callable[[list[float]], float], infoset: Infoset, mine: Callable[[str], Path]
) -> None:
    # With one free component the Pareto set is all between the minimum and the maximum ideal.
    code, out, err = infoset(mine(LATE), "--prefer", f"x_m={wanted}", "--json", "-", "-q")
    assert (code, err) == (0, "")
    found = strict(out)
    ideals = [each["ideal"]["x_m"] for each in found["craft"]]
    assert found["selections"]["preferred"]["meeting"]["x_m"] == pytest.approx(nearest(ideals), rel=1e-9)


def test_numbers_of_extreme_size_end_in_a_message(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    for position in ("1e15", "1e-100"):
        code, _, err = infoset(mine(EXAMPLE.replace("60.0", position)), "-q")
        assert code in (0, 2)
        assert code == 0 or err.startswith("error: ")


@pytest.mark.parametrize(
    ("number", "told"),
    [(500, "craft: Tuple should have at most 50 items"), (10_000, "more than any problem file")],
)
def test_too_many_craft_are_refused_at_once(
    infoset: Infoset, mine: Callable[[str], Path], number: int, told: str
) -> None:
    short = '[[craft]]\nname = "{}"\nposition_m = [0, 0, 0]\nvelocity_m_s = [0, 0, 0]\n'
    began = time.process_time()
    code, _, err = infoset(mine(HEAD + "".join(short.format(each) for each in range(number))))
    assert code == 2
    assert told in err
    assert time.process_time() - began < 10.0


def test_many_craft_have_no_list_of_coalitions(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    tables = "".join(
        changed('"second"', f'"craft {each}"', CRAFT_TABLE).replace("40.0", f"{each}.0") for each in range(13)
    )
    code, out, _ = infoset(mine(HEAD + tables), "--json", "found.json", "--samples", 2)
    assert code == 0
    assert "the coalitions are not computed" in out
    found = strict(Path("found.json").read_text())
    assert (found["coalitions"], found["shapley_m2_s3"], found["core"]) == ({}, [], None)


def test_nothing_is_replaced_unless_told(infoset: Infoset, tmp_path: Path) -> None:
    precious, folder = tmp_path / "x.json", tmp_path / "folder"
    precious.write_text("precious")
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    for option, target in (("--json", precious), ("--out", folder)):
        code, _, err = infoset(option, target)
        assert code == 2
        assert "--overwrite" in err
    assert precious.read_text() == "precious"
    assert [each.name for each in folder.iterdir()] == ["notes.txt"]
    assert infoset("--json", precious, "--overwrite", "-q")[0] == 0
    assert strict(precious.read_text())["problem"] == "pareto-2008"


def test_figures_say_what_they_show() -> None:
    solution = solve_encounter(load_pareto("pareto-2008").encounter)
    space, *planes = draw_trajectories(solution).axes[::-1]
    assert [each.get_xlabel() for each in planes] == ["x (radial), m", "y (along-track), m", "y (along-track), m"]
    assert [each.get_ylabel() for each in planes] == ["z (normal), m", "z (normal), m", "x (radial), m"]
    assert space.get_xlabel() == "x (radial), m"
    controls = draw_controls(solution, 1.0).axes
    assert [each.get_ylabel() for each in controls][2:] == ["$u_z$ (normal), m/s$^2$", "$|u|$, m/s$^2$"]
    sweep = sweep_meeting_time(solution.encounter, [20.0, 30.0, 40.0])
    front = draw_front(solution, {"min_group_loss": solution.point}, sweep).axes
    assert front[0].get_xlabel() == "x of the meeting, m"
    (hull,) = front[0].patches
    corners = np.asarray(hull.get_path().vertices)[:-1]
    assert {tuple(each) for each in corners} == {tuple(each) for each in solution.ideals}
    impulses = [total_impulse(solution.plan(index)) for index in range(3)]
    bars = draw_costs(solution, analyse_coalitions(solution), impulses).axes[0]
    heights = [each.get_height() for each in bars.patches]  # type: ignore[attr-defined]
    np.testing.assert_allclose(heights[3:], solution.excess())
