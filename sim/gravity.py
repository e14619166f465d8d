"""Bounds of the effect of gravity on the relative motion, for the guaranteed model."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from guidance import Thruster
from infoset import SetModel
from sim.scenario import Scenario, Sun

MARGIN = 1.05
LEAST_SPEED_CHANGE = 1e-8


def on_board_model(scenario: Scenario) -> SetModel:
    """Return the set model of a scenario with the bounds of gravity and of the engine's errors.

    A ValueError is raised if the true closing speed may differ from the nominal one by 100 % or more: the guaranteed
    model has no labels.
    """
    thruster = scenario.thruster
    model = replace(
        scenario.set_model,
        execution_error_relative=thruster.execution_error_relative,
        pointing_error_rad=thruster.pointing_error_rad,
    )
    model = with_gravity(model, scenario.sun, greatest_impulses_m_s(model, thruster))
    if model.speed_error >= 1.0:
        raise ValueError(
            f"the guaranteed model needs a closing speed known to better than 100 %: bounds.vx_m_s, gravity and the "
            f"impulses let it differ by {100.0 * model.speed_error:.3g} % of the nominal "
            f"{model.closing_speed_m_s:g} m/s; narrow bounds.vx_m_s"
        )
    return model


def greatest_impulses_m_s(model: SetModel, thruster: Thruster) -> float:
    """Return the greatest sum of a flight's impulses, m/s: the budget, or the greatest impulse at every step."""
    steps = model.bounds.x_m[1] / (-model.bounds.vx_m_s[1] * model.step_s) + 1.0
    most = min(thruster.budget_m_s, thruster.greatest_impulse_m_s * steps)
    return most * (1.0 + thruster.execution_error_relative)


def with_gravity(model: SetModel, sun: Sun | None, impulses_m_s: float) -> SetModel:
    """Return a model with the bounds of gravity, along each lateral axis and of the closing speed.

    `impulses_m_s` is the greatest sum of the impulses' moduli, which change the lateral velocity.

    To first order, the difference of the Sun's attraction at two points with distance vector r is
    (K/R^3)(3 (n . r) n - r), with the direction n of the Sun. Along a lateral axis, with offset a, it is at most
    (K/R^3)(1.5 |r| + 0.5 |a|), in any direction at most 2 K/R^3 |r|. The lengths of the model scale with V_x, which
    gravity changes; this adds 0.7 |a| and 2 (|r| + |a|) V/|V_x|, with the velocity V across x. R decreases by at most
    the range and the distance travelled. A margin of 5 % covers the second order and the change of n. docs/guarantee.md
    has the derivation.
    """
    if sun is None:
        return replace(model, gravity_m_s2=0.0, gravity_y_m_s2=None, gravity_speed_change=LEAST_SPEED_CHANGE)
    box, by_axis = model.bounds, [model.axis(name) for name in model.axes]
    slowest = -box.vx_m_s[1]
    flight_s = box.x_m[1] / slowest
    disturbance_m_s2 = math.hypot(*(axis.disturbance_m_s2 for axis in by_axis))
    across_m_s = box.lateral_speed_m_s + impulses_m_s + disturbance_m_s2 * flight_s
    greatest_range = float(np.hypot(box.x_m[1], box.offset_m + across_m_s * flight_s))
    orbital_speed = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m)
    nearest = sun.distance_m - greatest_range - 0.5 * (orbital_speed * flight_s) ** 2 / sun.distance_m
    gradient = MARGIN * sun.gravitational_parameter_m3_s2 / max(nearest, 0.1 * sun.distance_m) ** 3

    def along(axis: SetModel) -> float:
        speed_m_s = axis.bounds.lateral_speed_m_s + impulses_m_s + axis.disturbance_m_s2 * flight_s
        offset = axis.bounds.offset_m + speed_m_s * flight_s
        scaled = 2.0 * (greatest_range + offset) * across_m_s / slowest
        return float(gradient * (1.5 * greatest_range + 1.2 * offset + scaled))

    return replace(
        model,
        gravity_m_s2=along(by_axis[-1]),
        gravity_y_m_s2=along(by_axis[0]) if len(by_axis) > 1 else None,
        gravity_speed_change=float(max(LEAST_SPEED_CHANGE, 2.0 * gradient * greatest_range * flight_s / slowest)),
    )
