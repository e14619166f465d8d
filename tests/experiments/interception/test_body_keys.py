"""An ellipse and an aim point in files, results, lines and figures."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments.interception.figures.b_plane import Cloud, draw_b_plane
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Body
from tests.experiments.command_line import Command

pytestmark = pytest.mark.usefixtures("unrendered")

QUICK = ("--set", "step_s=60", "--set", "camera.period_s=60")


@pytest.fixture
def own(infoset: Command, tmp_path: Path) -> Path:
    """The scenario haiv-2013 with an ellipse in an unknown direction."""
    file = tmp_path / "own.toml"
    assert infoset("scenarios", "new", file, "--like", "haiv-2013")[0] == 0
    text = file.read_text().replace("radius_m = 50.0", "semi_axes_m = [60.0, 38.0]")
    file.write_text(text)
    return file


def test_angle_of_a_file_is_in_degrees(own: Path) -> None:
    settings = ["body.axis_angle_deg=90", "body.aim_m=[3, -4]"]
    body = load_scenario(str(own), settings).body
    assert body is not None
    assert body.axis_angle_rad == pytest.approx(0.5 * np.pi)
    assert (body.semi_axes_m, body.aim_m) == ((60.0, 38.0), (3.0, -4.0))


def test_ellipse_has_its_lines_and_columns(infoset: Command, own: Path) -> None:
    code, out, _ = infoset("experiment", own, *QUICK, "--runs", 2, "--csv", "runs.csv")
    assert code == 0
    assert (
        "hit (inside the ellipse of 60 m x 38 m in a direction that is drawn in each run): " in out
    )
    assert "random: hit" in out
    assert "hit certain in flight (Phi at most 38 m): 2 of 2 runs" in out
    assert "mean probability of a hit for all directions of the ellipse: 100 %" in out
    header = Path("runs.csv").read_text().splitlines()[0].split(",")
    assert {"certain_hit", "hit_probability"} <= set(header)


def test_page_knows_whether_the_radius_is_that_of_a_sphere(infoset: Command, own: Path) -> None:
    for name, scenario, is_sphere in (("own", own, "false"), ("given", "haiv-2013", "true")):
        record = f"{name}.npz"
        page = f"{name}.html"
        assert infoset("engage", scenario, *QUICK, "--record", record)[0] == 0
        assert infoset("replay", record, "--html", page)[0] == 0
        assert re.findall(r'"is_sphere": ?(\w+)', Path(page).read_text()) == [is_sphere]


def test_aim_point_outside_is_refused_with_its_key(infoset: Command, own: Path) -> None:
    message = infoset.refused("experiment", own, "--set", "body.aim_m=[40, 0]")
    assert "body: aim_m must be inside the body for all its possible directions" in message


def test_messages_name_the_keys_of_the_file(infoset: Command) -> None:
    asked = ("scenarios", "check", "haiv-2013", "--set")
    assert ": body: set either radius_m (sphere) or semi_axes_m (ellipse): got both" in (
        infoset.refused(*asked, "body.semi_axes_m=[60, 38]")
    )
    assert ": body: axis_angle_deg is the direction of an ellipse" in (
        infoset.refused(*asked, "body.axis_angle_deg=10")
    )
    assert ": body: axis_angle_rad is the direction of an ellipse" in (
        infoset.refused(*asked, "body.axis_angle_rad=0.1")
    )


def test_bound_excludes_a_hit_only_outside_the_body(infoset: Command, own: Path) -> None:
    narrow = {
        "uncertainty.y_km": "[-0.1, 0.1]",
        "uncertainty.z_km": "[-0.1, 0.1]",
        "uncertainty.vy_km_s": "[-1e-6, 1e-6]",
        "uncertainty.vz_km_s": "[-1e-6, 1e-6]",
        "body.semi_axes_m": "[30, 20]",
    }
    settings = [part for key, value in narrow.items() for part in ("--set", f"{key}={value}")]

    asked = ("bound", own, *QUICK, *settings, "--budget", 0)
    at_centre = infoset.json(*asked)
    beside = infoset.json(*asked, "--set", "body.aim_m=[0, 10]")

    # The two motions of the pair are as far apart, wherever guidance aims. A miss of more than 20 m
    # can be outside an ellipse in an unknown direction, with the aim point one of more than 30 m.
    bound_m = at_centre["lower_bound_m"]
    assert beside["lower_bound_m"] == pytest.approx(bound_m)
    assert 20.0 < bound_m < 30.0
    assert at_centre["hit_cannot_be_guaranteed"]
    assert not beside["hit_cannot_be_guaranteed"]


@pytest.mark.parametrize(
    ("body", "t_rad", "aim_m"),
    [
        (Body(semi_axes_m=(30.0, 20.0), axis_angle_rad=0.0, aim_m=(4.0, 2.0)), None, (-4.0, -2.0)),
        # T is z: B = -(y, z) has T = -z and R = y.
        (
            Body(semi_axes_m=(30.0, 20.0), axis_angle_rad=0.0, aim_m=(4.0, 2.0)),
            0.5 * np.pi,
            (2.0, -4.0),
        ),
    ],
)
def test_plane_shows_ellipse_and_aim_point(
    body: Body, t_rad: float | None, aim_m: tuple[float, float]
) -> None:
    across_m = np.random.default_rng(1).normal(0.0, 10.0, size=(30, 2))
    cloud = Cloud("runs", across_m, np.hypot(*across_m.T), t_rad=t_rad, hits=30)
    (axes,) = draw_b_plane([cloud], body).axes

    marks = {line.get_label(): np.array(line.get_xydata()) for line in axes.lines}
    np.testing.assert_allclose(marks["aim point"], [aim_m], atol=1e-12)
    np.testing.assert_allclose(marks["centre of the body"], [(0.0, 0.0)])
    (outline,) = (patch for patch in axes.patches if "30 m x 20 m" in str(patch.get_label()))
    extent_m = np.asarray(outline.get_path().vertices).max(axis=0)
    wanted_m = (30.0, 20.0) if t_rad is None else (20.0, 30.0)
    np.testing.assert_allclose(extent_m, wanted_m, rtol=1e-3)
    assert axes.get_title("left").endswith("hits: 30 of 30 runs")


def test_plane_shows_both_axes_of_an_unknown_direction() -> None:
    across_m = np.random.default_rng(1).normal(0.0, 10.0, size=(30, 2))
    cloud = Cloud("runs", across_m, np.hypot(*across_m.T), hits=30)
    (axes,) = draw_b_plane([cloud], Body(semi_axes_m=(30.0, 20.0))).axes
    _, labels = axes.get_legend_handles_labels()
    assert "body, longer semi-axis, 30 m" in labels
    assert "body, shorter semi-axis, 20 m" in labels
