from __future__ import annotations

import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from matplotlib.contour import ContourSet

from experiments.pursuit.figures import draw_control, draw_distance, draw_feedback, draw_orbits, draw_relative
from experiments.pursuit.file import load_pursuit
from experiments.pursuit.map_figure import axis_name, draw_map
from rendezvous.pursuit_evasion import STATUSES, CaptureMap, PointStatus, Policy, Solution, fly, history, solve
from rendezvous.pursuit_evasion._branch import follow
from sim.storage.codec import fingerprint
from sim.versions import versions

FIGURES = ["figure-control", "figure-distance", "figure-feedback", "figure-orbits", "figure-relative"]
MAP_FILES = ["figure-map.pdf", "figure-map.png", "map.csv", "problem.toml", "results.json"]
SMALL_MAP = ["--x", "phase_deg=-9:-6:4", "--y", "evader.thrust_N=10:20:2"]

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def geo() -> Solution:
    return solve(load_pursuit("geo-pursuit").game)


def test_the_slides_case_as_json(infoset: Infoset, tmp_path: Path) -> None:
    code, out, _ = infoset("pursuit", "geo-pursuit", "--json", "-")
    assert code == 0
    found = json.loads(out)
    assert list(tmp_path.iterdir()) == []
    assert found["versions"] == versions()
    assert found["problem"] == "geo-pursuit"
    assert found["problem_hash"] == fingerprint(load_pursuit("geo-pursuit"))
    assert found["verdict"] == "captured"
    assert found["capture_time_s"] == pytest.approx(45343.620266, rel=1e-8)
    assert found["capture_position_km"] == pytest.approx([-39420.497090, -19052.538637, 604.130676], abs=1e-6)
    assert found["direction"] == pytest.approx([0.250766441, 0.966273907, 0.058574134], abs=1e-9)
    assert found["pursuer"]["propellant_kg"] == pytest.approx(264.21499851, abs=1e-8)
    assert found["evader"]["propellant_kg"] == pytest.approx(132.10749926, abs=1e-8)
    assert found["pursuer"]["final_velocity_km_s"] == pytest.approx([1.612976850, -2.237162348, -0.068126510], abs=1e-9)
    assert found["evader"]["final_velocity_km_s"] == pytest.approx([1.436953246, -2.493381998, -0.023752323], abs=1e-9)
    assert found["pursuer"]["costate0"][0] == pytest.approx(24.257983895970675, rel=1e-8)
    assert found["evader"]["costate0"][0] == pytest.approx(-36.84357583098579, rel=1e-8)
    assert found["closing_speed_km_s"] == pytest.approx(0.2891199953, abs=1e-10)
    assert found["curvature"] == pytest.approx([0.05030, 0.69579], abs=5e-6)
    certificate = found["certificate"]
    assert certificate["saddle_point"] is True
    assert certificate["failures"] == []
    assert {each["policy"] for each in certificate["evader_deviations"]} == {each.value for each in Policy}


@pytest.mark.parametrize(
    ("options", "undecided", "why"),
    [
        (
            ("--certify",),
            "47 of 120 directions were not decided",
            "no farthest extremal was found for one craft or both",
        ),
        ((), "the other directions at the capture were not compared", "add --certify"),
    ],
)
def test_a_certificate_says_what_it_leaves_open(
    options: tuple[str, ...], undecided: str, why: str, infoset: Infoset
) -> None:
    code, out, _ = infoset("pursuit", "geo-pursuit", *options, "--json", "x.json")
    assert code == 0
    assert "all checks hold" not in out
    assert f"saddle point: no check failed; {undecided} ({why})" in out
    certificate = json.loads(Path("x.json").read_text())["certificate"]
    assert certificate["undecided"] == [undecided]
    assert (certificate["saddle_point"], certificate["failures"]) == (True, [])


def test_the_json_has_what_it_is_asked_for(infoset: Infoset) -> None:
    _, out, _ = infoset("pursuit", "leo-pursuit", "--json", "-")
    found = json.loads(out)
    asked = ["verdict", "capture_time_s", "capture_position_km", "direction", "pursuer", "evader"]
    asked += ["closing_speed_km_s", "curvature", "certificate"]
    assert [key for key in found if key in asked] == asked
    for name in ("pursuer", "evader"):
        assert {"propellant_kg", "final_velocity_km_s", "costate0"} <= set(found[name])
        assert len(found[name]["costate0"]) == 6
    assert found["curvature"] == sorted(found["curvature"])
    # At a distance of the capture radius, along the direction.
    apart = np.subtract(found["evader"]["final_position_km"], found["pursuer"]["final_position_km"])
    np.testing.assert_allclose(apart, found["direction"], atol=1e-6)


