"""Scenarios of commands: files, options that replace their values, warnings about values."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from infoset.experiments.common.errors import InputError, input_errors
from infoset.experiments.common.input_file import read_file
from infoset.experiments.common.options import choice
from infoset.experiments.common.units import duration_text, length_text
from infoset.experiments.interception.strategies import is_own
from infoset.experiments.interception.study import percent, some_wrong_images
from infoset.experiments.interception.sun_direction import SunDirection, direction_of
from infoset.guidance import strategy_names
from infoset.model import Model, SetModel
from infoset.sensors import OffsetCamera
from infoset.sensors.brightness import (
    AXIS_RATIO,
    RADIUS_ERROR,
    CorrectionResidual,
    correction_residual,
)
from infoset.sim.closed_form import PossibleMiss
from infoset.sim.feasibility import Feasibility, feasibility
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import MAX_STEPS, Scenario, Target
from infoset.sim.schedule import Schedule, images_until, schedule

FAR = 10.0
"""Ratio of the nominal range to the nearest possible range, greater or less than it, above which a
warning reports it.

Wrong units differ by more, usually by 1000.
"""
FEW_STEPS = 20
"""Number of decisions below which a warning reports the step.

Flights with free impulse times have 200 and more in the built-in scenarios.
"""
MANY_STEPS = 20_000
"""Number of steps above which a warning reports the step: by `STEP_COST_S` a run takes more than
0.2 s an axis.
"""
MANY_SECTIONS = 100
"""Number of sections above which a warning reports them: built-in scenarios have up to 41."""
SMALL_BURN = 0.02
"""Displacement by the duration of a burn, in errors of an image, below which it may be neglected.

At 1.9 % all flights kept the true state without a model of burns, at 8 % 98.3 % (measured).
"""
FEW_TIMES = 3
"""Number of times of a key that a line lists; JSON has all of them. Chosen: they fit a line."""
STEP_COST_S = 1e-5
"""Typical time of a step of a run along one axis, s, in the warning about too many steps.

Measured on one core: 1.2e-5 s in dart-2022 and 1.6e-5 s in asteroid-1997, in batches of 100 and
1000 runs; rounded to a power of ten, because other machines differ by more. A single run takes some
times as long a step. It changes only the duration in the warning: `MANY_STEPS` decides whether
there is one.
"""
LARGEST_BODY_M = 20_000.0
"""Radius, m, above which a warning reports it.

