"""Constants of a set model for the kernels."""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

from infoset.model import InitialSet, Interval, SetModel

BOUND_SLACK = 1e-9
"""Relative enlargement of the bounds of the guaranteed model; rounding errors are far smaller."""
ROUNDING = 16.0 * sys.float_info.epsilon


class SectionLaw(NamedTuple):
    """Constants of a set model for the kernels.

    Parameters
    ----------
    closing_speed : float
        Nominal e, m/s.
    step : float
        Time step, s.
    disturbance : float
        Bound nu of the acceleration along z, m/s^2.
    half_v : float
        Greatest change of V by the disturbance in one step, nu times the step, m/s.
    half_v_at_start : float
        Part of `half_v` added at t = 0, m/s. The guaranteed model adds half of the change at the start of a step and
        half at its end; after t = 0 the two halves of adjacent steps are added together.
    disturbance_lead : float
        Time before the end of a step at which its disturbance is added, s: half a step in the paper's model, zero in
        the guaranteed one.
    impulse_error : float
        Relative error bound of an impulse.
    error_at_zero_range, error_slope : float
        Error bound of an angle: rad, and rad per metre of range.
    exact_angles : bool
        Whether z/x is the tangent of the angle. The paper's model takes the angle itself.
    label_least, label_greatest : float
        Limits of the labels of a true state, m.
    z_least, z_greatest, vz_least, vz_greatest, vx_least, vx_greatest : float
        Box of initial states, m and m/s; the guaranteed model enlarges it by the error of the scale.
    rectangle : bool
        Whether the initial set is the paper's rectangle in (omega, alpha). Otherwise it is the box.
    """

    closing_speed: float
    step: float
    disturbance: float
    half_v: float
    half_v_at_start: float
    disturbance_lead: float
    impulse_error: float
    error_at_zero_range: float
    error_slope: float
    exact_angles: bool
    label_least: float
    label_greatest: float
    z_least: float
    z_greatest: float
    vz_least: float
    vz_greatest: float
    vx_least: float
    vx_greatest: float
    rectangle: bool


def section_law(model: SetModel) -> SectionLaw:
    """Return the constants of a model for the kernels.

    Notes
    -----
    Angles contain no information about scale: a true motion with closing speed e (1 + eta) has the angles of a motion
    of the model with all lengths, velocities and impulses divided by 1 + eta. Therefore the guaranteed model enlarges
    the bounds of lengths and velocities by eta, takes the greatest error bound of an angle over the ranges that
    correspond to a label, and adds eta to the engine's error of an impulse. See docs/guarantee.md.
    """
    box, sensor, eta = model.bounds, model.angle_sensor, model.speed_error
    slope, error = sensor.error_slope_rad_per_m, sensor.error_at_zero_range_rad
    half_v = model.acceleration_m_s2 * model.step_s
    guaranteed = model.is_guaranteed
    if guaranteed:
        slope *= (1.0 + math.copysign(eta, slope)) * (1.0 + BOUND_SLACK)
        error *= 1.0 + BOUND_SLACK
    z_least, z_greatest = _scaled_outward(box.z_m, eta)
    vz_least, vz_greatest = _scaled_outward(box.vz_m_s, eta)
    least_label, greatest_label = model.label_limits_m
    if guaranteed:
        offset, speed = max(abs(z) for z in box.z_m), max(abs(v) for v in box.vz_m_s)
        rate = model.closing_speed_m_s / least_label
        # Gravity changes the scale 1/(1 + eta), and thereby V where z is not zero. The rounding term keeps coordinates
        # that are known exactly inside the set.
        slack = rate * offset * model.gravity_speed_change + ROUNDING * (speed + rate * offset)
        vz_least, vz_greatest = vz_least - slack, vz_greatest + slack
        slack = ROUNDING * (offset + speed * greatest_label / model.closing_speed_m_s)
        z_least, z_greatest = z_least - slack, z_greatest + slack
    return SectionLaw(
        closing_speed=float(model.closing_speed_m_s),
        step=float(model.step_s),
        disturbance=float(model.acceleration_m_s2),
        half_v=float(half_v),
        # The exact disturbance is a thin lens. The paper takes the segment between its ends. The guaranteed model adds
        # half of the change of V at the start of the step and half at its end: their sum contains the lens.
        half_v_at_start=0.5 * float(half_v) if guaranteed else 0.0,
        disturbance_lead=0.0 if guaranteed else 0.5 * float(model.step_s),
        impulse_error=(1.0 + model.execution_error_relative) / (1.0 - eta) - 1.0 if guaranteed else 0.0,
        error_at_zero_range=float(error),
        error_slope=float(slope),
        exact_angles=guaranteed,
        label_least=float(least_label),
        label_greatest=float(greatest_label),
        z_least=z_least,
        z_greatest=z_greatest,
        vz_least=vz_least,
        vz_greatest=vz_greatest,
        vx_least=float(box.vx_m_s[0]),
        vx_greatest=float(box.vx_m_s[1]),
        rectangle=model.initial_set is InitialSet.RECTANGLE,
    )


def _scaled_outward(interval: Interval, eta: float) -> Interval:
    """Return an interval that contains a / (1 + h) for all a in the interval and |h| <= eta."""
    least, greatest = interval
    if eta == 0.0:
        return float(least), float(greatest)
    slack = 1.0 + BOUND_SLACK
    return (
        slack * least / (1.0 - eta) if least < 0.0 else least / (1.0 + eta) / slack,
        slack * greatest / (1.0 - eta) if greatest > 0.0 else greatest / (1.0 + eta) / slack,
    )
