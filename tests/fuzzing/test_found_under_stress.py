"""What numbers under stress have brought to light: truths that were lost, and a predicted miss that
was too narrow.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import AngleSensor, Model, RateSensor, SetModel, StateBox
from infoset.guidance import NoiseKind, Thruster
from infoset.sim import Manoeuvre, Outcome, Scenario, Sun, Target
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements, Step
from infoset.sim.scenario import of_model

from .flights import Errors, engagement, fly, numbers

pytestmark = pytest.mark.thorough

SUN = Sun(1.32712440018e20, 1.5e11, 0.9)


def hostile(
    z_m: float,
    speed_m_s: float,
    step_s: float,
    at_nominal_rad: float,
    at_zero_rad: float,
    vz_m_s: float = 0.0,
) -> Scenario:
    """A flight from 1000 km without impulses."""
    box = StateBox(
        (-z_m, z_m),
        (1e6, 1.01e6),
        (-vz_m_s, vz_m_s),
        (-speed_m_s * 1.000001, -speed_m_s * 0.999999),
    )
    sensor = AngleSensor(step_s, at_nominal_rad, at_zero_rad, 1e6)
    model = SetModel(
        speed_m_s, step_s, box, sensor, range_threshold_m=2e4, sections=5, fewest_sections=3
    )
    return Scenario(
        name="hostile",
        nominal_range_m=1e6,
        dispersion=box,
        **of_model(model),
        thruster=Thruster(0.0, 1.0, 1.0),
    )


def rate_and_manoeuvre() -> Scenario:
    scenario = hostile(1e3, 1e3, 25.0, 0.01, 0.01, vz_m_s=1.0)
    return replace(
        scenario,
        **of_model(replace(scenario.set_model, disturbance_m_s2=1e-3)),
        target=Target(Manoeuvre.CONSTANT, 1e-3),
        rate_sensor=RateSensor(25.0, 1e-9),
        noise=NoiseKind.GAME,
    )


@pytest.mark.parametrize(
    "scenario",
    [
        # The error is that of the distance x/cos(alpha), not of the label's x.
        hostile(3e5, 1e3, 25.0, 0.012, 0.01, vz_m_s=1.0),
        # A changing V_x moves V = omega x - e alpha where z is not zero.
        replace(hostile(3e5, 1.5e2, 100.0, 1e-7, 1e-7), sun=SUN),
        # A rate's band and the half of the disturbance that the section holds already do not
        # commute.
        rate_and_manoeuvre(),
        # The truth's own rounding must not add up over its substeps.
        hostile(1e5, 1e3, 2.0, 1e-10, 1e-10, vz_m_s=10.0),
    ],
    ids=["rising-error", "gravity-and-known-speed", "rate-and-manoeuvre", "sharp-sensor"],
)
def test_true_state_stays_inside_under_stress(scenario: Scenario) -> None:
    draws = draw(scenario, range(20), 0)
    extremal = replace(
        draws, errors={**draws.errors, "angle": np.where(draws.errors["angle"] < 0.0, -1.0, 1.0)}
    )
    there = fly(scenario, extremal, steps=20 if scenario.sun is not None else None)
    assert Outcome.SET_EMPTY not in there.results.outcomes
    assert there.results.truth_kept.all()


def test_the_predicted_miss_covers_the_section() -> None:
    """The search for the peak must not end at an edge that falls by the rounding of V tau, which is
    not the miss's.
    """
    step = 0.03162277660168379
    scenario = engagement(1e-5, 1.0, 1.0, 1, step, Model.PAPER, errors=Errors(speed=0.0))
    scenario = replace(scenario, rate_sensor=RateSensor(step, 1.0000000000000002e-06))
    draws = numbers(scenario, 0)
    draws = replace(draws, errors={name: 0.99 * errors for name, errors in draws.errors.items()})
    minimum: list[tuple[float, float]] = []

    def look(step: Step) -> None:
        (section,) = step.information.sections(2)
        tau = section.range_m / section.closing_speed_m_s
        drift = 0.5 * scenario.set_model.disturbance_m_s2 * tau**2
        reach = float(section.polygons[0].support_function((-tau, -1.0)))
        minimum.append((float(step.predicted_miss.lower_m[0, 2]), -reach - drift))

    flight = Engagements(scenario, draws)
    while flight.step < 25:
        flight.advance(look)
    told, true = np.array(minimum).T
    np.testing.assert_allclose(told, true, rtol=0.0, atol=1e-14)
