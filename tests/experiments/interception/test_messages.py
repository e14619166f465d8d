"""Messages about units, bodies and covariances that are probably not intended."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.experiments.common.built_in_files import built_in_files
from infoset.experiments.common.errors import InputError
from infoset.experiments.interception.scenario_file import all_warnings
from tests.built_in import scenario_text


@pytest.mark.parametrize("name", ["dart-2022", "haiv-2013"])
def test_speed_near_the_speed_of_light_is_refused_with_this_reason(name: str) -> None:
    with pytest.raises(
        InputError, match="closing_speed_km_s: is more than a hundredth of the speed of light"
    ) as caught:
        load_scenario(name, ["closing_speed_km_s=11500"])
    assert "impulse" not in str(caught.value)
    assert "found 11500" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "radius", "part"),
    [
        (
            "dart-2022",
            "radius_km=30",
            "all of them hit without impulses; check the unit of the radius",
        ),
        ("deep-impact-2005", "radius_km=30", "check"),
        # With so fast starts most of them miss even this body.
        (
            "asteroid-1997",
            "radius_km=21 dispersion.vz_m_s=[-900,900]",
            "no near-Earth asteroid and hardly a comet is so large; check its unit",
        ),
    ],
)
def test_huge_body_has_a_warning(name: str, radius: str, part: str) -> None:
    scenario = load_scenario(name, f"body.{radius}".split())
    lines = [line for line in all_warnings(scenario) if "body.radius_m is" in line]
    assert len(lines) == 1
    assert part in lines[0]


@pytest.mark.parametrize(
    "name", [file.name for file in built_in_files().values() if file.kind == "scenario"]
)
def test_body_of_a_built_in_scenario_has_no_warning(name: str) -> None:
    assert not [
        line for line in all_warnings(load_scenario(name)) if "check the unit of the radius" in line
    ]


@pytest.mark.parametrize("key", ["pixel_error_mas", "pixel_error_m", "pixel_error"])
def test_key_in_a_wrong_unit_is_refused_with_the_list_of_units(key: str, tmp_path: Path) -> None:
    units = "did you mean pixel_error_rad? It can end in rad, mrad, urad, deg, arcsec"
    file = tmp_path / "mine.toml"
    file.write_text(scenario_text("haiv-2013").replace("pixel_error_rad", key))
    with pytest.raises(InputError) as caught:
        load_scenario(file)
    assert str(caught.value) == f"{file}: camera.{key}: is not a known key; {units}"
    with pytest.raises(InputError, match=re.escape(units)):
        load_scenario("haiv-2013", [f"camera.{key}=3"])


def test_asymmetric_covariance_is_refused_with_this_reason(tmp_path: Path) -> None:
    rows = np.eye(6)
    rows[1, 5] = 0.5
    text = f"[covariance]\nmatrix_km2 = {rows.tolist()}\n\n[camera]"
    file = tmp_path / "mine.toml"
    file.write_text(scenario_text("haiv-2013").replace("[camera]", text))
    with pytest.raises(InputError, match=r"covariance.matrix_km2: must be symmetric: correct it"):
        load_scenario(file)
