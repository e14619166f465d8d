"""Scenario files: TOML in kilometres and degrees, to and from `sim.scenario.Scenario` in SI units.

A number is read as the decimal in the file and rounded once, after the change of unit. Every SI value can therefore be
written (as its shortest decimal with the point moved) and is read back bit for bit.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from pydantic import BaseModel

from experiments.common.errors import InputError, input_errors, shown
from experiments.common.toml_file import load_tables, read_tables
from experiments.common.toml_form import Form, keys_of, template
from experiments.common.toml_values import si_name, si_values, value_text
from experiments.interception.scenario_checks import cross_problems
from experiments.interception.scenario_tables import LATER_KEYS, OPTIONAL_SENSORS, SCHEMA, SPACE_KEYS, ScenarioTables
from guidance.thruster import Thruster
from infoset.model import InitialSet, Model, SetModel, StateBox
from infoset.sensors import AngleSensor
from sim.gravity import on_board_model
from sim.scenario import Body, Scenario, Sun, Target
from sim.storage.codec import scenario_hash as scenario_hash  # noqa: PLC0414 (users import it from here)

DEFAULT_FEWEST_SECTIONS = 5
FAR = 10.0
"""Ratio of the nominal range to the possible ranges from which `scenario_warnings` reports it."""
SMALL_ANGLE_RAD = 0.01
"""Largest line-of-sight angle for the model `paper`, which replaces tangents by their angles."""

FORM = Form(
    noun="scenario",
    listed_by="infoset scenarios list",
    begun_by="infoset scenarios new FILE",
    tables=ScenarioTables,
    checks=cross_problems,
    written=("sun", "range_sensor", "angle_sensor.error_at_nominal_range_rad", "angle_sensor.error_at_zero_range_rad"),
    schema=SCHEMA,
)

Part = TypeVar("Part")


def load_scenario(name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None) -> Scenario:
    """Read a built-in scenario or a scenario file, each number rounded once after the change to SI units.

    Parameters
    ----------
    name_or_path : str or path
        A built-in name, or the path of a TOML file. A name wins over a file of that name, unless the argument has a
        path separator or ends in ``.toml``.
    settings : sequence of str or None, optional
        KEY=VALUE: values in place of those of the file, for example ``["thruster.greatest_impulse_m_s=5"]``.

    Raises
    ------
    InputError
        If there is no such scenario or file, or the file is not a valid scenario; the message lists all its problems.
    """
    return _to_scenario(load_tables(FORM, name_or_path, settings), str(name_or_path))


def read_scenario(text: str, source: str, values: Mapping[str, str] | None = None) -> Scenario:
    """Return the scenario of the text of a scenario file, as `load_scenario`; messages name `source`.

    `values` are TOML values that replace those of the text, by key, for example ``{"uncertainty.x_km.least":
    "5200.0"}``.
    """
    return _to_scenario(read_tables(FORM, text, source, values), source)


def scenario_warnings(scenario: Scenario) -> list[str]:
    """Return warnings about values of a scenario that are allowed but probably not intended, one line each."""
    lines = []
    model, thruster, target = scenario.set_model, scenario.thruster, scenario.target
    uncertainty, dispersion, speed = model.bounds, scenario.dispersion, model.closing_speed_m_s
    for prefix, per_s, unit in (("", "", "km"), ("v", "_s", "km/s")):
        for axis in (*model.axes, "x"):
            name = f"{prefix}{axis}_km{per_s}"
            known, true = (getattr(box, f"{prefix}{axis}_m{per_s}") for box in (uncertainty, dispersion))
            for excess, side in ((known[0] - true[0], "below"), (true[1] - known[1], "above")):
                if excess > 0:
                    lines.append(
                        f"dispersion.{name} reaches {excess / 1000:.6g} {unit} {side} uncertainty.{name}: "
                        "the true state may start outside the uncertainty on board, and the set may lose it"
                    )
    outside = max(-uncertainty.vx_m_s[1] - speed, speed + uncertainty.vx_m_s[0])
    if outside > 0:
        lines.append(
            f"nominal.closing_speed_km_s is {outside / 1000:.6g} km/s outside uncertainty.vx_km_s: "
            "the on-board model uses a speed that is known to be wrong"
        )
    if not uncertainty.x_m[0] / FAR <= scenario.nominal_range_m <= uncertainty.x_m[1] * FAR:
        lines.append(
            f"nominal.range_km is {scenario.nominal_range_m / 1000:.6g} km, far outside uncertainty.x_km: "
            "the error bound of the angle sensor is defined at this range; check its unit"
        )
    steepest = max(
        max(box.offset_m for box in (uncertainty, dispersion)) / min(uncertainty.x_m[0], dispersion.x_m[0]),
        max(box.lateral_speed_m_s for box in (uncertainty, dispersion)) / speed,
    )
    if steepest > SMALL_ANGLE_RAD and not model.is_guaranteed:
        lines.append(
            f"information_set.model is paper, which replaces tangents by their angles, and the line of sight may be "
            f"{steepest:.3g} rad off the x axis: beyond {SMALL_ANGLE_RAD:g} rad the set may lose the true state; "
            "write model = guaranteed"
        )
    for axis in model.axes if target is not None and model.is_guaranteed else ():
        key, acceleration = _along(axis, target, "acceleration")
        bound_key, bound = _along(axis, model, "disturbance")
        line = (
            f"target.{key}, {acceleration:g}, exceeds information_set.{bound_key}, {bound:g}: "
            "the guaranteed model does not allow for it and may lose the true state"
        )
        if acceleration > bound and line not in lines:
            lines.append(line)
    sensor = model.angle_sensor
    exact = sensor.error_at_nominal_range_y_rad == sensor.error_at_zero_range_y_rad == 0.0
    if exact and not uncertainty.y_m == uncertainty.vy_m_s == (0.0, 0.0):
        lines.append(
            "angle_sensor.error_at_nominal_range_y_rad and error_at_zero_range_y_rad are 0, and uncertainty.y_km and "
            "vy_km_s are not both [0, 0]: a measurement leaves a single range, and the set may become empty; write "
            "positive bounds"
        )
    lines += _timing_warnings(scenario)
    late = ", ".join(f"{time_s:g}" for time_s in thruster.impulses_s if time_s < (thruster.last_impulse_s or 0.0))
    if late:
        lines.append(
            f"thruster.impulses_s: the impulses at {late} s before the arrival are after the cut-off "
            f"thruster.last_impulse_s, {thruster.last_impulse_s:g} s: they are not given"
        )
    if thruster.budget_m_s < thruster.least_impulse_m_s:
        lines.append(
            f"thruster.budget_m_s, {thruster.budget_m_s:g}, is less than thruster.least_impulse_m_s, "
            f"{thruster.least_impulse_m_s:g}: no impulse can be given"
        )
    return lines


def _timing_warnings(scenario: Scenario) -> list[str]:
    """Return a line if the times before the nominal arrival leave no measured angle before the last decision."""
    model, thruster, arrival_s = scenario.set_model, scenario.thruster, scenario.nominal_arrival_s
    sensor, delay_s = model.angle_sensor, thruster.delay_steps * model.step_s
    steps = scenario.impulse_steps
    last_step = int(arrival_s / model.step_s) if steps is None else steps[-1]
    decided = last_step - thruster.delay_steps
    if decided < 0:
        return [
            f"thruster.delay_steps is {thruster.delay_steps}, which is {delay_s:g} s, and the nominal arrival is "
            f"{arrival_s:g} s after the start: no impulse is given before it"
        ]
    measured = range(0, decided + 1, model.steps_in(sensor.period_s))
    if any(sensor.measures_at(arrival_s - step * model.step_s) for step in reversed(measured)):
        return []
    if sensor.last_image_s > arrival_s:
        return [
            f"angle_sensor.last_image_s is {sensor.last_image_s:g} s, and the nominal arrival is {arrival_s:g} s after "
            "the start: no image is taken"
        ]
    all_steps = range(0, int(arrival_s / model.step_s) + 1, model.steps_in(sensor.period_s))
    before_s = [arrival_s - step * model.step_s for step in all_steps]
    if not any(map(sensor.measures_at, before_s)):
        nearest_s = min(before_s, key=lambda time_s: abs(time_s - sensor.last_image_s))
        return [
            f"angle_sensor.first_image_s is {sensor.first_image_s or 0.0:g} s and last_image_s {sensor.last_image_s:g} "
            f"s: no image is taken, because no time of a measurement (every {sensor.period_s:g} s from the start) lies "
            f"between them; the nearest is {nearest_s:g} s before the nominal arrival"
        ]
    last_s = arrival_s - last_step * model.step_s
    lead = f", decided {last_s + delay_s:g} s before it" if delay_s > 0.0 else ""
    first_s = arrival_s if sensor.first_image_s is None else sensor.first_image_s
    return [
        f"angle_sensor.first_image_s is {first_s:g} s, and the last impulse is {last_s:g} s before the nominal "
        f"arrival{lead}: no impulse follows a measurement"
    ]


def _along(axis: str, owner: Target | SetModel | None, name: str) -> tuple[str, float]:
    """Return an acceleration along an axis, m/s^2, after its key; without a key for y it is that of z."""
    own = f"{name}_y_m_s2"
    key = own if axis == "y" and getattr(owner, own) is not None else f"{name}_m_s2"
    return key, getattr(owner, key)


def default_initial_set(model: Model) -> InitialSet:
    """Return the default section at t0: the paper's rectangle in the model `paper`, else the box."""
    return {Model.PAPER: InitialSet.RECTANGLE}.get(model, InitialSet.BOX)


