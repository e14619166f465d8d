"""Bounds of the effect of gravity on the relative motion, for the guaranteed model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from infoset.arrays import Floats
from infoset.guidance import Thruster
from infoset.model import SetModel
from infoset.sim.flight_bounds import flight_bounds, greater_of_neighbours, no_bound
from infoset.sim.scenario import Scenario, Sun

MIN_SPEED_CHANGE = 1e-8
"""Minimum bound of the relative change of the closing speed, also in free space: an allowance for
rounding (docs/guarantee.md, after Lemma 2). Without it, an exactly known closing speed leaves
only the other allowances in the bounds that grow with eta, of labels, starts and impulses, and
those of a computed truth are rounded. It is far above rounding errors, and above the change by
gravity in the 1997 scenario.
"""


def on_board_model(scenario: Scenario) -> SetModel:
    """Return the set model of a scenario with the bounds of gravity and of the engine's errors.

    Raises
    ------
    ValueError
        If gravity has no bound, or makes the earliest arrival so early that the last burn may not
        end before it.
    """
    thruster = scenario.engine
    model = replace(
        scenario.set_model,
        execution_error_relative=thruster.execution_error_relative,
        pointing_error_rad=thruster.pointing_error_rad,
        burn_acceleration_m_s2=thruster.acceleration_m_s2,
    )
    model = with_gravity(model, scenario.sun, max_impulses_m_s(model, thruster))
    scenario.check_last_burn(model)
    return model


def max_impulses_m_s(model: SetModel, thruster: Thruster) -> float:
    """Return the maximum sum of a flight's impulses, m/s: the budget, or one in every step."""
    # At the lowest closing speed of the start, and one in step 0.
    steps = model.bounds.x_m[1] / (-model.bounds.vx_m_s[1] * model.step_s) + 1.0
    # An executed impulse may be greater than the commanded one, which the budget limits.
    most = min(thruster.budget_m_s, thruster.max_impulse_m_s * steps)
    return most * (1.0 + thruster.execution_error_relative)


def with_gravity(model: SetModel, sun: Sun | None, impulses_m_s: float) -> SetModel:
    """Return a model with the bounds of gravity, along each lateral axis and of the closing speed.

    Parameters
    ----------
    model : SetModel
        Model without these bounds.
    sun : Sun or None
        The attracting body; None is free space.
    impulses_m_s : float
        Maximum sum of the impulses' moduli, which change the lateral velocity.

    Raises
    ------
    ValueError
        If gravity has no bound: the motions may come too near the attracting body, or gravity may
        take away the closing speed or change it by more than the guaranteed model allows.

    Notes
    -----
    Lemma 2 of docs/guarantee.md, evaluated along the flight (`flight_bounds`). `pull` and `jerk`
    are bounds of the difference of gravity between spacecraft and object and of its derivative.
    """
    if sun is None:
        return replace(
            model, gravity_m_s2=0.0, gravity_y_m_s2=None, gravity_speed_change=MIN_SPEED_CHANGE
        )

    disturbances = tuple(model.axis(name).disturbance_m_s2 for name in model.axes)
    flight = flight_bounds(model.bounds, disturbances, sun, impulses_m_s)
    gradient = sun.gravitational_parameter_m3_s2 / flight.nearest_m**3
    distance = flight.distance_m
    # Bounds at each time, shape (N,).
    pull = 2.0 * gradient * flight.distance_m
    jerk = (
        2.0 * gradient * (flight.speed_m_s + 3.0 * distance * flight.fastest_m_s / flight.nearest_m)
    )

    # Equation (5) holds for bounds from each time on. The symbol m is that of Lemma 2.
    m = flight.closing_speed_m_s
    later_pull = _max_later(pull)
    later_jerk = _max_later(jerk)
    # Shapes (axes, N), the lateral axes: the last row of both is x.
    offset = flight.offset_m[:-1]
    velocity = flight.velocity_m_s[:-1]
    tide = gradient * (1.5 * distance + 0.5 * offset)
    scale = (
        later_pull / m * velocity + (0.5 * (later_pull / m) ** 2 + later_jerk / (3.0 * m)) * offset
    )
    *along_y, along_z = (_max(each) for each in tide + scale)

    # Change of the closing speed until the end of each interval of `times_s`, as a share of the
    # lowest speed.
    slowest_m_s = min(m, model.closing_speed_m_s)
    changes = np.cumsum(greater_of_neighbours(pull)) * flight.times_s[1] / slowest_m_s
    # The guaranteed model needs a `speed_error` below 1, of which the closing speeds of the start
    # take a part. If they take all, `allowed` is not positive: the cause is not gravity.
    allowed = 1.0 - replace(model, gravity_speed_change=0.0).speed_error
    if model.is_guaranteed and changes[-1] >= allowed > 0.0:
        cause = (
            f"it may change the closing speed by {allowed:.3g} of itself, all that the guaranteed "
            "model allows,"
        )
        raise no_bound(cause, distance[np.argmax(changes >= allowed)])

    return replace(
        model,
        gravity_m_s2=along_z,
        gravity_y_m_s2=along_y[0] if along_y else None,
        gravity_speed_change=float(max(MIN_SPEED_CHANGE, changes[-1])),
    )


def _max_later(values: Floats) -> Floats:
    """Return the maximum value from each time on."""
    return np.asarray(np.maximum.accumulate(values[::-1])[::-1])


def _max(values: Floats) -> float:
    """Return a bound of the maximum of a function from its values at times that are close together.

    Between two times it may exceed both values by the maximum difference of two neighbours.
    """
    return float(values.max() + np.abs(np.diff(values)).max())