@pytest.mark.parametrize(
    ("settings", "verdict"),
    [
        pytest.param(["gravity.parameter_km3_s2=1e14"], "branch-not-certified", marks=pytest.mark.thorough),
        (["pursuer.thrust_N=1e9"], "propellant-exhausted"),
        (["pursuer.mass_kg=1e-9", "pursuer.dry_mass_kg=0"], "branch-not-certified"),
        (["longest_s=1e-9"], "branch-not-certified"),
        (["capture_radius_km=6600"], "captured"),
    ],
)
def test_absurd_values_have_an_answer(settings: list[str], verdict: str, infoset: Infoset) -> None:
    options = [part for setting in settings for part in ("--set", setting)]
    began = time.process_time()
    code, out, _ = infoset("pursuit", *options, "--json", "-")
    assert code == 0
    assert json.loads(out)["verdict"] == verdict
    assert time.process_time() - began < 20.0


def test_a_game_that_takes_too_long_to_follow_is_bounded(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rendezvous.pursuit_evasion.solver.follow", partial(follow, max_work=10.0))
    code, out, _ = infoset("pursuit")
    assert code == 0
    assert "branch-not-certified: the extremals are a saddle up to a duration of" in out


def test_an_error_of_the_solver_has_a_remedy(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.pursuit.run.solve", Mock(side_effect=ValueError("the game has no end")))
    code, _, err = infoset("pursuit")
    assert (code, err) == (2, "error: geo-pursuit: the game has no end; correct the problem\n")


def test_time_between_plans_suits_the_game(infoset: Infoset) -> None:
    code, out, _ = infoset("pursuit", "leo-pursuit", "--feedback", "coast", "--json", "-")
    assert code == 0
    found = json.loads(out)
    assert found["feedback"]["replan_s"] == pytest.approx(found["capture_time_s"] / 50.0)
    assert found["feedback"]["flights"][0]["time_s"] < found["capture_time_s"]
    code, _, err = infoset("pursuit", "--feedback", "coast", "--replan-s", "1")
    assert code == 2
    assert "more than 2000 plans" in err


@pytest.mark.thorough
def test_a_folder_has_the_problem_the_results_and_the_figures(infoset: Infoset, tmp_path: Path) -> None:
    code, out, _ = infoset("pursuit", "leo-pursuit", "--feedback", "coast", "--replan-s", "60", "--out", "found")
    assert code == 0
    assert "captured at" in out
    assert "saddle point: no check failed; the other directions" in out
    assert "feedback, a plan every 60 s, evader coast: captured" in out
    files = sorted(each.name for each in (tmp_path / "found").iterdir())
    figures = [f"{name}.{kind}" for name in FIGURES for kind in ("pdf", "png")]
    assert files == sorted(["problem.toml", "results.json", "trajectories.csv", *figures])
    again, _, _ = infoset("pursuit", "found/problem.toml", "--json", "again.json", "-q")
    assert again == 0
    one, other = (json.loads((tmp_path / each).read_text()) for each in ("again.json", "found/results.json"))
    assert one["problem_hash"] == other["problem_hash"]
    assert one["capture_time_s"] == other["capture_time_s"]
    assert other["feedback"]["flights"][0]["ended"] == "captured"


@pytest.mark.parametrize(
    ("settings", "verdict", "said"),
    [
        (["evader.thrust_N=20"], "escapes", "escapes: no capture until the pursuer has no propellant"),
        (["evader.thrust_N=25"], "propellant-exhausted", "the evader has no propellant after"),
        (["pursuer.dry_mass_kg=1900"], "propellant-exhausted", "the pursuer has no propellant after"),
    ],
)
def test_verdicts_without_a_capture(
    settings: list[str], verdict: str, said: str, infoset: Infoset, tmp_path: Path
) -> None:
    options = [part for setting in settings for part in ("--set", setting)]
    code, out, err = infoset("pursuit", *options, "--feedback", "coast", "--json", "x.json")
    assert code == 0
    assert said in out
    assert "no feedback" in err
    found = json.loads((tmp_path / "x.json").read_text())
    assert found["verdict"] == verdict
    assert found["capture_time_s"] is None
    assert found["pursuer"] is None
    assert found["certificate"] is None
    assert "feedback" not in found


def test_what_is_not_captured_has_its_distance_drawn(infoset: Infoset, tmp_path: Path) -> None:
    assert infoset("pursuit", "--set", "evader.thrust_N=20", "--out", "found", "-q")[0] == 0
    files = sorted(each.name for each in (tmp_path / "found").iterdir())
    assert files == ["figure-distance.pdf", "figure-distance.png", "problem.toml", "results.json"]


def test_quiet_prints_nothing(infoset: Infoset) -> None:
    assert infoset("pursuit", "leo-pursuit", "-q")[:2] == (0, "")


def test_a_scripted_evader(infoset: Infoset, tmp_path: Path) -> None:
    (tmp_path / "script.csv").write_text("time_s,policy\n0,coast\n20000,outward\n")
    code, out, _ = infoset("pursuit", "--feedback", "script.csv", "--json", "-")
    assert code == 0
    (flight,) = json.loads(out)["feedback"]["flights"]
    assert 34e3 < flight["time_s"] < 45343.0


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["nowhere"], ["no built-in problem", "geo-pursuit"]),
        (["--set", "evader.thrust_N"], ["--set", "KEY=VALUE"]),
        (["--set", "evader.thrust=1"], ["did you mean evader.thrust_N"]),
        (["--set", "evader.orbit.eccentricity=1.5"], ["evader.orbit: an ellipse has"]),
        (["--feedback", "costa"], ["--feedback", "did you mean coast"]),
        (["--feedback", "gone.csv"], ["gone.csv cannot be read"]),
        (["--feedback", "coast", "--replan-s", "0"], ["--replan-s: must be at least 1, found 0;"]),
        (["--feedback", "coast", "--delay-s", "nan"], ["--delay-s: must be a finite number, found nan;"]),
        (["--feedback", "coast", "--delay-s", "inf"], ["--delay-s: must be a finite number"]),
        (["--runs", "5"], ["--feedback"]),
        (["--replan-s", "60"], ["--feedback"]),
        (["--runs", "0"], ["--runs: must be from 1 to 10000, found 0;"]),
        (["--json", "missing/x.json"], ["there is no folder missing"]),
        (["--out", "/dev/null"], ["is a file"]),
    ],
)
def test_what_is_wrong_is_said_before_the_work(
    arguments: list[str], parts: list[str], infoset: Infoset, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("experiments.pursuit.run.solve", lambda *_, **__: pytest.fail("began to work"))
    code, out, err = infoset("pursuit", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("error: ") == 1
    for part in parts:
        assert part in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("0,costa\n", "did you mean coast"),
        ("soon,coast\n", "is not a time"),
        ("0,coast\nnan,prograde\n", "is not a time"),
        pytest.param("0" * 99_000 + ",coast\n0,coast", "must increase from 0", id="long"),
        pytest.param("0" * 200_000 + ",coast\n", "is over 100 kB", id="longer"),
        ("0,coast,1\n", "found 3 values"),
        ("5,coast\n", "must increase from 0"),
        ("", "at least one policy"),
    ],
)
def test_a_script_that_is_wrong(text: str, part: str, infoset: Infoset, tmp_path: Path) -> None:
    (tmp_path / "script.csv").write_text(text)
    code, _, err = infoset("pursuit", "--feedback", "script.csv")
    assert code == 2
    assert part in err


