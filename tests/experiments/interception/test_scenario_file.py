from __future__ import annotations

import dataclasses
import math
import re

import pytest

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import read_text, to_toml
from infoset.experiments.common.units import si_factor
from infoset.experiments.interception.scenario_file import (
    feasibility_warnings,
    load_scenario,
    scenario_warnings,
    with_model,
)
from infoset.guidance import NoiseKind, TieRule
from infoset.guidance.thruster import Thruster
from infoset.model import Model, SetModel, SetSettings, StateBox
from infoset.sensors import AngleSensor, Camera, RangeSensor, RateSensor
from infoset.sim.body import Body
from infoset.sim.covariance import Covariance
from infoset.sim.scenario import Scenario, Sun, Target, of_model
from infoset.sim.storage.codec import fingerprint
from tests.built_in import scenario_names, scenario_text

PAPER = scenario_text("asteroid-1997")


def changed(*settings: str, text: str = PAPER) -> Scenario:
    """The paper's scenario with other values."""
    return read_text(Scenario, text, "mine.toml", settings)


def test_paper_scenario_in_si_units() -> None:
    assert load_scenario("asteroid-1997") == Scenario(
        name="asteroid-1997",
        description=load_scenario("asteroid-1997").description,
        sun=Sun(
            gravitational_parameter_m3_s2=1.324948e20, distance_m=150.0e9, direction_rad=math.pi / 2
        ),
        nominal_range_m=5801300.0,
        dispersion=StateBox(
            (-1000.0, 1000.0), (5701300.0, 5901300.0), (-100.0, 100.0), (-58100.0, -57900.0)
        ),
        **of_model(
            SetModel(
                closing_speed_m_s=58000.0,
                step_s=0.5,
                bounds=StateBox(
                    (-10000.0, 10000.0),
                    (5301300.0, 6301300.0),
                    (-100.0, 100.0),
                    (-59000.0, -57000.0),
                ),
                angle_sensor=AngleSensor(0.5, 0.00015, 0.00023, 5801300.0),
                disturbance_m_s2=0.005,
                range_threshold_m=5000.0,
                sections=29,
                fewest_sections=5,
                model=Model.PAPER,
            )
        ),
        range_sensor=RangeSensor(period_s=2.0, relative_error=0.05),
        thruster=Thruster(1000.0, 0.25, 7.5),
        strategy="symmetric-miss",
        noise=NoiseKind.RANDOM,
        tie=TieRule.UPPER,
    )


def test_single_scenario_is_the_paper_s_from_one_start() -> None:
    paper = load_scenario("asteroid-1997")
    single = load_scenario("asteroid-1997-single")
    assert single.range_sensor is None
    start = StateBox((-8000.0, -8000.0), (5801300.0, 5801300.0), (0.0, 0.0), (-58000.0, -58000.0))
    assert single.dispersion == start
    assert (
        dataclasses.replace(
            single,
            name=paper.name,
            description=paper.description,
            range_sensor=paper.range_sensor,
            dispersion=paper.dispersion,
        )
        == paper
    )


@pytest.mark.parametrize("name", scenario_names())
def test_built_in_is_sound_described_and_silent(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.description
    assert scenario_text(name).isascii()
    assert scenario_warnings(scenario) == []
    assert read_text(Scenario, to_toml(scenario), name) == scenario


def test_own_scenario_is_the_scenario_of_the_paper_in_the_guaranteed_model() -> None:
    own = load_scenario("own-scenario")
    paper = load_scenario("asteroid-1997")
    assert own.set_model == with_model(paper, Model.GUARANTEED).set_model
    assert dataclasses.replace(
        own, name="", description="", information_set=paper.information_set
    ) == (dataclasses.replace(paper, name="", description="", strategy="least-effort"))


def test_own_scenario_writes_every_key() -> None:
    text = scenario_text("own-scenario")
    keys = re.findall(r"^(?:# )?(\w+) = ", text, re.M)
    sensors = AngleSensor, Camera, RangeSensor, RateSensor
    for owner in (
        Scenario,
        Sun,
        StateBox,
        Covariance,
        *sensors,
        Target,
        Body,
        Thruster,
        SetSettings,
    ):
        for field in dataclasses.fields(owner):
            assert f"[{field.name}]" in text or any(si_factor(key, field.name) for key in keys), (
                field.name
            )


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        (
            ["range_sensor.period_s=0.7"],
            "range_sensor.period_s must be a whole number of steps of 0.5 s: got 0.7 s",
        ),
        (
            ["information_set.range_threshold_km=5500"],
            "range_threshold_m must be less than the minimum range of bounds",
        ),
        (
            ["angle_sensor.error_at_nominal_range_rad=1e-6"],
            "its error bound must be positive up to the maximum",
        ),
        (
            ["sun.distance_km=6000"],
            "sun.distance_m must be greater than the maximum possible range",
        ),
        (
            ["thruster.impulses_s=[200]"],
            "thruster.impulses_s: the first impulse can be given 100.022 s before",
        ),
        (["thruster.last_impulse_s=101"], "thruster.last_impulse_s excludes all impulses"),
        (["camera.pixel_error_rad=1e-5", "camera.period_s=0.5"], "or the table camera: got both"),
        (
            ["uncertainty.y_km=[-1, 1]"],
            "y_m and vy_m_s must both be set, or neither: vy_m_s is missing",
        ),
        (
            ["angle_sensor.error_at_zero_range_y_rad=1e-4"],
            "angle_sensor holds a value of an engagement in space",
        ),
        (
            [
                "information_set.model=guaranteed",
                "information_set.initial_set=box",
                "uncertainty.vx_km_s=[-120, -57]",
            ],
            "the guaranteed model needs a closing speed known to better than 100 %",
        ),
        (
            ["information_set.model=guaranteed", "information_set.initial_set=rectangle"],
            'initial_set = "rectangle" belongs to model = "paper"',
        ),
    ],
)
def test_contradicting_values_are_refused(settings: list[str], problem: str) -> None:
    with pytest.raises(InputError) as caught:
        changed(*settings)
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_strategy_is_refused() -> None:
    assert load_scenario("asteroid-1997", ["strategy=patient"]).strategy == "patient"
    with pytest.raises(InputError, match=r'strategy: there is no "patent"; did you mean patient\?'):
        load_scenario("asteroid-1997", ["strategy=patent"])