The largest near-Earth asteroid, (1036) Ganymed, has a radius of about 18 km.
"""
SMALL_ANGLE_RAD = 0.01
"""Largest line-of-sight angle, rad, without a warning in the model `paper`, which replaces tangents
by their angles: here a tangent is greater than its angle by 3e-5 of it."""


def load_scenario(
    name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None
) -> Scenario:
    """Read a built-in scenario or a scenario file; the parameters are as in `read_file`.

    Raise `InputError` if there is no such scenario or file, or it is invalid, or gravity has no
    bound in it.
    """
    scenario = read_file(Scenario, name_or_path, settings)
    choice(f"{os.fspath(name_or_path)}: strategy", scenario.strategy, strategy_names())
    with input_errors(os.fspath(name_or_path)):
        on_board_model(scenario)
    return scenario


def with_model(scenario: Scenario, model: Model) -> Scenario:
    """Return a scenario with another set model and its default initial set.

    With the model that the scenario has it is the scenario itself, with its initial set.
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
    """Read the scenario of a command and replace the values that its options set.

    The command may have the options `strategy`, `model` and `range_sensor`; None keeps the value of
    the scenario, and a strategy of a Python file does not change the scenario. Raise `InputError`
    if an option does not fit the scenario.
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
    """Return the scenario of a study, and lines about its model for the screen.

    The default model of a study is the guaranteed one, whatever the scenario file says: with the
    model `paper`, quantiles can include runs whose set lost the true state. ``--model`` and
    ``--set`` may choose the model; if a folder is resumed, its model is the default. There is a
    line if the default replaces the model of the file.
    """
    scenario = scenario_with(options)
    is_set = any(
        text.partition("=")[0].strip() == "information_set.model" for text in options.settings or ()
    )
    of_file = scenario.information_set.model
    default = resumed or Model.GUARANTEED
    if is_set or options.model is not None or default is of_file:
        return scenario, []

    reason = "the default of studies"
    if resumed:
        reason = "the model of the resumed folder"
    note = f"model: {default.value}, {reason}; to use that of the file, add --model {of_file.value}"
    return with_model(scenario, default), [note]


def all_warnings(scenario: Scenario) -> list[str]:
    """Return all warnings about a scenario, one line each."""
    return scenario_warnings(scenario) + feasibility_warnings(scenario)


def scenario_warnings(scenario: Scenario) -> list[str]:
    """Return a line for each value that is allowed but probably not intended."""
    return [
        *_dispersion_warnings(scenario),
        *_approach_warnings(scenario),
        *_angle_warnings(scenario),
        *_camera_warnings(scenario),
        *_target_warnings(scenario),
        *_timing_warnings(scenario),
    ]


def _dispersion_warnings(scenario: Scenario) -> Iterator[str]:
    """Yield a line for each end of the dispersion that is outside the uncertainty."""
    for prefix, unit in (("", "m"), ("v", "m_s")):
        for axis in (*scenario.set_model.axes, "x"):
            name = f"{prefix}{axis}_{unit}"
            known = getattr(scenario.set_model.bounds, name)
            true = getattr(scenario.dispersion, name)
            for excess, side in ((known[0] - true[0], "below"), (true[1] - known[1], "above")):
                if excess > 0:
                    yield (
                        f"dispersion.{name} reaches {excess:.6g} {unit.replace('_', '/')} {side} "
                        f"uncertainty.{name}: the true state may start outside the uncertainty on "
                        "board, and the set may lose it"
                    )


def _approach_warnings(scenario: Scenario) -> Iterator[str]:
    """Yield lines about a nominal speed and a nominal range outside the uncertainty."""
    uncertainty = scenario.set_model.bounds
    speed = scenario.set_model.closing_speed_m_s
    # vx_m_s is negative in an approach, and the speed positive.
    outside = max(-uncertainty.vx_m_s[1] - speed, speed + uncertainty.vx_m_s[0])
    if outside > 0:
        yield (
            f"closing_speed_m_s is {outside:.6g} m/s outside uncertainty.vx_m_s: "
            "the on-board model uses a speed that is known to be wrong"
        )
    if not uncertainty.x_m[0] / FAR <= scenario.nominal_range_m <= uncertainty.x_m[1] * FAR:
        yield (
            f"nominal_range_m is {scenario.nominal_range_m:g} m, far outside uncertainty.x_m: the "
            "times of impulses and images count from the arrival at this range; check its unit"
        )


def _angle_warnings(scenario: Scenario) -> Iterator[str]:
    """Yield a line if the model `paper` is used with angles that are not small."""
    model = scenario.set_model
    boxes = (model.bounds, scenario.dispersion)
    steepest = max(
        max(box.offset_m for box in boxes) / min(box.x_m[0] for box in boxes),
        max(box.lateral_speed_m_s for box in boxes) / model.closing_speed_m_s,
    )
    if steepest > SMALL_ANGLE_RAD and not model.is_guaranteed:
        yield (
            "information_set.model is paper, which replaces tangents by their angles, and the "
            f"line of sight may be {steepest:.3g} rad off the x axis: beyond {SMALL_ANGLE_RAD:g} "
            "rad the set may lose the true state; write model = guaranteed"
        )


def _camera_warnings(scenario: Scenario) -> Iterator[str]:
    """Yield lines about a drift without an effect, the centre of brightness and the Sun."""
    camera = scenario.camera
    if camera is None:
        return
    if camera.drift_time_s is not None and camera.drift_rad == 0.0:
        yield "camera.drift_time_s has no effect: camera.drift_urad is 0; set it, too"

    residual = _residual(scenario)
    if residual is not None and camera.centroid_error_m < residual.total_m:
        yield (
            f"camera.centroid_error_m, {camera.centroid_error_m:g} m, is less than "
            f"{residual.total_m:.3g} m, the error of the centre that a correction of the centre of "
            "brightness leaves by the rule of docs/impactors.md: with such an error the set may "
            "lose the true state"
        )

    found = direction_of(scenario.sun)
    if found is None or camera.phase_angle_rad is None or camera.sun_angle_rad is None:
        return
    of_file = SunDirection(math.degrees(camera.phase_angle_rad), math.degrees(camera.sun_angle_rad))
    if of_file.is_far_from(found):
        yield (
            f"camera has {of_file}, but the direction of [sun] gives {found}: the images have "
            "their centre of brightness on another side"
        )


def _target_warnings(scenario: Scenario) -> list[str]:
    """Return a line for each acceleration of the target that exceeds its bound."""
    model = scenario.set_model
    target = scenario.target
    if target is None or not model.is_guaranteed:
        return []

    lines = []
    for axis in model.axes:
        key, acceleration = _along(axis, target, "acceleration")
        bound_key, bound = _along(axis, model, "disturbance")
        if acceleration > bound:
            lines.append(
                f"target.{key}, {acceleration:g}, exceeds information_set.{bound_key}, {bound:g}: "
                "the guaranteed model does not allow for it and may lose the true state"
            )

    # Without a key for y, both axes have the same line.
    return list(dict.fromkeys(lines))


def flight_facts(scenario: Scenario) -> list[str]:
    """Return lines about the flight: schedule, impulses and images.

    If the nominal arrival is more than `MAX_STEPS` away, there is only a line that says so.
    """
    found = feasibility(scenario)
    if found is None:
        return [
            f"flight: the nominal arrival is more than {MAX_STEPS} steps of {scenario.step_s:g} s "
            "away, so the schedule is not printed; check nominal_range_m, or write a longer step_s"
        ]

    steps = f"{found.steps} steps of {_seconds(scenario.fitted_step_s)} s"
    if scenario.fitted_step_s != scenario.step_s:
        steps += f" (asked: {scenario.step_s:g} s)"
    lines = [
        f"flight: {duration_text(scenario.nominal_arrival_s)} in {steps}",
        *schedule_lines(scenario),
        *brightness_lines(scenario),
        *_burn_lines(scenario),
        (
            f"miss without impulses: up to {length_text(found.unguided_miss_m)}; all impulses "
            f"correct up to {length_text(found.budget_corrects_m)}"
        ),
    ]

    possible = found.possible_miss
    if possible is None:
        return lines

    errors = "errors at their bounds"
    wrong_images = scenario.set_model.wrong_images
    if wrong_images:
        errors += f" and {some_wrong_images(wrong_images)}"
    if scenario.sun is not None:
        errors += ", without gravity"
    if possible.images_m is not None:
        lines.append(
            f"miss that the images alone leave possible, with {errors} (closed form): up to "
            f"{length_text(possible.images_m)}"
        )
    lines.append(
        f"miss that the images and the speeds of [uncertainty] leave possible, with {errors}: up "
        f"to {length_text(possible.images_and_speeds_m)}"
    )
    return lines


def schedule_lines(scenario: Scenario) -> list[str]:
    """Return lines about the images and impulses that will happen, and about moved times.

    The times in a file are moved to the nearest steps.
    """
    times = schedule(scenario)
    if times is None:
        return []

    lines = [
        (
            f"images: {_span(times.images_s)}; {times.images_before_last_decision} before the "
            "last decision of an impulse"
        ),
        f"possible impulses: {_span(times.impulses_s)}",
        _arrivals_line(scenario, times),
    ]

    by_key: dict[str, list[str]] = {}
    for each in times.differences:
        by_key.setdefault(each.key, []).append(
            f"{_seconds(each.scheduled_s)} s instead of {_seconds(each.asked_s)} s"
        )

    for key, texts in by_key.items():
        line = f"{key}: {'; '.join(texts[:FEW_TIMES])}"
        if len(texts) > FEW_TIMES:
            line += f", and {len(texts) - FEW_TIMES} more"
        lines.append(f"{line} (nearest possible times)")

    return lines


def brightness_lines(scenario: Scenario) -> list[str]:
    """Return lines about the centre of brightness and the residual of its correction.

    There are none without a phase angle, or without a body.
    """
    camera = scenario.bearing_sensor
    residual = _residual(scenario)
    if not isinstance(camera, OffsetCamera) or residual is None:
        return []

    axes = scenario.set_model.axes
    along = ", ".join(
        f"{name} {offset_m:.3g} m" for name, offset_m in zip(axes, camera.offset_m, strict=True)
    )
    if camera.phase_correction:
        use = f"the set subtracts it and allows for centroid_error_m, {camera.centroid_error_m:g} m"
    else:
        allowed = ", ".join(
            f"{name} {scenario.set_model.axis(name).angle_sensor.centroid_bound_m:.3g} m"
            for name in axes
        )
        use = f"the set does not subtract it and allows for {allowed}"
    parts = (
        f"{residual.size_m:.2g} m by the radius, {residual.law_m:.2g} m by the brightness, "
        f"{residual.shape_m:.2g} m by the shape"
    )
    return [
        f"centre of brightness: {math.hypot(*camera.offset_m):.3g} m from the centre ({along}); "
        f"{use}",
        f"residual of a correction: {residual.total_m:.3g} m ({parts}) if the radius is known to "
        f"{percent(RADIUS_ERROR)} and the axis ratio is at least {AXIS_RATIO:g}; centroid_error_m "
        f"is {camera.centroid_error_m:g} m",
    ]


def brightness_json(scenario: Scenario) -> dict[str, Any] | None:
    """Return the key `centre_of_brightness` of JSON; None without a phase angle or a body."""
    camera = scenario.bearing_sensor
    residual = _residual(scenario)
    if not isinstance(camera, OffsetCamera) or residual is None:
        return None
    return {
        "offset_m": camera.offset_m,
        "phase_correction": camera.phase_correction,
        "centroid_error_m": camera.centroid_error_m,
        "residual_m": residual.total_m,
        "residual_parts_m": residual._asdict(),
        "radius_error": RADIUS_ERROR,
        "axis_ratio": AXIS_RATIO,
    }


def _residual(scenario: Scenario) -> CorrectionResidual | None:
    """Return the residual of a correction of the centre of brightness.

    None without a phase angle, or without a body.
    """
    camera = scenario.bearing_sensor
    if not isinstance(camera, OffsetCamera) or scenario.body is None:
        return None
    return correction_residual(
        camera.phase_angle_rad or 0.0, scenario.body.mean_radius_m, law=camera.brightness
    )


def _arrivals_line(scenario: Scenario, times: Schedule) -> str:
    """Return the line about the true arrivals and the time of the last impulse before them."""
    earliest_s, latest_s = times.true_arrivals_s
    line = f"true arrival: from {earliest_s:+.4g} s to {latest_s:+.4g} s after the nominal arrival"
    if scenario.impulse_steps is None or not times.impulses_s:
        return line
    last_s = times.impulses_s[-1]
    return (
        f"{line}; the last impulse is {_seconds(last_s + earliest_s)} s to "
        f"{_seconds(last_s + latest_s)} s before it"
    )


def _burn_lines(scenario: Scenario) -> list[str]:
    """Return lines about the duration of burns, whether they may be taken for impulses, and the
    latest last impulse; none for impulses without a duration.

    With a thrust, at least one impulse is possible: a scenario without one is refused.
    """
    engine = scenario.engine
    times = schedule(scenario)
    if engine.acceleration_m_s2 is None or times is None:
        return []

    last_m = scenario.closing_speed_m_s * times.impulses_s[-1]
    sensor = scenario.set_model.angle_sensor
    bound_m = min(
        sensor.axis(axis).error_bound(last_m) * last_m for axis in scenario.set_model.axes
    )
    # During a burn the mean speed given is half of the impulse.
    wrong_m = 0.5 * engine.burn_s(engine.max_impulse_m_s) * engine.max_impulse_m_s
    latest_s = latest_impulse_s(scenario)
    return [
        (
            f"burns: up to {duration_text(engine.longest_burn_s)}; as impulses they would be wrong "
            f"by up to {length_text(wrong_m)}, {percent(wrong_m / bound_m)} of the error of an "
            f"image at the last one (below {percent(SMALL_BURN)}, thrust_N and mass_kg may be left "
            "out)"
        ),
        (
            f"latest possible last_impulse_s: {_seconds(latest_s)} s; a later burn of the maximum "
            "impulse might not end before the earliest possible arrival"
        ),
    ]


def latest_impulse_s(scenario: Scenario) -> float:
    """Return the time before the nominal arrival, s, of the last step from which a burn of any
    impulse ends before the earliest possible arrival.
    """
    last_step = scenario.last_burn_step(on_board_model(scenario))
    return scenario.nominal_arrival_s - last_step * scenario.fitted_step_s


def _span(before_s: Sequence[float]) -> str:
    """Return the number of some times before the arrival, with the first and the last one."""
    if not before_s:
        return "0"
    return (
        f"{len(before_s)}, from {_seconds(before_s[0])} s to {_seconds(before_s[-1])} s before the "
        "nominal arrival"
    )


def schedule_json(scenario: Scenario) -> dict[str, Any] | None:
    """Return the key `schedule` of JSON: times before the nominal arrival, s.

    True arrivals are times after the nominal one. None if the nominal arrival is more than
    `MAX_STEPS` away.
    """
    times = schedule(scenario)
    if times is None:
        return None

    latest_s = None
    if scenario.thruster.acceleration_m_s2 is not None:
        latest_s = latest_impulse_s(scenario)

    def ends(before_s: Sequence[float]) -> dict[str, float | int | None]:
        if not before_s:
            return {"number": 0, "first_s": None, "last_s": None}
        return {"number": len(before_s), "first_s": before_s[0], "last_s": before_s[-1]}

    return {
        "nominal_arrival_s": scenario.nominal_arrival_s,
        "true_arrivals_s": times.true_arrivals_s,
        "step_s": scenario.fitted_step_s,
        "asked_step_s": scenario.step_s,
        "images": {
            **ends(times.images_s),
            "before_last_decision": times.images_before_last_decision,
        },
        "impulses": ends(times.impulses_s),
        "latest_last_impulse_s": latest_s,
        "differences": times.differences,
    }


def possible_miss_json(scenario: Scenario) -> PossibleMiss | None:
    """Return the key `possible_miss` of JSON.

    None with fewer than two images until the last decision, or if the nominal arrival is more than
    `MAX_STEPS` away.
    """
    found = feasibility(scenario)
    if found is None:
        return None
    return found.possible_miss


def _seconds(time_s: float) -> str:
    """Return a time with seven digits, which show a tenth of a second in a flight of a week."""
    return f"{time_s:.7g}"


def feasibility_warnings(scenario: Scenario) -> list[str]:
    """Return a line for each part of a scenario that does not fit its flight.

    The parts are engine, budget, images, radius of the body, steps and sections.
    """
    found = feasibility(scenario)
    if found is None:
        # The nominal flight has more than `MAX_STEPS`. `flight_facts` says so, and
        # `scenario_warnings` if its range is more than `FAR` times the greatest possible one.
        return []
    return [
        *_authority_warnings(scenario, found),
        *_body_warnings(scenario, found),
        *_step_warnings(scenario, found),
    ]


def _authority_warnings(scenario: Scenario, found: Feasibility) -> Iterator[str]:
    """Yield lines about starts that the engine or its budget cannot correct."""
    aim = "have a miss of zero"
    if scenario.body:
        aim = "hit"
    before = 0.0

    for share, corrected_m, name, key in (
        (found.beyond_engine, found.engine_corrects_m, "engine", "max_impulse_m_s"),
        (found.beyond_budget, found.budget_corrects_m, "budget", "budget_m_s"),
    ):
        # The budget, the second one, has a line only if it excludes more starts than the engine.
        if share > before:
            yield (
                f"the {name} corrects at most {length_text(corrected_m)}, and the starts of "
                f"[dispersion] miss by up to {length_text(found.unguided_miss_m)}: "
                f"{percent(share)} of them cannot {aim}, whatever the guidance does; a greater "
                f"thruster.{key}, earlier impulses or a narrower dispersion would change it"
            )
        before = share


def _body_warnings(scenario: Scenario, found: Feasibility) -> Iterator[str]:
    """Yield lines about a radius that is small beside the possible misses, or very large."""
    radius_m = scenario.certain_radius_m
    if scenario.body is None or radius_m is None:
        return
    size = f"body.radius_m is {radius_m:g}"
    if not scenario.body.is_sphere_around_aim:
        size = f"the circle around the aim point that is inside the body has {radius_m:.4g} m"

    possible = found.possible_miss
    if possible is not None and possible.images_and_speeds_m > radius_m:
        yield (
            "the images before the last decision and the speeds of [uncertainty] leave misses of "
            f"up to {length_text(possible.images_and_speeds_m)} possible, and "
            f"{size}: no hit is certain before the flight; smaller errors of the images or a "
            "later last impulse would change it"
        )

    if found.unguided_miss_m <= radius_m:
        yield (
            f"{size}, and the starts of [dispersion] miss by at most "
            f"{length_text(found.unguided_miss_m)}: all of them hit without impulses; check the "
            "unit of the radius"
        )
    elif radius_m > LARGEST_BODY_M:
        yield (f"{size}: no near-Earth asteroid and hardly a comet is so large; check its unit")


def _step_warnings(scenario: Scenario, found: Feasibility) -> Iterator[str]:
    """Yield lines about too few decisions, too many steps and too many sections."""
    if found.decisions < FEW_STEPS and not scenario.thruster.is_scheduled:
        yield (
            f"step_s is {scenario.step_s:g} s: impulses can be decided in only {found.decisions} "
            "steps of the flight; check its unit, or write a shorter step (at most "
            f"{scenario.nominal_arrival_s / 100:.3g} s for 100 steps)"
        )
    if found.steps > MANY_STEPS:
        duration = duration_text(round(STEP_COST_S * found.steps * len(scenario.set_model.axes), 1))
        yield (
            f"the flight has {found.steps} steps of {scenario.step_s:g} s, and a run takes about "
            f"{duration}; check the unit of step_s, or write a longer step"
        )
    if scenario.information_set.sections > MANY_SECTIONS:
        yield (
            f"information_set.sections is {scenario.information_set.sections}: more than 10 to 30 "
            "take time and hardly change a result"
        )


def _timing_warnings(scenario: Scenario) -> list[str]:
    """Return a line if no angle is measured before the last impulse is decided."""
    model = scenario.set_model
    arrival_s = scenario.nominal_arrival_s
    if arrival_s > FAR * MAX_STEPS * model.step_s:
        # The steps are too many to be searched. A true flight has at most `MAX_STEPS`, and the
        # nominal range has a warning if [uncertainty] is not much wider than [dispersion].
        return []

    sensor = model.angle_sensor
    delay_steps = scenario.thruster.delay_steps
    steps = scenario.impulse_steps
    last_step = int(arrival_s / model.step_s)
    if steps is not None:
        last_step = steps[-1]
    has_image = any(True for _ in images_until(scenario, last_step - delay_steps))
    if has_image:
        return []

    first_s = sensor.first_image_s
    if first_s is None:
        first_s = arrival_s
    fired_s = arrival_s - last_step * model.step_s
    return [
        f"no impulse follows a measurement: images are taken from {first_s:g} s to "
        f"{sensor.last_image_s:g} s before the nominal arrival every {sensor.period_s:g} s, the "
        f"last impulse is {fired_s:g} s before it, decided {delay_steps} steps earlier"
    ]


def _along(axis: str, owner: Target | SetModel, name: str) -> tuple[str, float]:
    """Return the key of an acceleration along an axis, and its value, m/s^2.

    An object without a key for y has the same acceleration along y and z.
    """
    key = f"{name}_{axis}_m_s2"
    if axis != "y" or getattr(owner, key) is None:
        key = f"{name}_m_s2"
    return key, getattr(owner, key)