def test_nothing_is_replaced_unless_told(infoset: Infoset, tmp_path: Path) -> None:
    precious = tmp_path / "x.json"
    precious.write_text("precious")
    assert infoset("pursuit", "leo-pursuit", "--json", precious)[0] == 2
    assert precious.read_text() == "precious"
    assert infoset("pursuit", "leo-pursuit", "--json", precious, "--overwrite", "-q")[0] == 0
    assert json.loads(precious.read_text())["problem"] == "leo-pursuit"


def test_a_map(infoset: Infoset, tmp_path: Path) -> None:
    code, out, _ = infoset("pursuit-map", *SMALL_MAP, "--out", "map", "--json", "x.json")
    assert code == 0
    assert "8 points" in out
    assert "4 escape" in out
    assert sorted(each.name for each in (tmp_path / "map").iterdir()) == MAP_FILES
    found = json.loads((tmp_path / "x.json").read_text())
    assert found["x"] == {"parameter": "phase_deg", "values": [-9.0, -8.0, -7.0, -6.0]}
    assert found["capture_time_s"][0][0] == pytest.approx(45343.620266, rel=1e-7)
    assert found["capture_time_s"][1] == [None] * 4
    assert found["status"][1] == ["escapes"] * 4
    assert found["counts"]["escapes"] == 4
    lines = (tmp_path / "map" / "map.csv").read_text().splitlines()
    assert lines[0] == "phase_deg,evader.thrust_N,capture_time_s,capture_time_h,closing_speed_km_s,status"
    seconds, hours = (float(value) for value in lines[1].split(",")[2:4])
    assert hours == pytest.approx(seconds / 3600.0)
    assert len(lines) == 9
    assert lines[-1].endswith(",,,,escapes")
    assert found["status_words"]["followed"] == "solved from scratch"
    assert '"followed" is solved from scratch' in out


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--x", "phase=-1:1:3"], ["--x", "did you mean phase_deg"]),
        (["--x", "phase_deg=-1:1"], ["KEY=FROM:TO:N"]),
        (["--x", "phase_deg=1:-1:3"], ["to a larger one"]),
        (["--x", "phase_deg=nan:1:3"], ["from a number"]),
        (["--x", "phase_deg=-1:1:1"], ["from 2 to"]),
        (["--y", "phase_deg=-1:1:3"], ["is also the parameter of --x"]),
        (["--x", "phase_deg=-1:1:2000", "--y", "thrust_ratio=0:1:2000"], ["4000000 points"]),
    ],
)
def test_a_map_that_is_wrong(arguments: list[str], parts: list[str], infoset: Infoset) -> None:
    code, out, err = infoset("pursuit-map", *arguments)
    assert (code, out) == (2, "")
    for part in parts:
        assert part in err