def with_model(scenario: Scenario, model: Model) -> Scenario:
    """Return a scenario with a set model; a model other than the scenario's starts from its default initial set."""
    set_model = scenario.set_model
    if model is set_model.kind:
        return scenario
    changed = replace(scenario, set_model=replace(set_model, kind=model, initial_set=default_initial_set(model)))
    read_scenario(scenario_to_toml(changed), f"{scenario.name} with --model {model.value}")
    return changed


def scenario_template() -> str:
    """Return a valid scenario file with a comment on every key, as a start for other scenarios."""
    return template(
        FORM,
        [
            "A scenario. Check it with: infoset scenarios check FILE",
            "Every key carries its unit in its name. z is across the nominal line of approach, x along it, and the",
            "spacecraft is the origin. A line `# key = value` is optional: the default or an example.",
            "y_km and vy_km_s in [uncertainty] and [dispersion] add a second axis across, y: the scenario is in space.",
        ],
    )


def scenario_to_toml(scenario: Scenario) -> str:
    """Return the TOML of a scenario; it is read back as the same scenario, bit for bit.

    It has every key, except the keys of space in a plane, the keys of the other error law of the angle sensor, and keys
    of `LATER_KEYS` that have their default. Raise `InputError` if no file can contain the scenario: a number is not
    finite, or its angle sensor has another nominal range.
    """
    model, sensor = scenario.set_model, scenario.set_model.angle_sensor
    if sensor.nominal_range_m != scenario.nominal_range_m:
        raise InputError(
            f"scenario {shown(scenario.name)}: its angle sensor has the nominal range {sensor.nominal_range_m!r} m and "
            f"it has {scenario.nominal_range_m!r} m; a scenario file has one, nominal.range_km"
        )
    line = ("error_at_nominal_range_rad", "error_at_zero_range_rad")
    other_law = line if sensor.is_camera else ("pixel_error_rad",)
    start = vars(scenario.dispersion).items()
    parts = {table: getattr(scenario, table) for table in ("sun", *OPTIONAL_SENSORS, "target", "body")}
    optional = {table: part and vars(part) for table, part in parts.items()}
    tables: dict[str, dict[str, object] | None] = {
        "sun": optional.pop("sun"),
        "nominal": {"range_m": scenario.nominal_range_m, "closing_speed_m_s": model.closing_speed_m_s},
        "uncertainty": vars(model.bounds),
        "dispersion": {name: pair[0] if pair and pair[0] == pair[1] else pair for name, pair in start},
        "angle_sensor": {**vars(sensor), "pixel_error_rad": sensor.pixel_error_rad, **dict.fromkeys(other_law)},
        **optional,
        "thruster": vars(scenario.thruster),
        "guidance": {**vars(model), "strategy": scenario.strategy},
        "information_set": {**vars(model), "model": model.kind},
        "noise": {"kind": scenario.noise, "tie": scenario.tie},
    }
    top = {"schema": SCHEMA, "name": scenario.name, "description": scenario.description}
    lines = [f"{key} = {value_text(key, value)}" for key, value in top.items()]
    for table, values in tables.items():
        if values is not None:
            lines += ["", f"[{table}]"]
            written = {key: values[si_name(key)] for key in keys_of(ScenarioTables, (table,))}
            lines += [
                f"{key} = {value_text(key, value)}"
                for key, value in written.items()
                if value is not None
                and (scenario.is_spatial or (table, key) not in SPACE_KEYS)
                and ((table, key) not in LATER_KEYS or value != keys_of(ScenarioTables, (table,))[key].default)
            ]
    return "\n".join(lines) + "\n"


