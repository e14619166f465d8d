"""Checks of relations between the values of a scenario file."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from decimal import Decimal

from experiments.common.errors import shown
from experiments.common.toml_file import MISSING
from experiments.common.toml_form import Known, Problem, keys_of
from experiments.common.toml_values import KILO, DecimalPair, si
from experiments.interception.scenario_tables import OPTIONAL_SENSORS, SPACE_KEYS, ScenarioTables
from guidance import Thruster
from infoset import AngleSensor, Model, StateBox
from infoset.model import WHOLE_STEPS_TOLERANCE
from infoset.sensors import NEGLIGIBLE_ERROR_RAD, Bias, Convention, ErrorShape
from sim.draws import MOST_STEPS
from sim.gravity import LEAST_SPEED_CHANGE

BOXES = ("uncertainty", "dispersion")
"""Tables of the possible and the true starts."""
AXIS_KEYS = ("y_km", "vy_km_s")
"""Keys of the boxes that make a scenario spatial."""
LINEAR_KEYS = (
    "error_at_nominal_range_rad",
    "error_at_zero_range_rad",
    "error_at_nominal_range_y_rad",
    "error_at_zero_range_y_rad",
)
"""Keys of the linear bound of the angle sensor; a camera has `CAMERA_KEYS` in their place."""
CAMERA_KEYS = ("pixel_error_rad", "centroid_error_m")
LEAST_DISTANCE = 10
"""Least range threshold in units of the centroid error."""
AGREE, OTHER_UNIT = 10, 100
"""Ratio of two values below which they are in the same unit, and from which they are in different units."""


def cross_problems(known: Known) -> Iterator[Problem]:
    """Yield the problems between valid values."""
    yield from _space(known)
    yield from _error_keys(known)
    hint = "exchange them: both are times before the nominal arrival"
    yield from _not_less(known, "angle_sensor", "first_image_s", "last_image_s", hint)
    hint = "raise it, or lower the least impulse"
    yield from _not_less(known, "thruster", "greatest_impulse_m_s", "least_impulse_m_s", hint)
    yield from _schedule(known)
    yield from _periods(known)
    hint = "raise it, or lower fewest_sections"
    yield from _not_less(known, "information_set", "sections", "fewest_sections", hint)
    geometric = [*_ranges(known), *_error_law(known), *_sizes(known), *_closing_speeds(known)]
    # A range or a speed in another unit causes problems of other keys.
    yield from [*_other_units(known)] or geometric if geometric else ()


def _other_units(known: Known) -> Iterator[Problem]:
    """Yield the range or speed that differs by a large factor from two others, which agree with each other."""
    for nominal, state, unit in (("closing_speed_km_s", "vx_km_s", "km/s"), ("range_km", "x_km", "km")):
        single = known.number("nominal", nominal)
        if single is None:
            continue
        sizes = {f"nominal.{nominal}": single}
        sizes |= {where: abs(pair[0] + pair[1]) / 2 for where, pair in _spans(known, state)}
        for where, size in sizes.items():
            # The nominal range sets the error bound of the angle sensor only: `scenario_warnings` reports it.
            others = [other for name, other in sizes.items() if name != where]
            if where == "nominal.range_km" or len(others) < 2 or not 0 < max(others) < AGREE * min(others):
                continue
            factor = size / max(others)
            if not 1 / Decimal(OTHER_UNIT) < factor < OTHER_UNIT:
                yield Problem(
                    (*where.split("."),),
                    f"is {float(factor):.4g} times {' and '.join(name for name in sizes if name != where)}, "
                    f"found {shown(known.value(*where.split('.')))}",
                    f"write it in {unit}",
                )


def _space(known: Known) -> Iterator[Problem]:
    """All keys that make a scenario spatial must be present, or no key of space; a disc has one error bound."""
    present = [path for path in itertools.product(BOXES, AXIS_KEYS) if _has(known, *path)]
    if not present:
        for table, key in sorted(SPACE_KEYS):
            value = known.value(table, key)
            default = keys_of(ScenarioTables, (table,))[key].default
            if value is not None and value != getattr(default, "value", default):
                yield Problem(
                    (table, key),
                    f"belongs to a scenario in space, and this one is in a plane, found {shown(value)}",
                    "remove it, or add y_km and vy_km_s to [uncertainty] and [dispersion]",
                )
        return
    for table, key in itertools.product(BOXES, AXIS_KEYS):
        if (table, key) not in present and (table,) not in known.bad:
            example = keys_of(ScenarioTables, (table,))[key].examples[0]
            yield Problem(
                (table, key),
                MISSING,
                f"add it under [{table}], for example {key} = {example}: a scenario in space has y_km and vy_km_s in "
                "[uncertainty] and [dispersion], a scenario in a plane in neither",
            )
    yield from _error_shape(known)


def _has(known: Known, table: str, key: str) -> bool:
    """Whether a table has a key, with a valid value or not."""
    return (table, key) in known.bad or known.value(table, key) is not None


def _error_shape(known: Known) -> Iterator[Problem]:
    table = "angle_sensor"
    convention, shape = known.value(table, "convention"), known.value(table, "error_shape")
    is_cone = convention == Convention.CONE.value
    if is_cone and shape == ErrorShape.BOX.value:
        yield Problem(
            (table, "error_shape"),
            'must be "disc" for convention = "cone", which bounds one angle, found "box"',
            "remove error_shape, or choose another convention",
        )
    for key in ("error_at_nominal_range", "error_at_zero_range"):
        along_y, along_z = known.number(table, f"{key}_y_rad"), known.number(table, f"{key}_rad")
        if (is_cone or shape == ErrorShape.DISC.value) and along_y not in (None, along_z):
            yield Problem(
                (table, f"{key}_y_rad"),
                f"must be equal to {key}_rad for errors in a disc or a cone, found {shown(along_y)}",
                f"remove {key}_y_rad",
            )


def _error_keys(known: Known) -> Iterator[Problem]:
    """An angle sensor has the keys of one error law: the linear bound, or the camera."""
    table = "angle_sensor"
    if known.value(table) is None:
        return
    camera = [key for key in CAMERA_KEYS if _has(known, table, key)]
    line = [key for key in LINEAR_KEYS if _has(known, table, key)]
    if known.value(table, "bias") == Bias.CONSTANT.value and not camera:
        yield Problem(
            (table, "bias"),
            'must be "random" without pixel_error_rad, found "constant": only a camera has an error of the centre',
            "remove it, or write pixel_error_rad and centroid_error_m in place of the two errors of the linear bound",
        )
    if camera and line:
        yield Problem(
            (table, line[0]),
            f"must not be set together with {camera[0]}, found {shown(known.value(table, line[0]))}",
            f"remove {' and '.join(line)} for a camera, or {' and '.join(camera)} for the linear bound",
        )
        return
    for key in ("pixel_error_rad",) if camera else LINEAR_KEYS[:2]:
        if not _has(known, table, key):
            example = keys_of(ScenarioTables, (table,))[key].examples[0]
            other = "" if camera else ", or pixel_error_rad and centroid_error_m of a camera"
            yield Problem((table, key), MISSING, f"add it under [{table}], for example {key} = {example}{other}")
    centroid, threshold = known.number(table, "centroid_error_m"), known.number("guidance", "range_threshold_km")
    if centroid is not None and threshold is not None and threshold * 1000 < LEAST_DISTANCE * centroid:
        yield Problem(
            ("guidance", "range_threshold_km"),
            f"must be at least {LEAST_DISTANCE} times angle_sensor.centroid_error_m, {shown(centroid)} m, "
            f"found {shown(threshold)}",
            f"write range_threshold_km = {(LEAST_DISTANCE * centroid / 1000).normalize():f}",
        )


def _not_less(known: Known, table: str, key: str, other: str, hint: str) -> Iterator[Problem]:
    """Yield a problem if the value of a key is less than that of another key of its table."""
    value, least = known.number(table, key), known.number(table, other)
    if value is not None and least is not None and value < least:
        yield Problem((table, key), f"must be at least {table}.{other}, {shown(least)}, found {shown(value)}", hint)


def _schedule(known: Known) -> Iterator[Problem]:
    """At least one impulse must be possible, and each of `impulses_s` must have its own step after the start."""
    nominal_range, speed = known.number("nominal", "range_km"), known.number("nominal", "closing_speed_km_s")
    last, times = known.number("thruster", "last_impulse_s"), known.value("thruster", "impulses_s")
    step, delay = known.number("guidance", "step_s"), known.value("thruster", "delay_steps")
    impulses_s = tuple(si(Decimal(time)) for time in times) if isinstance(times, list) else ()
    if nominal_range is None or speed is None or step is None or (last is None and not impulses_s):
        return
    try:
        thruster = Thruster(
            *(1.0, 0.0, 1.0),
            last_impulse_s=None if last is None else si(last),
            impulses_s=impulses_s,
            delay_steps=delay if isinstance(delay, int) else 0,
        )
        thruster.impulse_steps(si(nominal_range / speed), si(step))
    except ValueError as error:
        key = "last_impulse_s" if str(error).startswith("thruster.last_impulse_s ") else "impulses_s"
        text = str(error).removeprefix("Thruster: ").removeprefix("thruster.").removeprefix(key).lstrip(":, ")
        text = text.removeprefix("times before the arrival, ")
        yield Problem(
            ("thruster", key),
            text,
            "write times before the nominal arrival, the earliest first, after the start and before the cut-off"
            if key == "impulses_s"
            else "write a time before the nominal arrival that is less than the flight and leaves an impulse possible",
        )


def _periods(known: Known) -> Iterator[Problem]:
    step = known.number("guidance", "step_s")
    for sensor in ("angle_sensor", *OPTIONAL_SENSORS):
        period = known.number(sensor, "period_s")
        if step is None or period is None:
            continue
        steps = period / step
        whole = max(Decimal(1), steps.to_integral_value())
        if abs(steps - whole) > Decimal(WHOLE_STEPS_TOLERANCE) * whole:
            yield Problem(
                (sensor, "period_s"),
                f"must be a whole number of steps of guidance.step_s, {shown(step)} s, found {shown(period)}",
                f"write period_s = {(whole * step).normalize():f}, or a step that divides it",
            )


def _spans(known: Known, key: str) -> Iterator[tuple[str, DecimalPair]]:
    for table in BOXES:
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


def _box(known: Known, table: str) -> StateBox | None:
    """Return a box of initial states in SI; None if one of its pairs is missing or invalid."""
    is_spatial = any(_has(known, table, key) for key in AXIS_KEYS)
    keys = ("z_km", "x_km", "vz_km_s", "vx_km_s", *(AXIS_KEYS if is_spatial else ()))
    pairs = [known.pair(table, key) for key in keys]
    if None in pairs:
        return None
    return StateBox(*((si(pair[0], KILO), si(pair[1], KILO)) for pair in pairs if pair is not None))


def _error_law(known: Known) -> Iterator[Problem]:
    nominal_range = known.number("nominal", "range_km")
    boxes = {f"{table}.x_km": _box(known, table) for table in BOXES}
    distances = {where: box.farthest_m for where, box in boxes.items() if box is not None}
    if nominal_range is None or not distances:
        return
    where = max(distances, key=lambda each: distances[each])
    laws = [[_bound_key(known, end, axis) for end in ("nominal", "zero")] for axis in ("z", "y")]
    for keys in laws[:1] if laws[0] == laws[1] else laws:
        at_nominal, at_zero = (known.number("angle_sensor", key) for key in keys)
        if at_nominal is None or at_zero is None:
            continue
        first, second = (max(si(end), NEGLIGIBLE_ERROR_RAD) for end in (at_nominal, at_zero))
        bound = AngleSensor(1.0, first, second, si(nominal_range, KILO)).error_bound(distances[where])
        if bound <= 0:
            farthest_km = float(f"{distances[where] / 1000.0:.6g}")
            yield Problem(
                ("angle_sensor", keys[0]),
                f"leaves no error bound at the greatest possible range, {farthest_km!r} km of {where}: the straight "
                f"line from {shown(at_zero)} rad at zero range is {bound:.3g} rad there, found {shown(at_nominal)}",
                f"raise it, or lower {keys[1]}, so that the bound stays positive",
            )


def _bound_key(known: Known, end: str, axis: str) -> str:
    """Return the key of an error bound along an axis; without a key for y it is that of z."""
    own = f"error_at_{end}_range_y_rad"
    is_own = axis == "y" and known.value("angle_sensor", own) is not None
    return own if is_own else f"error_at_{end}_range_rad"


def _sizes(known: Known) -> Iterator[Problem]:
    """The Sun must be farther than the greatest possible range, and the body smaller than the least one."""
    distance, radius = known.number("sun", "distance_km"), known.number("body", "radius_m")
    spans = list(_spans(known, "x_km"))
    if not spans:
        return
    where, (_, greatest) = max(spans, key=lambda span: span[1][1])
    if distance is not None and distance <= greatest:
        yield Problem(
            ("sun", "distance_km"),
            f"must be greater than the greatest possible range, {shown(greatest)} km of {where}, "
            f"found {shown(distance)}",
            "check the unit; for free space omit the table [sun]",
        )
    where, (least, _) = min(spans, key=lambda span: span[1][0])
    if radius is not None and radius >= least * 1000:
        yield Problem(
            ("body", "radius_m"),
            f"must be less than the least possible range, {shown(least)} km of {where}, found {shown(radius)}",
            "check the unit; for a point omit the table [body]",
        )


def _closing_speeds(known: Known) -> Iterator[Problem]:
    """Closing speeds must be above zero and below twice the nominal one: a range x means x / (1 + eta)."""
    speed, pair = known.number("nominal", "closing_speed_km_s"), known.pair("uncertainty", "vx_km_s")
    if known.value("information_set", "model") != Model.GUARANTEED.value or speed is None or pair is None:
        return
    if max(abs(vx + speed) for vx in pair) >= speed * (1 - Decimal(LEAST_SPEED_CHANGE)):
        yield Problem(
            ("uncertainty", "vx_km_s"),
            f"must differ from nominal.closing_speed_km_s, {shown(speed)}, by less than its own value in the "
            f"guaranteed model, found closing speeds from {shown(-pair[1])} to {shown(-pair[0])}",
            "write the middle of uncertainty.vx_km_s as nominal.closing_speed_km_s, or narrow uncertainty.vx_km_s",
        )
