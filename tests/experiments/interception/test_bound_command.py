from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset import Model, StateBox
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import to_toml
from infoset.experiments.interception.command import Bound
from infoset.experiments.interception.figures.bound import draw_bound
from infoset.experiments.interception.runs import bound
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import strategy_names
from infoset.sim import Body, Scenario
from infoset.sim.bound.lower_bound import LowerBound, lower_bound, pair_at
from infoset.sim.scenario import of_model
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions
from tests.experiments.command_line import Command
from tests.sensors import linear
from tests.space import in_space

FILES = ["figure-bound.pdf", "figure-bound.png", "results.json", "scenario.toml"]
KEYS = [
    *(
        "versions",
        "scenario",
        "scenario_hash",
        "model",
        "range_sensor",
        "elapsed_s",
        "disturbance_m_s2",
    ),
    *("wrong_images", "lower_bound_m", "lower_bound_without_wrong_images_m"),
    *("reached_at", "at_nominal_range", "by_label", "strategies", "value"),
]
IS_VALUE = "the bound is the value of the game up to a reserve of "


@pytest.fixture(scope="module")
def short() -> Scenario:
    """Half a minute of the published approach, from a range that is known to a step."""
    published = load_scenario("asteroid-1997")
    box = StateBox((-1e3, 1e3), (1740e3, 1750e3), (-100.0, 100.0), (-58e3, -57.5e3))
    model = replace(published.set_model, bounds=box)
    nominal = replace(
        model, angle_sensor=replace(linear(model.angle_sensor), nominal_range_m=1745e3)
    )
    return replace(
        published, name="short", **of_model(nominal), dispersion=box, nominal_range_m=1745e3
    )


@pytest.fixture(scope="module")
def planar(short: Scenario) -> LowerBound:
    """The bound of the short scenario."""
    return lower_bound(short)


