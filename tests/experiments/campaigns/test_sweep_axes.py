from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from infoset.experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
from infoset.experiments.common.errors import InputError
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Scenario
from infoset.sim.scenario import of_model
from infoset.sim.storage import Axis
from tests.sensors import linear


@pytest.fixture(scope="module")
def asteroid() -> Scenario:
    return load_scenario("asteroid-1997")


def test_two_axes_are_read_in_the_order_written(asteroid: Scenario) -> None:
    text = "angle_sensor.error_at_nominal_range_rad=0.5e-4:5e-4:8,thruster.max_impulse_m_s=2:20:7"
    first, second = axes = sweep_axes(text, asteroid)
    assert (first.key, second.key) == (
        "angle_sensor.error_at_nominal_range_rad",
        "thruster.max_impulse_m_s",
    )
    assert (first.values[0], first.values[-1], len(first.values)) == (5e-5, 5e-4, 8)
    assert second.values == (2.0, 5.0, 8.0, 11.0, 14.0, 17.0, 20.0)
    cells = sweep_cells(asteroid, axes)
    found = [
        (linear(cell.angle_sensor).error_at_nominal_range_rad, cell.thruster.max_impulse_m_s)
        for cell in cells
    ]
    assert found == list(itertools.product(first.values, second.values))
    back = {
        replace(
            cell,
            thruster=asteroid.thruster,
            **of_model(replace(cell.set_model, angle_sensor=asteroid.set_model.angle_sensor)),
        )
        for cell in cells
    }
    assert back == {asteroid}  # nothing else has changed


def test_varied_values_have_the_units_of_the_file(asteroid: Scenario) -> None:
    axes = sweep_axes("information_set.range_threshold_km=3:7:3,sun.direction_deg=0:90:2", asteroid)
    cells = sweep_cells(asteroid, axes)
    assert [each.set_model.range_threshold_m for each in cells[::2]] == [3e3, 5e3, 7e3]
    assert cells[0].sun is not None
    assert cells[0].sun.direction_rad == 0.0
    assert cells[1] == replace(asteroid, **of_model(cells[1].set_model))


def test_ends_of_pairs_and_fixed_starts(asteroid: Scenario) -> None:
    cells = sweep_cells(asteroid, sweep_axes("uncertainty.vx_km_s.min=-60:-58:2", asteroid))
    assert [each.set_model.bounds.vx_m_s for each in cells] == [(-60e3, -57e3), (-58e3, -57e3)]
    cells = sweep_cells(asteroid, sweep_axes("dispersion.z_km.max=2:3:2", asteroid))
    assert [each.dispersion.z_m for each in cells] == [(-1e3, 2e3), (-1e3, 3e3)]
    cells = sweep_cells(asteroid, sweep_axes("dispersion.z_km=0:2:2", asteroid))
    assert [each.dispersion.z_m for each in cells] == [(0.0, 0.0), (2e3, 2e3)]
    fixed = cells[1]
    cells = sweep_cells(fixed, sweep_axes("dispersion.z_km.min=-2:0:2", fixed))
    assert [each.dispersion.z_m for each in cells] == [(-2e3, 2e3), (0.0, 2e3)]


def test_whole_numbers_and_logarithms(asteroid: Scenario) -> None:
    (axis,) = sweep_axes("information_set.sections=log:9:101:4", asteroid)
    assert (axis.values, axis.scale) == ((9.0, 20.0, 45.0, 101.0), "log")
    assert [each.set_model.sections for each in sweep_cells(asteroid, (axis,))] == [9, 20, 45, 101]
    (axis,) = sweep_axes("thruster.budget_m_s=log:1:10000:5", asteroid)
    assert axis.values == pytest.approx((1.0, 10.0, 100.0, 1000.0, 10000.0), rel=1e-11)


@given(
    ends=st.tuples(st.integers(1, 10**6), st.integers(1, 10**6)),
    count=st.integers(2, 40),
    log=st.booleans(),
)
@settings(deadline=None, max_examples=60)
def test_values_rise_evenly_between_the_ends_as_written(
    ends: tuple[int, int], count: int, log: bool
) -> None:
    asteroid = load_scenario("asteroid-1997")
    minimum = min(ends)
    maximum = max(ends) + 1
    (axis,) = sweep_axes(
        f"thruster.budget_m_s={'log:' if log else ''}{minimum}e-2:{maximum}e-2:{count}", asteroid
    )
    assert axis.values[0] == float(f"{minimum}e-2")
    assert axis.values[-1] == float(f"{maximum}e-2")
    assert len(axis.values) == count
    assert list(axis.values) == sorted(set(axis.values))
    spaced = np.geomspace if log else np.linspace
    np.testing.assert_allclose(
        axis.values, spaced(minimum / 100.0, maximum / 100.0, count), rtol=1e-11
    )


