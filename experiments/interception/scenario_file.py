"""Scenarios of commands: files, the options that replace their values, and warnings about these
values.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from infoset.experiments.common.errors import InputError, input_errors
from infoset.experiments.common.input_file import read_file
from infoset.experiments.common.options import choice
from infoset.experiments.common.units import duration_text, length_text
from infoset.experiments.interception.strategies import is_own
from infoset.experiments.interception.study import percent
from infoset.guidance import strategy_names
from infoset.model import Model, SetModel
from infoset.sim.closed_form import PossibleMiss
from infoset.sim.feasibility import feasibility
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import MAX_STEPS, Scenario, Target
from infoset.sim.schedule import images_until, schedule

FAR = 10.0
"""Ratio of the nominal range to the possible ranges from which `scenario_warnings` reports it."""
FEW_STEPS, MANY_STEPS, MANY_SECTIONS = 20, 20_000, 100
"""Numbers of decisions, steps and sections that are reported as probably not intended."""
FEW_TIMES = 3
"""Number of times of a key that a line lists; JSON has all of them."""
STEP_COST_S = 1e-5
"""Typical time of a step of a run along one axis, s."""
LARGEST_BODY_M = 20_000.0
"""Radius, m, above that of all near-Earth asteroids: (1036) Ganymed, the largest one, has about 18
km.
"""
SMALL_ANGLE_RAD = 0.01
"""Largest line-of-sight angle for the model `paper`, which replaces tangents by their angles."""


def load_scenario(
    name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None
) -> Scenario:
    """Read a built-in scenario or a scenario file; the parameters are those of `read_file`.

    Raise `InputError` if there is no such scenario or file, or it is invalid, or gravity has no
    bound in it.
    """
    scenario = read_file(Scenario, name_or_path, settings)
    choice(f"{os.fspath(name_or_path)}: strategy", scenario.strategy, strategy_names())
    with input_errors(os.fspath(name_or_path)):
        on_board_model(scenario)
    return scenario


def with_model(scenario: Scenario, model: Model) -> Scenario:
    """Return a scenario with a set model; another model than the scenario's starts from its default
    initial set.
    """
    settings = scenario.information_set
    if model is settings.model:
        return scenario
    with input_errors(f"{scenario.name} with --model {model.value}"):
        changed = replace(
            scenario, information_set=replace(settings, model=model, initial_set=None)
        )
        on_board_model(changed)
    return changed


def scenario_with(options: Any) -> Scenario:
    """Read the scenario of a command and replace what its options set; None keeps the value of the
    scenario.

    The command may have the options `strategy`, `model` and `range_sensor`. A strategy of a Python
    file leaves that of the scenario. `InputError` if an option does not fit the scenario.
    """
    strategy, model, range_sensor = (
        getattr(options, name, None) for name in ("strategy", "model", "range_sensor")
    )
    scenario = load_scenario(options.scenario, options.settings)
    if strategy is not None and not is_own(strategy):
        scenario = replace(scenario, strategy=choice("--strategy", strategy, strategy_names()))
    if range_sensor and scenario.range_sensor is None:
        raise InputError(
            f"--range-sensor: the scenario {scenario.name} has no [range_sensor]; add that table "
            "to its file"
        )
    if range_sensor is False:
        scenario = replace(scenario, range_sensor=None)
    if model is not None:
        scenario = with_model(scenario, Model(model))
    return scenario


def study_scenario(options: Any, resumed: Model | None = None) -> tuple[Scenario, list[str]]:
    """Return the scenario of a study, whose default model is the guaranteed one, whatever the
    scenario file says.

    With the model `paper`, quantiles can include runs whose set lost the true state. ``--model``
    and ``--set`` may choose the model; if a folder is resumed, its model is the default. The list
    contains a line for the screen if the default replaces the model of the file.
    """
    scenario = scenario_with(options)
    is_set = any(
        text.partition("=")[0].strip() == "information_set.model" for text in options.settings or ()
    )
    of_file = scenario.information_set.model
    default = resumed or Model.GUARANTEED
    if is_set or options.model is not None or default is of_file:
        return scenario, []
    reason = "the model of the resumed folder" if resumed else "the default of studies"
    note = f"model: {default.value}, {reason}; to use that of the file, add --model {of_file.value}"
    return with_model(scenario, default), [note]


def all_warnings(scenario: Scenario) -> list[str]:
    """Return all warnings about a scenario, one line each."""
    return scenario_warnings(scenario) + feasibility_warnings(scenario)


def scenario_warnings(scenario: Scenario) -> list[str]:
    """Return warnings about values of a scenario that are allowed but probably not intended, one
    line each.
    """
    lines = []
    model = scenario.set_model
    target = scenario.target
    uncertainty = model.bounds
    dispersion = scenario.dispersion
    speed = model.closing_speed_m_s
    for prefix, unit in (("", "m"), ("v", "m_s")):
        for axis in (*model.axes, "x"):
            name = f"{prefix}{axis}_{unit}"
            known, true = (getattr(box, name) for box in (uncertainty, dispersion))
            for excess, side in ((known[0] - true[0], "below"), (true[1] - known[1], "above")):
                if excess > 0:
                    lines.append(
                        f"dispersion.{name} reaches {excess:.6g} {unit.replace('_', '/')} {side} "
                        f"uncertainty.{name}: the true state may start outside the uncertainty on "
                        "board, and the set may lose it"
                    )
    outside = max(-uncertainty.vx_m_s[1] - speed, speed + uncertainty.vx_m_s[0])
    if outside > 0:
        lines.append(
            f"closing_speed_m_s is {outside:.6g} m/s outside uncertainty.vx_m_s: "
            "the on-board model uses a speed that is known to be wrong"
        )
    if not uncertainty.x_m[0] / FAR <= scenario.nominal_range_m <= uncertainty.x_m[1] * FAR:
        lines.append(
            f"nominal_range_m is {scenario.nominal_range_m:g} m, far outside uncertainty.x_m: the "
            "times of impulses and images count from the arrival at this range; check its unit"
        )
    steepest = max(
        max(box.offset_m for box in (uncertainty, dispersion))
        / min(uncertainty.x_m[0], dispersion.x_m[0]),
        max(box.lateral_speed_m_s for box in (uncertainty, dispersion)) / speed,
    )
    if steepest > SMALL_ANGLE_RAD and not model.is_guaranteed:
        lines.append(
            "information_set.model is paper, which replaces tangents by their angles, and the "
            f"line of sight may be {steepest:.3g} rad off the x axis: beyond {SMALL_ANGLE_RAD:g} "
            "rad the set may lose the true state; write model = guaranteed"
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
    lines += _timing_warnings(scenario)
    return lines


def flight_facts(scenario: Scenario) -> list[str]:
    """Return lines about the flight, its schedule, what its impulses correct, and what its images
    leave open.
    """
    found = feasibility(scenario)
    if found is None:
        return []
    lines = [
        (
            f"flight: {duration_text(scenario.nominal_arrival_s)} in {found.steps} steps of "
            f"{scenario.step_s:g} s"
        ),
        *schedule_lines(scenario),
        f"miss without impulses: up to {length_text(found.unguided_miss_m)}; all impulses "
        f"correct up to {length_text(found.budget_corrects_m)}",
    ]
    possible = found.possible_miss
    if possible is not None and possible.images_m is not None:
        lines.append(
            "miss that the images alone leave possible, with errors at their bounds (closed "
            f"form): up to {length_text(possible.images_m)}"
        )
    if possible is not None:
        lines.append(
            "miss that the images and the speeds of [uncertainty] leave possible, with errors at "
            f"their bounds: up to {length_text(possible.images_and_speeds_m)}"
        )
    return lines


def schedule_lines(scenario: Scenario) -> list[str]:
    """Return lines about the images and impulses that will happen, and where the file asks for
    other times.
    """
    times = schedule(scenario)
    if times is None:
        return []
    lines = []
    decided = f"; {times.images_before_last_decision} before the last decision of an impulse"
    for name, before_s, more in (
        ("images", times.images_s, decided),
        ("possible impulses", times.impulses_s, ""),
    ):
        span = ""
        if before_s:
            span = (
                f", from {_seconds(before_s[0])} s to {_seconds(before_s[-1])} s before the "
                "nominal arrival"
            )
        lines.append(f"{name}: {len(before_s)}{span}{more}")
    by_key: dict[str, list[str]] = {}
    for each in times.differences:
        by_key.setdefault(each.key, []).append(
            f"{_seconds(each.scheduled_s)} s instead of {_seconds(each.asked_s)} s"
        )
    for key, texts in by_key.items():
        rest = f", and {len(texts) - FEW_TIMES} more" if len(texts) > FEW_TIMES else ""
        lines.append(f"{key}: {'; '.join(texts[:FEW_TIMES])}{rest} (nearest possible times)")
    return lines


def schedule_json(scenario: Scenario) -> dict[str, Any] | None:
    """Return the key `schedule` of JSON: times before the nominal arrival, s; None if the arrival
    is too far away.
    """
    times = schedule(scenario)
    if times is None:
        return None

    def ends(before_s: Sequence[float]) -> dict[str, float | int | None]:
        first_s, last_s = (before_s[0], before_s[-1]) if before_s else (None, None)
        return {"number": len(before_s), "first_s": first_s, "last_s": last_s}

    return {
        "nominal_arrival_s": scenario.nominal_arrival_s,
        "step_s": scenario.step_s,
        "images": {
            **ends(times.images_s),
            "before_last_decision": times.images_before_last_decision,
        },
        "impulses": ends(times.impulses_s),
        "differences": times.differences,
    }


def possible_miss_json(scenario: Scenario) -> PossibleMiss | None:
    """Return the key `possible_miss` of JSON; None with fewer than two images, or if the arrival is
    too far away.
    """
    found = feasibility(scenario)
    return None if found is None else found.possible_miss


def _seconds(time_s: float) -> str:
    """Return a time with seven digits, which show a tenth of a second in a flight of a week."""
    return f"{time_s:.7g}"


def feasibility_warnings(scenario: Scenario) -> list[str]:
    """Return warnings about an engine, a budget, images, steps or sections that do not fit the
    flight, a line each.
    """
    found = feasibility(scenario)
    lines = []
    before = 0.0
    if found is None:  # `scenario_warnings` reports the nominal range
        return []
    hit = "hit" if scenario.body else "have a miss of zero"
    for share, corrected_m, name, key in (
        (found.beyond_engine, found.engine_corrects_m, "engine", "max_impulse_m_s"),
        (found.beyond_budget, found.budget_corrects_m, "budget", "budget_m_s"),
    ):
        if share > before:
            lines.append(
                f"the {name} corrects at most {length_text(corrected_m)}, and the starts of "
                f"[dispersion] miss by up to {length_text(found.unguided_miss_m)}: "
                f"{percent(share)} of them cannot {hit}, whatever the guidance does; a greater "
                f"thruster.{key}, earlier impulses or a narrower dispersion would change it"
            )
        before = share
    possible = found.possible_miss
    radius_m = scenario.radius_m
    if possible is not None and radius_m is not None and possible.images_and_speeds_m > radius_m:
        lines.append(
            "the images before the last decision and the speeds of [uncertainty] leave misses of "
            f"up to {length_text(possible.images_and_speeds_m)} possible, and body.radius_m is "
            f"{radius_m:g}: no hit is certain before the flight; smaller errors of the images or a "
            "later last impulse would change it"
        )
    if radius_m is not None and found.unguided_miss_m <= radius_m:
        lines.append(
            f"body.radius_m is {radius_m:g}, and the starts of [dispersion] miss by at most "
            f"{length_text(found.unguided_miss_m)}: all of them hit without impulses; check the "
            "unit of the radius"
        )
    elif radius_m is not None and radius_m > LARGEST_BODY_M:
        lines.append(
            f"body.radius_m is {radius_m:g}: no near-Earth asteroid and hardly a comet is so "
            "large; check its unit"
        )
    if found.decisions < FEW_STEPS and not scenario.thruster.is_scheduled:
        lines.append(
            f"step_s is {scenario.step_s:g} s: impulses can be decided in only {found.decisions} "
            "steps of the flight; check its unit, or write a shorter step (at most "
            f"{scenario.nominal_arrival_s / 100:.3g} s for 100 steps)"
        )
    if found.steps > MANY_STEPS:
        duration = duration_text(round(STEP_COST_S * found.steps * len(scenario.set_model.axes), 1))
        lines.append(
            f"the flight has {found.steps} steps of {scenario.step_s:g} s, and a run takes about "
            f"{duration}; check the unit of step_s, or write a longer step"
        )
    if scenario.information_set.sections > MANY_SECTIONS:
        lines.append(
            f"information_set.sections is {scenario.information_set.sections}: more than 10 to 30 "
            "take time and hardly change a result"
        )
    return lines


def _timing_warnings(scenario: Scenario) -> list[str]:
    """Return a line if no angle is measured before the last impulse is decided."""
    model = scenario.set_model
    arrival_s = scenario.nominal_arrival_s
    if arrival_s > FAR * MAX_STEPS * model.step_s:
        return []  # the nominal range has a warning, and its steps are too many to be searched
    sensor = model.angle_sensor
    steps = scenario.impulse_steps
    last_step = int(arrival_s / model.step_s) if steps is None else steps[-1]
    if any(True for _ in images_until(scenario, last_step - scenario.thruster.delay_steps)):
        return []
    first_s = arrival_s if sensor.first_image_s is None else sensor.first_image_s
    fired_s = arrival_s - last_step * model.step_s
    return [
        f"no impulse follows a measurement: images are taken from {first_s:g} s to "
        f"{sensor.last_image_s:g} s before the nominal arrival every {sensor.period_s:g} s, the "
        f"last impulse is {fired_s:g} s before it, decided {scenario.thruster.delay_steps} steps "
        "earlier"
    ]


def _along(axis: str, owner: Target | SetModel | None, name: str) -> tuple[str, float]:
    """Return an acceleration along an axis, m/s^2, after its key; without a key for y it is that of
    z.
    """
    own = f"{name}_y_m_s2"
    key = own if axis == "y" and getattr(owner, own) is not None else f"{name}_m_s2"
    return key, getattr(owner, key)