def test_figures(geo: Solution) -> None:
    sampled = history(geo)
    space: Any = draw_orbits(sampled).axes[0]
    assert space.get_zlabel() == "z (inertial), Mm"
    plane, *_ = draw_relative(sampled).axes
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("y (along-track), Mm", "x (radial), Mm")
    x, y = plane.get_lines()[0].get_xydata().T  # type: ignore[union-attr]
    assert abs(x[-1]) < 1e-6
    assert abs(y[-1]) < 1e-6
    *_, switching = draw_control(sampled).axes
    for line in switching.get_lines():
        assert np.all(np.asarray(line.get_ydata())[:-1] > 0.0)
    left, right = draw_distance(geo).axes
    assert left.get_lines()[0].get_ydata()[-1] == pytest.approx(0.0, abs=1e-9)  # type: ignore[index]
    assert "T" in right.get_xlabel()
    flight = fly(geo.game, Policy.COAST.direction, solution=geo)
    assert [axes.get_title() for axes in draw_feedback(geo, [flight]).axes][1].startswith("(b) captured at")
    assert [axes.get_title() for axes in draw_feedback(geo, [flight, flight]).axes][1] == "(b) 2 of 2 captured"


def test_columns_of_a_map_suit_the_thrust(infoset: Infoset) -> None:
    for name, half in (("geo-pursuit", 30.0), ("leo-pursuit", 3.0)):
        code, out, _ = infoset("pursuit-map", name, "--y", "evader.thrust_N=0:1:2", "--json", "-")
        assert code == 0
        found = json.loads(out)["x"]
        assert found["parameter"] == "phase_deg"
        assert (found["values"][0], found["values"][-1]) == (-half, half)


def test_a_map_says_below_it_what_the_terminal_said() -> None:
    times = np.ma.masked_array(np.arange(20.0).reshape(4, 5) * 3600.0, mask=np.zeros((4, 5), dtype=bool))
    times[1, 2] = np.ma.masked
    status = np.where(times.mask, STATUSES.index(PointStatus.NOT_CERTIFIED), STATUSES.index(PointStatus.FOLLOWED))
    found = CaptureMap(np.arange(5.0), np.arange(4.0), times, status, times, 19)
    figure = draw_map(found, "phase_deg", "thrust_ratio")
    assert [each.get_text() for each in figure.texts] == ["20 points: 19 solved from scratch, 1 not certified"]
    axes = figure.axes[0]
    assert axes.get_title() == "capture time, h"
    # No ratio below zero.
    assert (axes.get_xlim(), axes.get_ylim()) == ((0.0, 4.0), (0.0, 3.0))
    # No line ends beside the point that has no time: its four cells are empty.
    (lines,) = (each for each in axes.collections if isinstance(each, ContourSet))
    ends = np.concatenate([each.vertices for each in lines.get_paths()])
    assert len(ends)
    assert not ((np.abs(ends[:, 0] - 2.0) < 0.999) & (np.abs(ends[:, 1] - 1.0) < 0.999)).any()


def test_axes_of_a_map_have_words_and_units() -> None:
    assert axis_name("evader.orbit.inclination_deg") == "evader orbit: inclination, deg"
    assert axis_name("phase_deg") == "lead of the evader, deg"
    assert axis_name("thrust_ratio") == "thrust of the evader / thrust of the pursuer"
    assert axis_name("evader.thrust_N") == "evader: thrust, N"


def test_help_has_an_example(infoset: Infoset) -> None:
    for command in ("pursuit", "pursuit-map"):
        code, out, _ = infoset(command, "--help")
        assert code == 0
        assert "Example" in out