@pytest.mark.parametrize("model", ["paper", "guaranteed"])
def test_motions_that_may_come_too_near_the_attracting_body(model: str) -> None:
    """The truth is not exact there, and the set could lose it."""
    with pytest.raises(
        InputError, match=r"sun: gravity has no bound.* at a range of \S+ km; start nearer"
    ):
        load_scenario("asteroid-1997", [f"information_set.model={model}", "sun.distance_km=6400"])


def test_gravity_that_changes_the_closing_speed_by_more_than_the_model_allows() -> None:
    with pytest.raises(InputError, match=r"may change the closing speed by 0.98.*at a range of"):
        load_scenario(
            "own-scenario", ["sun.distance_km=9e3", "sun.gravitational_parameter_km3_s2=8e7"]
        )


def test_steep_lines_of_sight_in_the_papers_model_are_warned_of() -> None:
    (line,) = scenario_warnings(changed("uncertainty.z_km=[-100, 10]"))
    assert "0.0189 rad" in line
    assert (
        scenario_warnings(
            changed("uncertainty.z_km=[-100, 10]", "information_set.model=guaranteed")
        )
        == []
    )


def test_fingerprint_depends_only_on_the_values() -> None:
    scenario = load_scenario("asteroid-1997")
    expected = fingerprint(scenario)
    assert len(expected) == 16
    assert int(expected, 16) >= 0
    bare = "\n".join(line.split("#")[0].rstrip() for line in PAPER.splitlines())
    for same in (
        changed(text=bare),
        changed(
            "nominal_range_m=5_801.30e3",
            "sun.direction_rad=1.5707963267948966",
            "description=other",
        ),
        changed("dispersion.vx_km_s=[-58.10, -579e-1]", "tie=upper"),
        changed(text=to_toml(scenario)),
    ):
        assert fingerprint(same) == expected
    zero = dataclasses.replace(
        scenario, dispersion=dataclasses.replace(scenario.dispersion, z_m=(-0.0, 0.0))
    )
    positive = dataclasses.replace(
        scenario, dispersion=dataclasses.replace(scenario.dispersion, z_m=(0.0, 0.0))
    )
    assert fingerprint(zero) == fingerprint(positive)


@pytest.mark.parametrize(
    ("setting", "part"),
    [
        ("dispersion.z_km=[-1.0, 12.0]", "dispersion.z_m reaches 2000 m above uncertainty.z_m"),
        ("closing_speed_km_s=60.0", "closing_speed_m_s is 1000 m/s outside uncertainty.vx_m_s"),
        (
            "nominal_range_km=5801300",
            "nominal_range_m is 5.8013e+09 m, far outside uncertainty.x_m",
        ),
    ],
)
def test_value_that_is_probably_not_intended_has_a_warning(setting: str, part: str) -> None:
    (warning,) = scenario_warnings(changed(setting))
    assert part in warning


@pytest.mark.parametrize(
    ("name", "settings", "part"),
    [
        (
            "dart-2022",
            ["thruster.impulses_s=[600, 300]"],
            "the engine corrects at most 56.7 m",
        ),  # 900 s of 0.063 m/s
        (
            "dart-2022",
            ["thruster.budget_m_s=0.02"],
            "the budget corrects at most 302.4 m, and the starts of [disp",
        ),
        (
            "dart-2022",
            ["thruster.last_impulse_s=900"],
            "misses of up to 197.5 m possible, and body.radius_m is 75",
        ),
        (
            "dart-2022",
            ["step_s=1000", "camera.period_s=1000"],
            "step_s is 1000 s: impulses can be decided in only 14",
        ),
        (
            "dart-2022",
            ["step_s=0.2"],
            "the flight has 72000 steps of 0.2 s, and a run takes about 1.4 s",
        ),
        ("asteroid-1997", ["information_set.sections=400"], "information_set.sections is 400"),
        ("asteroid-1997", ["thruster.max_impulse_m_s=0.3"], "of them cannot have a miss of zero"),
    ],
)
def test_part_that_does_not_fit_the_flight_has_a_warning(
    name: str, settings: list[str], part: str
) -> None:
    assert feasibility_warnings(load_scenario(name)) == []
    found = feasibility_warnings(load_scenario(name, settings))
    assert any(part in line for line in found), found
    assert feasibility_warnings(load_scenario(name, ["nominal_range_km=1e12"])) == []