def _to_scenario(tables: ScenarioTables, source: str) -> Scenario:
    try:
        scenario = _composed(tables)
    except ValueError as error:
        # The decimals are valid, but two that differ only beyond the sixteenth digit are equal after rounding.
        raise InputError(
            f"{source}: {error}; numbers are rounded to 16 digits: change it in the first of them"
        ) from None
    with input_errors(source):
        on_board_model(scenario)
    return scenario


def _composed(tables: ScenarioTables) -> Scenario:
    chosen, step, nominal = si_values(tables.information_set), si_values(tables.guidance), si_values(tables.nominal)
    fewest, angle_sensor = chosen.pop("fewest_sections"), si_values(tables.angle_sensor)
    pixel_error_rad = angle_sensor.pop("pixel_error_rad")
    if pixel_error_rad is not None:  # a camera; otherwise the bound is linear in the range
        angle_sensor |= dict.fromkeys(("error_at_nominal_range_rad", "error_at_zero_range_rad"), pixel_error_rad)
        angle_sensor["centroid_error_m"] = angle_sensor["centroid_error_m"] or 0.0
    return Scenario(
        name=tables.name,
        description=tables.description,
        sun=_fitted(Sun, tables.sun),
        nominal_range_m=nominal["range_m"],
        dispersion=StateBox(**si_values(tables.dispersion)),
        set_model=SetModel(
            closing_speed_m_s=nominal["closing_speed_m_s"],
            step_s=step["step_s"],
            bounds=StateBox(**si_values(tables.uncertainty)),
            angle_sensor=AngleSensor(**angle_sensor, nominal_range_m=nominal["range_m"]),
            range_threshold_m=step["range_threshold_m"],
            fewest_sections=min(DEFAULT_FEWEST_SECTIONS, chosen["sections"]) if fewest is None else fewest,
            initial_set=chosen.pop("initial_set") or default_initial_set(chosen["model"]),
            kind=chosen.pop("model"),
            **chosen,
        ),
        target=_fitted(Target, tables.target),
        body=_fitted(Body, tables.body),
        thruster=Thruster(**si_values(tables.thruster)),
        strategy=tables.guidance.strategy,
        noise=tables.noise.kind,
        tie=tables.noise.tie,
        **{table: _fitted(kind, getattr(tables, table)) for table, kind in OPTIONAL_SENSORS.items()},
    )


def _fitted(owner: type[Part], table: BaseModel | None) -> Part | None:
    return None if table is None else owner(**si_values(table))
