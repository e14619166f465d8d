from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from infoset.rendezvous.pursuit_evasion import Policy
from infoset.rendezvous.pursuit_evasion._branch import follow
from tests.experiments.command_line import Command
from tests.experiments.pursuit.test_file import with_state

SMALL_MAP = ["--x", "phase_deg=-9:-6:4", "--y", "evader.thrust_N=10:20:2"]


def test_the_slides_case_as_json(infoset: Command) -> None:
    found = infoset.json("pursuit", "geo-pursuit")
    assert found["verdict"] == "captured"
    capture = found["capture"]
    certificate = found["certificate"]
    assert capture["time_s"] == pytest.approx(45343.620266, rel=1e-8)
    assert (certificate["saddle_point"], certificate["failures"]) == (True, [])
    assert {each["name"] for each in certificate["evader_deviations"]} == {
        each.value for each in Policy
    }


def test_a_capture_is_at_the_capture_radius(infoset: Command) -> None:
    capture = infoset.json("pursuit", "leo-pursuit")["capture"]
    apart = np.subtract(capture["evader"]["position_m"], capture["pursuer"]["position_m"])
    np.testing.assert_allclose(apart, 1000.0 * np.array(capture["direction"]), atol=1e-3)


@pytest.mark.parametrize(
    ("options", "undecided"),
    [
        (("--certify",), "47 of 120 directions were not decided (no farthest extremal"),
        ((), "the other directions at the capture were not compared (add --certify)"),
    ],
)
def test_certificate_lists_the_undecided_checks(
    options: tuple[str, ...], undecided: str, infoset: Command
) -> None:
    code, out, _ = infoset("pursuit", "geo-pursuit", *options)
    assert code == 0
    assert "all checks hold" not in out
    assert f"saddle point: no check failed; {undecided}" in out


@pytest.mark.parametrize(
    ("settings", "verdict", "said"),
    [
        pytest.param(
            ["gravity.parameter_km3_s2=1e14"],
            "branch-not-certified",
            "",
            marks=pytest.mark.thorough,
        ),
        (["pursuer.thrust_N=1e9"], "propellant-exhausted", ""),
        (["pursuer.mass_kg=1e-9", "pursuer.dry_mass_kg=0"], "branch-not-certified", ""),
        (["longest_s=1e-9"], "branch-not-certified", ""),
        (
            ["evader.thrust_N=20"],
            "escapes",
            "escapes: no capture until the pursuer has no propellant",
        ),
        (["evader.thrust_N=25"], "propellant-exhausted", "the evader has no propellant after"),
        (
            ["pursuer.dry_mass_kg=1900"],
            "propellant-exhausted",
            "the pursuer has no propellant after",
        ),
    ],
)
def test_verdicts_without_a_capture(
    settings: list[str], verdict: str, said: str, infoset: Command
) -> None:
    options = [part for setting in settings for part in ("--set", setting)]
    code, out, err = infoset("pursuit", *options, "--feedback", "coast", "--csv", "x.csv")
    assert code == 0
    assert verdict in out
    assert said in out
    assert "no feedback" in err
    assert len(Path("x.csv").read_text().splitlines()) == 1
    assert "there is no trajectory to show" in infoset.refused(
        "pursuit", *options, "--html", "page.html"
    )
    found = infoset.json("pursuit", *options)
    assert (found["verdict"], found["capture"], found["certificate"]) == (verdict, None, None)


def test_a_game_that_takes_too_long_to_follow_is_bounded(
    infoset: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "infoset.rendezvous.pursuit_evasion.solver.follow", partial(follow, max_work=10.0)
    )
    code, out, _ = infoset("pursuit")
    assert code == 0
    assert "branch-not-certified: the extremals are a saddle up to a duration of" in out


def test_feedback(infoset: Command) -> None:
    found = infoset.json("pursuit", "leo-pursuit", "--feedback", "coast")
    assert found["feedback"]["replan_s"] == pytest.approx(found["capture"]["time_s"] / 50.0)
    assert found["feedback"]["flights"][0]["time_s"] < found["capture"]["time_s"]
    noise = ("--position-noise-m", 10, "--replan-s", 5000, "--runs", 2, "--seed", 3)
    code, out, _ = infoset("pursuit", "--feedback", "random", *noise)
    assert code == 0
    assert "feedback, a plan every 5000 s, evader random: " in out
    assert "distance at the end, m: smallest" in out
    flights = infoset.json("pursuit", "--feedback", "random", *noise)["feedback"]["flights"]
    assert flights[0]["time_s"] != flights[1]["time_s"]
    noise = (*noise[:-3], 1, *noise[-2:])  # one run is the first of two
    assert (
        infoset.json("pursuit", "--feedback", "random", *noise)["feedback"]["flights"]
        == flights[:1]
    )


def test_a_map(infoset: Command) -> None:
    code, out, _ = infoset("pursuit-map", *SMALL_MAP, "--csv", "x.csv")
    assert code == 0
    assert "8 points: 4 captured, 4 escapes" in out
    found = infoset.json("pursuit-map", *SMALL_MAP)
    assert found["x"] == {"parameter": "phase_deg", "values": [-9.0, -8.0, -7.0, -6.0]}
    assert found["capture_time_s"][0][0] == pytest.approx(45343.620266, rel=1e-8)
    assert found["capture_time_s"][1] == [None] * 4
    assert found["verdict"] == [["captured"] * 4, ["escapes"] * 4]
    assert found["counts"] == {"captured": 4, "escapes": 4}
    lines = Path("x.csv").read_text().splitlines()
    assert lines[0] == "phase_deg,evader.thrust_N,capture_time_s,closing_speed_km_s,verdict"
    assert float(lines[1].split(",")[2]) == found["capture_time_s"][0][0]
    assert len(lines) == 9
    assert lines[-1].endswith(",,,escapes")


def test_points_of_a_map_without_a_game_have_a_verdict(infoset: Command) -> None:
    found = infoset.json(
        "pursuit-map", "--x", "phase_deg=-9:-8:2", "--y", "evader.mass_kg=900:2000:2"
    )
    assert found["verdict"] == [["no-game"] * 2, ["captured"] * 2]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["pursuit", "--runs", "5"], "need a policy of the evader"),
        (["pursuit-map", "--x", "phase=-1:1:3"], "did you mean phase_deg"),
        (["pursuit-map", "state.toml"], "phase_deg: both players must have the table orbit"),
        (["pursuit-map", "--x", "phase_deg=1:-1:3"], "KEY=FROM:TO:N"),
        (["pursuit-map", "--y", "phase_deg=-1:1:3"], "is also the parameter of --x"),
        (
            ["pursuit-map", "--x", "phase_deg=-1:1:2000", "--y", "thrust_ratio=0:1:2000"],
            "more than 100000 points",
        ),
    ],
)
def test_wrong_options_are_refused(arguments: list[str], told: str, infoset: Command) -> None:
    Path("state.toml").write_text(with_state())
    assert told in infoset.refused(*arguments)
