"""Constants of a set model for the kernels."""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset._compile import inlined, record_of
from infoset.arrays import Floats
from infoset.model import Interval, SetModel

BOUND_SLACK = 1e-9
"""Relative enlargement of the bounds of the guaranteed model; in the paper's model too, of the
centroid error of a camera and of the error bound of a rate. Rounding errors are far smaller."""
BOX_ROUNDING = 16.0 * sys.float_info.epsilon
"""Enlargement of the box, relative to the largest values of its coordinates: 16 ulp, as for a
cut.
"""


class SectionLaw(NamedTuple):
    """Constants of a set model for the kernels, for one lateral axis, which is called z here.

    Parameters
    ----------
    closing_speed : float
        Nominal e, m/s.
    step : float
        Time step, s.
    disturbance : float
        Bound nu of the acceleration along z, m/s^2.
    half_v : float
        Maximum change of V by the disturbance in one step, nu times the step, m/s.
    half_v_at_start : float
        Part of `half_v` added at t = 0, m/s. The guaranteed model adds half of the change at the
        start of a step and half at its end; after t = 0 the two halves of adjacent steps are added
        together.
    disturbance_lead : float
        Time before the end of a step at which its disturbance is added, s: half a step in the
        paper's model, zero in the guaranteed one.
    impulse_error : float
        Relative error bound of an impulse.
    error_at_zero_range, error_slope : float
        Error bound of an angle: rad, and rad per metre of range.
    exact_angles : bool
        Whether z/x is the tangent of the angle. The paper's model takes the angle itself.
    label_min, label_max : float
        Limits of the labels of a true state, m.
    z_min, z_max, vz_min, vz_max, vx_min, vx_max : float
        Box of initial states, m and m/s; the guaranteed model enlarges z and V_z by the error of
        the scale.
    rectangle : bool
        Whether the initial set is the paper's rectangle in (omega, alpha). Otherwise it is the box.
    linear_band : bool
        Whether the band of an angle is made linear in the range, because the exact one is not
        concave: a camera with a centroid error or an offset, or in the guaranteed model an error
        bound that rises with the range.
    other_error_at_zero_range, other_error_slope : float
        Error bound of the angle of the other axis; zero in a plane.
    pointing_along, pointing_across : float
        Error of an impulse by the engine's direction, as shares of its component along the axis and
        of its modulus.
    burn_time : float
        Duration of a burn per m/s of its impulse, s; zero if impulses are instantaneous.
    early_along, early_across, late_along, late_across : float
        Error bounds (15a) of a burn at the levels of its start and of its end, as shares of its
        component along the axis and of its modulus; zero in the paper's model.
    channel, other : int
        Number of this axis and of the other one in arrays with an axis of channels; `other` is -1
        in a plane.
    centroid_error : float
        Part of the error bound of the angle that falls with the range x: centroid_error / x, m.
    min_range : float
        Minimum range of a label in the set, m.
    other_centroid_error : float
        `centroid_error` of the angle of the other axis.
    shift, shift_error : float
        Measured point minus the centre along the axis, and the bound of the change of this length
        by the scale, m: o and |o| eta / (1 - eta) of (21').
    farthest_shift : float
        Maximum of |shift| + shift_error of both axes, m.
    misalignment : float
        Bound of the difference of the slopes that the camera sees from the true ones.
    aim, aim_error : float
        Coordinate of the point at which guidance aims, relative to the centre, m, and the maximum
        change of it by the unknown scale of the lengths.
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
    label_min: float
    label_max: float
    z_min: float
    z_max: float
    vz_min: float
    vz_max: float
    vx_min: float
    vx_max: float
    rectangle: bool
    linear_band: bool
    other_error_at_zero_range: float
    other_error_slope: float
    pointing_along: float
    pointing_across: float
    burn_time: float
    early_along: float
    early_across: float
    late_along: float
    late_across: float
    channel: int
    other: int
    centroid_error: float
    min_range: float
    other_centroid_error: float
    shift: float
    shift_error: float
    farthest_shift: float
    misalignment: float
    aim: float
    aim_error: float


Laws = NDArray[np.record]
"""Constants of the axes, shape (C,), as records, of which kernels take the address."""


def section_laws(model: SetModel) -> tuple[SectionLaw, ...]:
    """Return the constants of a model for the kernels, for each of its lateral axes."""
    laws = [_law(model.axis(name)) for name in model.axes]
    psi = model.pointing_error_rad if model.is_guaranteed else 0.0
    if model.burn_acceleration_m_s2 is not None:
        burn_time = 1.0 / model.burn_acceleration_m_s2
        laws = [_with_burns(law._replace(burn_time=burn_time), model, psi) for law in laws]
    if len(laws) == 1:
        return tuple(laws)

    return tuple(
        law._replace(
            other_error_at_zero_range=laws[1 - channel].error_at_zero_range,
            other_error_slope=laws[1 - channel].error_slope,
            other_centroid_error=laws[1 - channel].centroid_error,
            farthest_shift=max(law.farthest_shift, laws[1 - channel].farthest_shift),
            pointing_along=(1.0 - math.cos(psi)) * (1.0 + law.impulse_error),
            pointing_across=math.sin(psi) * (1.0 + law.impulse_error),
            channel=channel,
            other=1 - channel,
        )
        for channel, law in enumerate(laws)
    )


def law_table(laws: tuple[SectionLaw, ...]) -> Laws:
    """Return the constants of all axes as an array of records, shape (C,), for kernels."""
    return np.array(list(laws), dtype=record_of(SectionLaw))


@inlined
def law_of(laws: Laws, channel: int) -> SectionLaw:
    """Return the constants of one axis from the array of all."""
    law: SectionLaw = laws[np.uint64(channel)]
    return law


def _with_burns(law: SectionLaw, model: SetModel, psi: float) -> SectionLaw:
    """Return the constants with the bounds (15a) of burns, for a pointing error psi, rad."""
    if not model.is_guaranteed:
        return law

    delta = model.execution_error_relative
    # Limits of the scale 1 / (1 + eta) of velocities.
    most = 1.0 / (1.0 - model.speed_error)
    least = 1.0 / (1.0 + model.speed_error)
    early = 0.5 * max(most - 1.0, 1.0 - least + delta**2 * most)
    late = 0.5 * ((1.0 + delta) ** 2 * most - 1.0)
    early_pointing = 0.5 * (1.0 + delta**2) * most
    late_pointing = 0.5 * (1.0 + delta) ** 2 * most
    along = 1.0 - math.cos(psi)
    across = math.sin(psi)
    return law._replace(
        early_along=early + early_pointing * along,
        early_across=early_pointing * across,
        late_along=late + late_pointing * along,
        late_across=late_pointing * across,
    )


class MissChange(NamedTuple):
    """Changes of predicted misses by an impulse, m, to be subtracted: the least one from the upper
    miss and the greatest one from the lower miss, for all errors of the engine. They have the shape
    of the times to go.
    """

    least: Floats
    greatest: Floats


def change_of_miss(impulse: Floats, to_go_s: Floats, law: SectionLaw) -> MissChange:
    """Return the changes of predicted misses by impulses of shape (C, B).

    `to_go_s`, shape (B,) or (B, S), is the time from the impulse to x = 0, s. It is not negative.
    """
    own = impulse[law.channel]
    along = np.abs(own)
    size = along
    if law.pointing_across > 0.0 or law.burn_time > 0.0:
        size = np.hypot.reduce(impulse, axis=0)
    # One more axis for labels.
    shape = (-1, *[1] * (to_go_s.ndim - 1))
    own = own.reshape(shape)
    along = along.reshape(shape)
    size = size.reshape(shape)
    if law.burn_time == 0.0:
        doubt = law.impulse_error * along
        if law.pointing_across > 0.0:
            doubt = doubt + (law.pointing_along * along + law.pointing_across * size)
        return MissChange((own - doubt) * to_go_s, (own + doubt) * to_go_s)

    duration = law.burn_time * size
    early = law.early_along * along + law.early_across * size
    late = law.late_along * along + law.late_across * size
    # After the arrival there is no burn.
    change = own * np.maximum(to_go_s - 0.5 * duration, 0.0)
    doubt = early * to_go_s + late * np.maximum(to_go_s - duration, 0.0)
    return MissChange(change - doubt, change + doubt)


def _law(model: SetModel) -> SectionLaw:
    """Return the constants of a planar model.

    Angles contain no information about scale: a true motion with closing speed e (1 + eta) has the
    angles of a motion of the model with all lengths, velocities and impulses divided by 1 + eta.
    Therefore the guaranteed model enlarges the bounds of lengths and velocities by eta, takes the
    maximum error bound of an angle over the ranges that correspond to a label, and adds eta to the
    engine's error of an impulse. See docs/guarantee.md.

    In space and for burns, `section_laws` replaces the constants from `other_error_at_zero_range`
    to `other`, `other_centroid_error` and `farthest_shift`: this function writes their values of a
    plane with instantaneous impulses.
    """
    box = model.seen_bounds
    sensor = model.angle_sensor
    eta = model.speed_error
    slope = sensor.error_slope_rad_per_m
    error = sensor.constant_error_rad
    half_v = model.acceleration_m_s2 * model.step_s
    impulse_error = 0.0
    guaranteed = model.is_guaranteed
    if guaranteed:
        # The bound of a label at the true distances from (1 - eta) x to (1 + eta) x: a rising one
        # is greatest at the far end, a falling one at the near end.
        slope *= (1.0 + math.copysign(eta, slope)) * (1.0 + BOUND_SLACK)
        error *= 1.0 + BOUND_SLACK
        impulse_error = (1.0 + model.execution_error_relative) / (1.0 - eta) - 1.0

    z_min, z_max = _scaled_outward(box.z_m, eta)
    vz_min, vz_max = _scaled_outward(box.vz_m_s, eta)
    # The true distance of a label is at least (1 - eta) x.
    centroid = sensor.centroid_bound_m * (1.0 + BOUND_SLACK) / (1.0 - eta)
    shift = float(sensor.shift_m)
    shift_error = abs(shift) * eta * (1.0 + BOUND_SLACK) / (1.0 - eta)
    min_label, max_label = model.label_limits_m
    aim = float(model.lateral_aim_m[0])
    if guaranteed:
        # Gravity changes the scale 1/(1 + eta), and thereby V where z is not zero. The rounding
        # terms keep coordinates that are known exactly inside the set.
        offset = max(abs(z) for z in box.z_m)
        speed = max(abs(v) for v in box.vz_m_s)
        # One over the minimum time to go at the start.
        rate = model.closing_speed_m_s / min_label
        slack = rate * offset * model.gravity_speed_change + BOX_ROUNDING * (speed + rate * offset)
        vz_min = vz_min - slack
        vz_max = vz_max + slack
        slack = BOX_ROUNDING * (offset + speed * max_label / model.closing_speed_m_s)
        z_min = z_min - slack
        z_max = z_max + slack

    return SectionLaw(
        closing_speed=float(model.closing_speed_m_s),
        step=float(model.step_s),
        disturbance=float(model.acceleration_m_s2),
        half_v=float(half_v),
        # The exact disturbance is a thin lens. The paper takes the segment between its ends. The
        # guaranteed model adds half of the change of V at the start of the step and half at its
        # end: their sum contains the lens.
        half_v_at_start=0.5 * float(half_v) if guaranteed else 0.0,
        disturbance_lead=0.0 if guaranteed else 0.5 * float(model.step_s),
        impulse_error=impulse_error,
        error_at_zero_range=float(error),
        error_slope=float(slope),
        exact_angles=guaranteed,
        label_min=float(min_label),
        label_max=float(max_label),
        z_min=z_min,
        z_max=z_max,
        vz_min=vz_min,
        vz_max=vz_max,
        vx_min=float(box.vx_m_s[0]),
        vx_max=float(box.vx_m_s[1]),
        rectangle=not model.starts_as_box,
        linear_band=centroid > 0.0 or shift != 0.0 or (guaranteed and slope > 0.0),
        other_error_at_zero_range=0.0,
        other_error_slope=0.0,
        pointing_along=0.0,
        pointing_across=0.0,
        burn_time=0.0,
        early_along=0.0,
        early_across=0.0,
        late_along=0.0,
        late_across=0.0,
        channel=0,
        other=-1,
        centroid_error=centroid,
        min_range=float(model.min_range_m),
        other_centroid_error=0.0,
        shift=shift,
        shift_error=shift_error,
        farthest_shift=abs(shift) + shift_error,
        misalignment=float(sensor.misalignment_rad),
        aim=aim,
        # The miss (1 + eta) Pi + a is (1 + eta) (Pi + a) - eta a.
        aim_error=eta * abs(aim),
    )


def _scaled_outward(interval: Interval, eta: float) -> Interval:
    """Return an interval that contains a / (1 + h) for all a in the interval and |h| <= eta."""
    minimum, maximum = interval
    if eta == 0.0:
        return float(minimum), float(maximum)
    slack = 1.0 + BOUND_SLACK
    if minimum < 0.0:
        minimum = slack * minimum / (1.0 - eta)
    else:
        minimum = minimum / (1.0 + eta) / slack
    if maximum > 0.0:
        maximum = slack * maximum / (1.0 - eta)
    else:
        maximum = maximum / (1.0 + eta) / slack
    return minimum, maximum