def test_keys_with_the_same_values(asteroid: Scenario) -> None:
    tied = (
        "angle_sensor.error_at_zero_range_rad=angle_sensor.error_at_nominal_range_rad="
        "log:1e-4:4e-4:3"
    )
    (axis,) = sweep_axes(tied, asteroid)
    assert axis == Axis(tied.rpartition("=")[0], (1e-4, 2e-4, 4e-4), "log")
    for cell, value in zip(sweep_cells(asteroid, (axis,)), axis.values, strict=True):
        sensor = linear(cell.angle_sensor)
        assert (sensor.error_at_zero_range_rad, sensor.error_at_nominal_range_rad) == (value, value)


def test_a_factor_of_all_error_bounds_of_a_sensor(asteroid: Scenario) -> None:
    axes = sweep_axes("angle_sensor.scale=0.5:2:2,range_sensor.scale=1:3:2", asteroid)
    assert axes[0] == Axis("angle_sensor.scale", (0.5, 2.0))
    cells = sweep_cells(asteroid, axes)
    bounds = [
        (
            linear(cell.angle_sensor).error_at_nominal_range_rad,
            linear(cell.angle_sensor).error_at_zero_range_rad,
            cell.range_sensor.relative_error if cell.range_sensor else None,
        )
        for cell in cells
    ]
    assert bounds == [
        *((7.5e-5, 1.15e-4, 0.05), (7.5e-5, 1.15e-4, 0.15)),
        *((3e-4, 4.6e-4, 0.05), (3e-4, 4.6e-4, 0.15)),
    ]
    (same,) = sweep_cells(asteroid, (Axis("angle_sensor.scale=range_sensor.scale", (1.0, 1.0)),))[
        :1
    ]
    assert same == asteroid


FORM = "is not written as KEY=FROM:TO:COUNT"
RISING = "must go from a smaller to a greater value, with a count from 2 to 1000"


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (
            "thruster.budget_m_s=nominal_range_km=1:2:2",
            "found thruster.budget_m_s in m/s, nominal_range_km in km",
        ),
        (
            "angle_sensor.scale=1:2:2,angle_sensor.error_at_zero_range_rad=1e-4:2e-4:2",
            "angle_sensor.scale and angle_sensor.error_at_zero_range_rad vary the same value",
        ),
        ("thruster.budget_m_s=thruster.budget_m_s=1:2:2", "vary the same value"),
        (
            "thruster.budget_m_s=1:2:2,thruster.budget_km_s=1:2:2",
            "thruster.budget_m_s and thruster.budget_km_s vary the same value",
        ),
        (
            "uncertainty.z_m=1:2:2,uncertainty.z_m.min=1:2:2",
            "uncertainty.z_m and uncertainty.z_m.min vary the same value",
        ),
        (
            "uncertainty.z_km.max=1:2:2,uncertainty.z_m=1:2:2",
            "uncertainty.z_km.max and uncertainty.z_m vary the same value",
        ),
        ("thruster.budget_m_s=log:0:1:3", "must be greater than 0"),
        ("thruster.budget=1:2:2", "did you mean thruster.budget_m_s?"),
        *((text, FORM) for text in ("", "thruster.budget_m_s")),
        *(
            (f"thruster.budget_m_s={text}", FORM)
            for text in ("1:2", "1:2:3:4", "lin:1:2:3", "inf:1:3", "1_0:20:2")
        ),
        ("thruster.budget_m_s=" + "9" * 5000 + ":2:2", FORM),
        *(
            (f"thruster.budget_m_s={text}", RISING)
            for text in ("2:1:3", "1:1:3", "1:2:1", "1:2:1001")
        ),
        ("thruster.budget_m_s=1:1e99:3", "at most 1e+60"),
        ("information_set.sections=9:10:5", "are not all different"),
        (
            "thruster.budget_m_s=1:2:1000,nominal_range_km=5800:5801:1000",
            "1000000 cells are more than the limit",
        ),
        (
            "thruster.max_impulse_m_s=0.1:5:3",
            "asteroid-1997 with thruster.max_impulse_m_s = 0.1: thruster: ",
        ),
    ],
)
def test_wrong_axis_is_refused(text: str, part: str, asteroid: Scenario) -> None:
    with pytest.raises(InputError) as refused:
        sweep_cells(asteroid, sweep_axes(text, asteroid))
    assert part in str(refused.value)
    assert len(str(refused.value)) < 3000
