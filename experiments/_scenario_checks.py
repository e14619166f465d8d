"""What the values of a scenario file must be to one another."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal

from experiments.toml_file import Known, Problem
from experiments.toml_values import DecimalPair, shown

MOST_STEPS = 100_000
WHOLE_STEPS_TOLERANCE = Decimal("1e-9")


def cross_problems(known: Known) -> Iterator[Problem]:
    """Yield what is wrong between keys, as far as the sound values tell."""
    yield from _impulses(known)
    yield from _periods(known)
    yield from _ranges(known)
    yield from _error_law(known)
    yield from _sections(known)
    yield from _sun(known)


def _impulses(known: Known) -> Iterator[Problem]:
    least = known.number("thruster", "least_impulse_m_s")
    greatest = known.number("thruster", "greatest_impulse_m_s")
    if least is not None and greatest is not None and least > greatest:
        yield Problem(
            ("thruster", "least_impulse_m_s"),
            f"must not exceed thruster.greatest_impulse_m_s, {shown(greatest)}, found {shown(least)}",
            "lower it, or raise the greatest impulse",
        )


def _periods(known: Known) -> Iterator[Problem]:
    step = known.number("guidance", "step_s")
    for sensor in ("angle_sensor", "range_sensor", "rate_sensor"):
        period = known.number(sensor, "period_s")
        if step is None or period is None:
            continue
        steps = period / step
        whole = max(Decimal(1), steps.to_integral_value())
        if abs(steps - whole) > WHOLE_STEPS_TOLERANCE * whole:
            yield Problem(
                (sensor, "period_s"),
                f"must be a whole number of steps of guidance.step_s, {shown(step)} s, found {shown(period)}",
                f"write period_s = {shown((whole * step).normalize())}, or a step that divides it",
            )


def _spans(known: Known, key: str) -> Iterator[tuple[str, DecimalPair]]:
    for table in ("uncertainty", "dispersion"):
        pair = known.pair(table, key)
        if pair is not None:
            yield f"{table}.{key}", pair


def _ranges(known: Known) -> Iterator[Problem]:
    step = known.number("guidance", "step_s")
    speed = known.number("nominal", "closing_speed_km_s")
    threshold = known.number("guidance", "range_threshold_km")
    spans = list(_spans(known, "x_km"))
    if not spans:
        return
    where, (least, _) = min(spans, key=lambda span: span[1][0])
    if threshold is not None and threshold >= least:
        yield Problem(
            ("guidance", "range_threshold_km"),
            f"must be below the least possible range, {shown(least)} km of {where}, found {shown(threshold)}",
            "lower it, or start farther away",
        )
    elif threshold is not None and step is not None and speed is not None and threshold + speed * step >= least:
        yield Problem(
            ("guidance", "step_s"),
            f"must be short enough for more than one step from the least possible range, {shown(least)} km of {where}, "
            f"to the range threshold, {shown(threshold)} km, found {shown(step)}",
            "shorten the step",
        )
    if step is None or speed is None:
        return
    where, (_, greatest) = max(spans, key=lambda span: span[1][1])
    slowest = min([speed] + [-pair[1] for _, pair in _spans(known, "vx_km_s")])
    steps = greatest / slowest / step
    if steps > MOST_STEPS:
        yield Problem(
            ("guidance", "step_s"),
            f"must be long enough for at most {MOST_STEPS} steps, found {shown(step)}: "
            f"{shown(greatest)} km of {where} at {shown(slowest)} km/s take {steps:.3g} steps",
            "lengthen the step",
        )


def _error_law(known: Known) -> Iterator[Problem]:
    nominal_range = known.number("nominal", "range_km")
    at_nominal = known.number("angle_sensor", "error_at_nominal_range_rad")
    at_zero = known.number("angle_sensor", "error_at_zero_range_rad")
    spans = list(_spans(known, "x_km"))
    if nominal_range is None or at_nominal is None or at_zero is None or not spans:
        return
    where, (_, greatest) = max(spans, key=lambda span: span[1][1])
    offset = max((max(abs(end) for end in pair) for _, pair in _spans(known, "z_km")), default=Decimal(0))
    farthest = (greatest * greatest + offset * offset).sqrt()
    bound = at_zero + (at_nominal - at_zero) * farthest / nominal_range
    if bound <= 0:
        yield Problem(
            ("angle_sensor", "error_at_nominal_range_rad"),
            f"leaves no error bound at the greatest possible range, {farthest:.6g} km of {where}: the straight line "
            f"from {shown(at_zero)} rad at zero range is {bound:.3g} rad there, found {shown(at_nominal)}",
            "raise it, or lower error_at_zero_range_rad, so that the bound stays positive",
        )


def _sections(known: Known) -> Iterator[Problem]:
    sections = known.number("information_set", "sections")
    fewest = known.number("information_set", "fewest_sections")
    if sections is not None and fewest is not None and sections < fewest:
        yield Problem(
            ("information_set", "sections"),
            f"must be at least information_set.fewest_sections, {fewest}, found {sections}",
            "raise it, or lower fewest_sections",
        )


def _sun(known: Known) -> Iterator[Problem]:
    distance = known.number("sun", "distance_km")
    spans = list(_spans(known, "x_km"))
    if distance is None or not spans:
        return
    where, (_, greatest) = max(spans, key=lambda span: span[1][1])
    if distance <= greatest:
        yield Problem(
            ("sun", "distance_km"),
            f"must be greater than the greatest possible range, {shown(greatest)} km of {where}, "
            f"found {shown(distance)}",
            "check the unit; for free space leave the table [sun] out",
        )