@pytest.fixture
def known(planar: LowerBound, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command gets the bound of the short scenario without computing it again."""
    monkeypatch.setattr(
        "infoset.experiments.interception.runs.bound.lower_bound", lambda *_, **__: planar
    )


@pytest.fixture
def short_file(short: Scenario, tmp_path: Path, infoset: Command) -> Path:
    file = tmp_path / "short.toml"
    file.write_text(to_toml(short))
    return file


@pytest.mark.usefixtures("unrendered")
def test_bound_into_a_folder(
    infoset: Command, short: Scenario, planar: LowerBound, short_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "results"
    code, out, err = infoset(
        "bound", short_file, "--out", folder, "--model", "guaranteed", "--budget", 3
    )
    assert (code, err) == (
        0,
        f"wrote scenario.toml, results.json, figure-bound.pdf, figure-bound.png in {folder}\n",
    )
    assert sorted(each.name for each in folder.iterdir()) == FILES
    found = json.loads((folder / "results.json").read_text())
    assert list(found) == KEYS
    flown = load_scenario(folder / "scenario.toml")
    assert found["versions"] == versions()
    assert (found["scenario"], found["model"]) == ("short", "guaranteed")
    assert found["scenario_hash"] == fingerprint(flown)
    expected = planar
    assert found["wrong_images"] == 0
    assert found["lower_bound_m"] == expected.bound_m
    assert found["lower_bound_without_wrong_images_m"] == expected.bound_m
    assert found["reached_at"]["wrong_images_before_arrival_s"] == [[], []]
    assert [each["bound_m"] for each in found["by_label"]] == [
        each.bound_m for each in expected.by_label
    ]
    assert max(each["bound_m"] for each in found["by_label"]) == found["lower_bound_m"]
    assert {each["closing_speed_m_s"] for each in found["by_label"]} == {57.5e3, 58e3}
    assert all(1740e3 <= each["label_m"] <= 1750e3 for each in found["by_label"])
    assert found["reached_at"]["label_m"] == expected.pair.label_m
    nominal = found["at_nominal_range"]
    assert (nominal["label_m"], nominal["closing_speed_m_s"]) == (1745e3, 58e3)
    assert nominal["bound_m"] == pair_at(short, 1745e3, -58e3).bound_m <= expected.bound_m
    assert [each["name"] for each in found["strategies"]] == strategy_names()
    for each in found["strategies"]:
        assert each["worst_found_m"] >= found["lower_bound_m"] * (1.0 - 1e-4)
        assert each["worst_over_bound"] == pytest.approx(
            each["worst_found_m"] / found["lower_bound_m"]
        )
        assert each["guaranteed_m"] is not None
        assert each["guaranteed_m"] >= each["worst_found_m"]
        pairs = max(miss for flight in each["flights"] for miss in flight["miss_m"])
        assert each["worst_of_pairs_m"] == pairs
        assert each["worst_found_set_kept_m"] == each["worst_found_m"]
        assert each["worst_over_bound"] == each["worst_found_set_kept_m"] / found["lower_bound_m"]
        assert each["worst_of_search_set_kept_m"] == each["worst_of_search_m"]
        assert each["worst_found_m"] == max(pairs, each["worst_of_search_m"])
        assert all(all(flight["truth_kept"]) for flight in each["flights"])
    best = min(found["strategies"], key=lambda each: each["worst_found_m"])
    assert found["value"] == {
        "at_least_m": found["lower_bound_m"],
        "at_most_m": None,
        "reserve_m": None,
        "not_proved_because": [
            "gravity",
            "range not exactly known",
            "closing speed not exactly known",
        ],
        "best_strategy": best["name"],
        "best_strategy_worst_found_m": best["worst_found_m"],
    }
    assert IS_VALUE not in out


def test_bound_with_wrong_images_names_them_and_the_bound_without(
    infoset: Command, short: Scenario, planar: LowerBound, tmp_path: Path
) -> None:
    settings = replace(short.information_set, model=Model.GUARANTEED, wrong_images=1)
    file = tmp_path / "wrong.toml"
    file.write_text(to_toml(replace(short, information_set=settings)))

    code, out, _ = infoset(
        "bound", file, "--budget", 0, "--strategies", "symmetric-miss", "--json", "bound.json"
    )

    assert code == 0
    found = json.loads(Path("bound.json").read_text())
    assert found["wrong_images"] == 1
    assert found["lower_bound_without_wrong_images_m"] == planar.bound_m
    bound_m = found["lower_bound_m"]
    heading, *_ = out.splitlines()
    assert heading.endswith(
        f"below {bound_m:.3g} m for all starts in [uncertainty] with 1 wrong image in a flight "
        f"({planar.bound_m:.3g} m without wrong images)"
    )
    ((last_s,), (before_s,)) = found["reached_at"]["wrong_images_before_arrival_s"]
    assert last_s == found["reached_at"]["alike_until_before_arrival_s"]
    assert before_s == pytest.approx(last_s + short.bearing_sensor.period_s)
    assert (
        f"wrong images of the first pair, s before arrival: {last_s:.2f} in one motion, "
        f"{before_s:.2f} in the other\n"
    ) in out
    (strategy,) = found["strategies"]
    for flight in strategy["flights"]:
        assert max(flight["miss_m"]) >= flight["bound_m"]
        assert flight["truth_kept"] == [True, True]


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize(
    ("share", "words"), [(0.99, "cannot be guaranteed by any strategy"), (1.01, "does not exclude")]
)
def test_the_bound_alone_names_the_body(
    share: float, words: str, infoset: Command, short_file: Path, planar: LowerBound
) -> None:
    radius = ("--set", f"body.radius_m={share * planar.bound_m}")
    code, out, _ = infoset("bound", short_file, "--budget", 0, *radius, "--json", "bound.json")
    assert code == 0
    (line,) = [line for line in out.splitlines() if words in line]
    assert f"the body of radius {share * planar.bound_m:g} m" in line
    assert "symmetric-miss" not in out
    found = json.loads(Path("bound.json").read_text())
    assert (found["strategies"], found["hit_cannot_be_guaranteed"]) == ([], share < 1.0)


@pytest.mark.parametrize(
    ("angle_rad", "bound_m", "line"),
    [
        (
            0.0,
            30.0,
            "this does not exclude a strategy that guarantees a hit of the body: a miss of at most "
            "36 m hits",
        ),
        (
            0.0,
            40.0,
            "no statement about a hit: a miss of 40 m can hit the body, which extends up to 60 m "
            "from the aim point",
        ),
        (
            0.0,
            70.0,
            "a hit of the body cannot be guaranteed by any strategy: it extends at most 60 m from "
            "the aim point",
        ),
        (
            None,
            40.0,
            "a hit of the body cannot be guaranteed by any strategy: a miss of more than 36 m does "
            "not hit in all directions of the ellipse",
        ),
    ],
)
def test_bound_says_what_it_means_for_an_ellipse(
    angle_rad: float | None, bound_m: float, line: str
) -> None:
    body = Body(semi_axes_m=(60.0, 36.0), axis_angle_rad=angle_rad)
    assert bound._body_line(body, bound_m) == line


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize(
    ("range_m", "words"),
    [
        (1745e3, "at the range 1745.0 km and closing speed 58 km/s, the nominal ones: "),
        (
            1760e3,
            "at the range 1750.0 km and closing speed 58 km/s, the nearest to the nominal ones in "
            "[uncertainty]: ",
        ),
    ],
)
def test_bound_says_whether_its_nominal_range_is_that_of_the_scenario(
    range_m: float, words: str, infoset: Command, short_file: Path
) -> None:
    nominal = ("--set", f"nominal_range_m={range_m}")
    _, out, _ = infoset("bound", short_file, "--budget", 0, *nominal)
    assert words in out


def test_note_on_one_motion_says_that_impulses_do_not_bring_it_to_the_target(
    short: Scenario, planar: LowerBound
) -> None:
    """The impulses bring the motion nearer, but not near enough: Theorem 6."""
    single = replace(planar, pairs=(replace(planar.pair, is_single=True),))
    (line,) = bound._notes(short, single, Bound(), [])
    assert line == (
        "one motion: a start that all impulses together do not bring to the target, whatever is "
        "measured"
    )


NARROWER = "the simulated runs start in [dispersion], which is narrower"


@pytest.mark.usefixtures("known")
def test_bound_is_for_all_starts_and_says_that_runs_start_nearer(
    infoset: Command, short_file: Path
) -> None:
    asked = ("bound", short_file, "--budget", 0)
    _, out, _ = infoset(*asked)
    assert "m for all starts in [uncertainty]\n" in out
    assert NARROWER not in out

    _, out, _ = infoset(*asked, "--set", "dispersion.z_m=[-100, 1000]")
    assert f"{NARROWER}: their misses can be smaller\n" in out


def test_bound_names_the_errors_of_the_attitude() -> None:
    aligned = load_scenario("haiv-2013")
    assert [*bound._attitude_lines(aligned)] == []

    settings = ["camera.misalignment_urad=7", "camera.drift_urad=2"]
    misaligned, drifting = bound._attitude_lines(load_scenario("haiv-2013", settings))
    assert misaligned.startswith("the misalignment of the camera is left out")
    assert drifting.startswith("the drift of the camera is an error like that of the pixel")


@pytest.mark.usefixtures("known")
def test_row_of_each_strategy_is_printed_when_its_search_ends(
    infoset: Command, short_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulate = bound._simulate

    def stop_at_the_second(*arguments: Any) -> bound.WorstOfStrategy:
        if arguments[2] == "least-effort":
            raise InputError("stopped")
        return simulate(*arguments)

    monkeypatch.setattr(bound, "_simulate", stop_at_the_second)

    code, out, err = infoset(
        "bound", short_file, "--strategies", "symmetric-miss,least-effort", "--budget", 1
    )

    assert (code, "error: stopped" in err) == (2, True)
    *_, heading, row = out.splitlines()
    assert heading.split() == ["strategy", *"mmm", "m"]
    assert row.split()[0] == "symmetric-miss"
    assert len(heading) == len(row)
    assert "no strategy can guarantee a miss below" in out


def test_value_where_range_and_speed_are_known(
    infoset: Command, short: Scenario, tmp_path: Path
) -> None:
    box = replace(short.set_model.bounds, x_m=(1745e3, 1745e3), vx_m_s=(-58e3, -58e3))
    free = replace(
        short, sun=None, dispersion=box, **of_model(replace(short.set_model, bounds=box))
    )
    file = tmp_path / "free.toml"
    file.write_text(to_toml(free))
    options = (
        "bound",
        file,
        "--strategies",
        "least-effort,symmetric-miss",
        "--json",
        tmp_path / "found.json",
        "--overwrite",
    )
    code, out, _ = infoset(*options, "--budget", 100)
    assert code == 0
    found = json.loads((tmp_path / "found.json").read_text())
    value = found["value"]
    symmetric = found["strategies"][1]
    parts = value["reserve_m"]
    total = parts.pop("total")
    assert list(parts) == ["lower_bound", "tangent", "dead_zone", "range_threshold"]
    assert total == pytest.approx(sum(parts.values()))
    assert (value["at_least_m"], value["not_proved_because"]) == (found["lower_bound_m"], [])
    assert value["at_most_m"] == pytest.approx(found["lower_bound_m"] + total)
    assert (
        found["lower_bound_m"]
        <= symmetric["worst_found_m"]
        <= value["at_most_m"]
        < 1.1 * found["lower_bound_m"]
    )
    assert (
        f"{IS_VALUE}{total:.3g} m: no strategy guarantees less than {found['lower_bound_m']:.3g} m"
        in out
    )
    code, out, _ = infoset(*options, "--budget", 0, "--set", "thruster.budget_m_s=100")
    assert code == 0
    value = json.loads((tmp_path / "found.json").read_text())["value"]
    (reason,) = value["not_proved_because"]
    assert reason.startswith("budget below the ")
    assert [
        value[key]
        for key in ("at_most_m", "reserve_m", "best_strategy", "best_strategy_worst_found_m")
    ] == [None] * 4
    assert f"no upper end is proved, because of: {reason}\n" in out
    assert IS_VALUE not in out


@pytest.mark.thorough
@pytest.mark.usefixtures("unrendered")
def test_bound_in_space(
    infoset: Command, short: Scenario, planar: LowerBound, tmp_path: Path
) -> None:
    spatial = in_space(short)
    file = tmp_path / "space.toml"
    file.write_text(to_toml(spatial))
    options = (
        "--strategies",
        "symmetric-miss",
        "--budget",
        1,
        "--model",
        "guaranteed",
        "--out",
        tmp_path / "results",
    )
    assert infoset("bound", file, *options)[0] == 0
    found = json.loads((tmp_path / "results" / "results.json").read_text())
    expected = lower_bound(spatial)
    assert found["disturbance_m_s2"] == {"y": 0.005, "z": 0.005}
    assert found["lower_bound_m"] == expected.bound_m
    assert 1.5 * planar.bound_m < expected.bound_m < 2.0 * planar.bound_m
    assert found["at_nominal_range"]["bound_m"] == pair_at(spatial, 1745e3, -58e3).bound_m
    apart = [found["reached_at"][f"apart_{axis}_m"] for axis in ("y", "z")]
    assert np.hypot(*apart) == pytest.approx(expected.pair.apart_m)
    assert 0.0 not in apart
    for flight in found["strategies"][0]["flights"]:
        assert np.hypot(flight["miss_y_m"], flight["miss_z_m"]) == pytest.approx(
            flight["miss_m"], rel=1e-3
        )
        assert max(flight["miss_m"]) >= flight["bound_m"] * (1.0 - 1e-4)
        assert all(flight["truth_kept"])
    (strategy,) = found["strategies"]
    assert strategy["worst_found_m"] == max(
        strategy["worst_of_pairs_m"], strategy["worst_of_search_m"]
    )
    assert strategy["worst_found_m"] <= strategy["guaranteed_m"]
    (_, right) = draw_bound(spatial, expected).axes
    assert right.get_ylabel() == "offset from the midpoint, m"
    half = right.get_lines()[2].get_ydata()[-1]  # type: ignore[index]
    assert half == pytest.approx(0.5 * expected.pair.apart_m)
