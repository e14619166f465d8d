"""The axes that the four problems of relative motion state, and the check of their orbits."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from experiments.common.hill_axes import AXES, from_paper, to_paper
from experiments.reachability.file import load_rendezvous
from tests.built_in import problem_text

Infoset = Callable[..., tuple[int, str, str]]

HILL = "x radially outward, y along the motion, z along the orbit's normal"


@pytest.mark.parametrize(
    ("arguments", "axes"),
    [
        (("reach", "rendezvous-2021", "--select", "energy"), AXES),
        (("multipoint", "service-2"), AXES),
        (("multipoint", "asteroid-tour"), "inertial, those of the problem file"),
        (("pareto", "pareto-2008"), AXES),
        (("pursuit", "leo-pursuit"), "inertial, z along the planet's axis"),
    ],
)
def test_output_and_pages_state_the_axes(
    infoset: Infoset, tmp_path: Path, arguments: tuple[str, ...], axes: str
) -> None:
    code, out, _ = infoset(*arguments, "--html", "page.html", "--json", "found.json")
    assert code == 0
    assert f"axes: {axes}" in out.splitlines()
    assert axes in json.dumps(json.loads((tmp_path / "found.json").read_text()))
    page = (tmp_path / "page.html").read_text()
    assert axes in page
    if "inertial" not in axes or arguments[0] == "pursuit":
        for title in ("x (radial)", "y (along-track)", "z (normal)"):
            assert title in page


@pytest.mark.parametrize("command", ["reach", "multipoint", "pareto", "pursuit"])
def test_help_states_the_axes(infoset: Infoset, command: str) -> None:
    code, out, _ = infoset(command, "--help")
    assert code == 0
    assert HILL in " ".join(out.split())


@pytest.mark.parametrize(
    "name", ["rendezvous-2021", "approach-cone", "rendezvous-16-periods", "pareto-2008", "service-2", "service-5"]
)
def test_built_in_files_state_the_axes(name: str) -> None:
    assert HILL in problem_text(name)


@pytest.mark.parametrize("name", ["geo-pursuit", "leo-pursuit"])
def test_built_in_pursuits_state_the_axes(name: str) -> None:
    assert "inertial axes, z along the planet's axis" in problem_text(name)


def test_the_papers_axes() -> None:
    # 7 m outward, 3 m ahead, 2 m along the normal; the papers have x against the motion, y outward.
    assert to_paper([7.0, 3.0, 2.0, 0.7, 0.3, 0.2]).tolist() == [-3.0, 7.0, 2.0, -0.3, 0.7, 0.2]
    assert from_paper([[-3.0, 7.0, 2.0], [3.0, 0.0, 0.0]]).tolist() == [[7.0, 3.0, 2.0], [0.0, -3.0, 0.0]]
    # The published initial state.
    printed = [2650.0, -2540.0, 2120.0, -3.0, 2.0, 3.0]
    assert to_paper(load_rendezvous("rendezvous-2021").problem.initial).tolist() == printed


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (("reach", "rendezvous-2021", "--set", "orbit.semi_major_axis_km={}"), "orbit: semi_major_axis_m"),
        (("multipoint", "service-2", "--set", "orbit_rate_rad_s={rate}"), "orbit_rate_rad_s"),
        (("pareto", "pareto-2008", "--set", "orbit_rate_rad_s={rate}"), "orbit_rate_rad_s"),
        (("pursuit", "leo-pursuit", "--set", "pursuer.orbit.semi_major_axis_km={}"), "pursuer.orbit"),
        (
            (
                *("multipoint", "asteroid-tour", "--set", "gravitational_parameter_km3_s2=398600.4418"),
                *("--set", "chaser.elements.semi_major_axis_km={}"),
            ),
            "chaser",
        ),
    ],
)
@pytest.mark.parametrize(
    ("axis_km", "said"), [(418.0, "the orbit meets the planet"), (6796000.0, "times as large as the planet")]
)
def test_an_orbit_inside_the_earth_or_in_metres_is_refused(
    infoset: Infoset, arguments: tuple[str, ...], key: str, axis_km: float, said: str
) -> None:
    rate = np.sqrt(3.986004418e14 / (1e3 * axis_km) ** 3)
    code, out, err = infoset(*(each.format(axis_km, rate=rate) for each in arguments))
    assert (code, out) == (2, "")
    assert any(key in line and said in line for line in err.splitlines())


@pytest.mark.parametrize("thrust", ["box", "ball"])
def test_reach_prints_delta_v(infoset: Infoset, thrust: str) -> None:
    settings = ("--set", f'thrust="{thrust}"', "--select", "energy", "--replan")
    code, out, err = infoset("reach", "rendezvous-2021", *settings, "--json", "-")
    assert code == 0
    found = json.loads(out)
    for result in (found["controls"][0], found["replan"]):
        control = 0.15 * np.array(result["u"])
        used = result["delta_v_m_s"]
        assert [used[axis] for axis in "xyz"] == pytest.approx((180.0 * np.abs(control).sum(axis=0)).tolist())
        engines = np.abs(control).sum() if thrust == "box" else np.sqrt((control**2).sum(axis=1)).sum()
        assert used["sum"] == pytest.approx(180.0 * float(engines))
    assert f"Delta-v is the sum over the {'three axes' if thrust == 'box' else 'periods'}" in err
    shown = found["controls"][0]["delta_v_m_s"]
    for axis in ("sum", *"xyz"):
        assert f" {shown[axis]:.4f}" in err
    assert f"Delta-v {found['replan']['delta_v_m_s']['sum']:.4f} m/s" in err
