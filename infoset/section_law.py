"""The numbers of a set model that the kernels need."""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

from infoset.model import InitialSet, Interval, SetModel

BOUND_SLACK = 1e-9
"""Relative, of bounds that the guaranteed model computes: what rounding may take from them is far less."""
ROUNDING = 16.0 * sys.float_info.epsilon


class SectionLaw(NamedTuple):
    """The numbers of a set model that the kernels need.

    Parameters
    ----------
    closing_speed : float
        Nominal e, m/s.
    step : float
        s.
    disturbance : float
        Bound nu of the acceleration along z, m/s^2.
    half_v : float
        What the disturbance does to V in a step, nu times the step, m/s; either way.
    half_v_at_start : float
        What is added at t = 0, m/s: where the model guarantees, a step's half stands at its start and half at its end,
        so that all that follow are added in pairs.
    disturbance_lead : float
        How long before the end of a step its disturbance is added, s: half a step as published, else none.
    impulse_error : float
        Relative error of an impulse as the set sees it.
    error_at_zero_range, error_slope : float
        Angle's error bound: rad, and rad/m of range.
    exact_angles : bool
        Whether an angle is told as its tangent; else as the angle itself, as published.
    label_least, label_greatest : float
        Labels that a truth can have, m.
    z_least, z_greatest, vz_least, vz_greatest, vx_least, vx_greatest : float
        The box of the start, m and m/s, grown by the error of the scale where the model guarantees.
    rectangle : bool
        Whether the start is the paper's rectangle in (omega, alpha) in place of the box.
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
    """The numbers of a model as the kernels take them.

    Notes
    -----
    Angles do not tell scale: a truth with closing speed e (1 + eta) looks like a motion of the model whose lengths,
    velocities and impulses are those of the truth divided by 1 + eta. So in the guaranteed model bounds of lengths and
    velocities grow outward by eta, an angle bound is the greatest over the ranges that a label can mean, and an
    impulse is known to within eta and the engine's error. See docs/guarantee.md.
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
        # Gravity turns the scale, 1/(1 + eta), which moves V where z is not zero; and a coordinate known exactly
        # must not be lost to rounding.
        slack = rate * offset * model.gravity_speed_change + ROUNDING * (speed + rate * offset)
        vz_least, vz_greatest = vz_least - slack, vz_greatest + slack
        slack = ROUNDING * (offset + speed * greatest_label / model.closing_speed_m_s)
        z_least, z_greatest = z_least - slack, z_greatest + slack
    return SectionLaw(
        closing_speed=float(model.closing_speed_m_s),
        step=float(model.step_s),
        disturbance=float(model.acceleration_m_s2),
        half_v=float(half_v),
        # The exact disturbance is a thin lens. The paper takes the segment between its ends; a sound set takes half of
        # the change of V at the start of the step and half at its end, which together contain the lens.
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
    """Interval of all a / (1 + h) with a of the interval and |h| <= eta, an ulp or two wider if eta is not zero."""
    least, greatest = interval
    if eta == 0.0:
        return float(least), float(greatest)
    slack = 1.0 + BOUND_SLACK
    return (
        slack * least / (1.0 - eta) if least < 0.0 else least / (1.0 + eta) / slack,
        slack * greatest / (1.0 - eta) if greatest > 0.0 else greatest / (1.0 + eta) / slack,
    )
