"""The replay page: one engagement, or two side by side, step by step."""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from infoset.arrays import Floats
from infoset.experiments.common.page_document import page
from infoset.experiments.common.units import duration_text
from infoset.experiments.interception.course import (
    Clock,
    complete_steps,
    kept_steps,
    marks,
    measured_name,
    min_to_go_s,
    outcome_title,
    record_titles,
    true_predicted_misses,
)
from infoset.experiments.interception.member_course import MemberCourse, member_courses
from infoset.experiments.interception.record_file import replayed
from infoset.experiments.interception.study import max_guarantee_m
from infoset.guidance.thruster import modulus
from infoset.sensors import SENSORS
from infoset.set_queries import Section
from infoset.sim import Record
from infoset.sim.gravity import on_board_model

MAX_RECORDS = 2
"""Maximum number of engagements side by side: a screen has room for two."""
OUTLINE_TOLERANCE = 5e-4
"""Tolerance of outlines in a page of a long flight, as a share of their box: about 0.2 pixels."""
STEPS_OF_A_BOX = 65535
"""Steps of the vertex grid across the box of a polygon: the most that two bytes hold.

A step is about 0.01 pixels on a screen. `assets/sets.js`, which reads the vertices, has the same
constant: both must be equal.
"""


def interception_page(records: Sequence[Record]) -> str:
    """Return the replay page of one engagement, or of two side by side, as HTML."""
    scenarios = [record.scenario for record in records]
    names = dict.fromkeys(scenario.name for scenario in scenarios)
    heading = f"Replay of {' and '.join(names)}"
    about = dict.fromkeys(scenario.description for scenario in scenarios if scenario.description)
    data = {
        "heading": heading,
        "about": list(about),
        "counts_down": Clock.of(records).counts_down,
        "records": list(map(_data, records, record_titles(records), _kept_steps_of(records))),
    }
    scripts = ["sets.js", "interception.js"]
    if any(scenario.is_spatial for scenario in scenarios):
        # Before the last script, which uses them.
        scripts[1:1] = ["b-plane.js", "projection.js"]
    return page(heading, scripts, data)


def _kept_steps_of(records: Sequence[Record]) -> list[list[int]]:
    """Return the steps of each record that the page has.

    Records whose steps have equal durations have the same ones, as far as they reach.
    """
    kept = [kept_steps(record) for record in records]
    if len({record.scenario.set_model.step_s for record in records}) > 1:
        return kept
    together = sorted(set().union(*kept))
    return [[index for index in together if index < record.steps] for record in records]


def _data(record: Record, title: str, kept: Sequence[int]) -> dict[str, object]:
    """Return the data of one engagement: its facts, its steps `kept`, their sets and its axes."""
    before, misses_m = computed_again(record, kept)
    sets = _sets_of(record, kept, before)
    courses = member_courses(record)
    axes = [
        _axis_data(record, number, kept)
        | {"members": _member_data(courses, number, kept)}
        | {"outlines": _outline_data(record, number, kept, sets, misses_m)}
        for number in range(len(record.scenario.set_model.axes))
    ]
    return {
        "title": title,
        **_facts(record, kept),
        **_step_data(record, kept),
        "sections": _section_data(sets),
        "axes": axes,
    }


class _Sets(NamedTuple):
    """The sets of an engagement on a page: states of the set, each a tuple of sections.

    `of_step` has three indices in `states` for each step: of the set before the measurement, after
    it, and predicted from it. The predicted set is also the set before the measurement of the next
    step, if the page has this step.
    """

    states: list[tuple[Section, ...]]
    of_step: list[tuple[int, int, int]]

    @property
    def sections(self) -> list[Section]:
        """The sections of all states."""
        return [section for state in self.states for section in state]


def _sets_of(
    record: Record, kept: Sequence[int], before: Mapping[int, tuple[Section, ...]]
) -> _Sets:
    """Return the sets of the steps `kept`; `before` has the sets predicted to a step.

    The set before a measurement is stored once: if the step before is kept, it is the predicted set
    of that step. `kept` rises.
    """
    sets = _Sets([], [])
    # No step is before the first one: -2, because -1 would be the step before step 0.
    for previous, step in zip([-2, *kept], kept, strict=False):
        if step != previous + 1:
            sets.states.append(before[step])
        sets.states.extend([record.sections[step], before[step + 1]])
        count = len(sets.states)
        sets.of_step.append((count - 3, count - 2, count - 1))
    return sets


def _section_data(sets: _Sets) -> dict[str, str]:
    """Return the states of each step, the first section of each state, and where sections are."""
    starts = np.concatenate([[0], np.cumsum([len(state) for state in sets.states])])
    return {
        "states": _packed(sets.of_step, "<u4"),
        "starts": _packed(starts, "<u4"),
        "labels_m": _packed([section.label_m for section in sets.sections], "<f8"),
        "ranges_m": _packed([section.range_m for section in sets.sections], "<f8"),
    }


def _next(record: Record, kept: Sequence[int]) -> list[int]:
    """Return the steps after some steps; the last step follows itself."""
    return [min(index + 1, record.steps - 1) for index in kept]


def _facts(record: Record, kept: Sequence[int]) -> dict[str, object]:
    """Return the facts of an engagement that do not depend on the step."""
    scenario = record.scenario
    model = scenario.set_model
    facts = (
        f"{record.strategy} strategy, {model.model.value} model, seed {record.seed}, "
        f"run {record.run}"
    )
    if len(kept) < record.steps:
        facts += f"; the page has {len(kept)} of {record.steps} steps"
    range_sensor = scenario.range_sensor
    rate_sensor = scenario.rate_sensor

    return {
        "outcome": outcome_title(record),
        "facts": facts,
        "arrival_s": scenario.nominal_arrival_s,
        "min_to_go_s": min_to_go_s(scenario),
        "marks": [[name, duration_text(time), time] for name, time in marks(scenario).items()],
        "guaranteed_miss_m": max_guarantee_m(record.result),
        "closing_speed_m_s": model.closing_speed_m_s,
        "range_error_relative": range_sensor and range_sensor.relative_error,
        "rate_error_rad_s": rate_sensor and rate_sensor.error_rad_s,
        "wrong_image_proved_s": _proved_s(record),
        "max_impulse_m_s": scenario.engine.max_impulse_m_s,
        "budget_m_s": scenario.thruster.budget_m_s,
        "radius_m": scenario.certain_radius_m,
        # Otherwise the radius is that of the circle around the aim point inside the body.
        "is_sphere": scenario.body is not None and scenario.body.is_sphere_around_aim,
    }


def _proved_s(record: Record) -> float | None:
    """Return the time at which a wrong image is proved, s; None without a proof."""
    proved = record.result.wrong_image_proved_s
    if proved is None or not proved.count():
        return None
    return float(proved[0])


def _step_data(record: Record, kept: Sequence[int]) -> dict[str, object]:
    """Return times, ranges and moduli of impulses of the steps `kept`.

    The keys `fired_...` are of all steps with an impulse, and `complete_steps` is the number of the
    steps `kept` until the last complete set.
    """
    modulus_m_s = modulus(record.impulse_m_s.T)
    fired = np.flatnonzero(modulus_m_s)
    budget_left_m_s = record.scenario.thruster.budget_m_s - np.cumsum(modulus_m_s)
    measured_range_m: list[Any] = [None] * len(kept)
    if "range" in record.measured:
        measured_range_m = _known(record.measured["range"][kept])
    last_complete = complete_steps(record).max(initial=-1)
    return {
        "time_s": record.time_s[kept].tolist(),
        "measured_range_m": measured_range_m,
        "complete_steps": int(np.searchsorted(kept, last_complete, side="right")),
        "true_range_m": record.true_range_m[kept].tolist(),
        "next_range_m": record.true_range_m[_next(record, kept)].tolist(),
        "modulus_m_s": modulus_m_s[kept].tolist(),
        "fired_s": record.time_s[fired].tolist(),
        "fired_modulus_m_s": modulus_m_s[fired].tolist(),
        # At least 0: the sum may exceed the budget by rounding errors.
        "budget_left_m_s": np.maximum(budget_left_m_s, 0.0)[kept].tolist(),
    }


def _axis_data(record: Record, axis: int, kept: Sequence[int]) -> dict[str, object]:
    """Return the data of one lateral axis: line of sight, predicted misses and impulses.

    The line of sight is in the plane of the axis and x.
    """
    name = record.scenario.set_model.axes[axis]
    after = _next(record, kept)
    model = on_board_model(record.scenario).axis(name)
    angles = record.true_angle_rad[:, axis]
    rates = record.true_rate_rad_s[:, axis]
    misses = true_predicted_misses(record)[:, axis]

    measured = measured_name(record.scenario)
    data: dict[str, object] = {"along": "", "measured_name": measured}
    if record.scenario.is_spatial:
        data = {"along": f" along {name}", "measured_name": f"{measured} along {name}"}
    data |= {
        "axis": name,
        "angle_error_rad": model.angle_sensor.constant_error_rad,
        "angle_error_slope_rad_m": model.angle_sensor.error_slope_rad_per_m,
        "centroid_error_m": model.angle_sensor.centroid_bound_m,
        "image_shift_m": model.angle_sensor.shift_m,
        "disturbance_m_s2": model.disturbance_m_s2,
    }
    unknown = np.full(record.true_angle_rad.shape, np.nan)
    for kind in SENSORS:
        if kind.is_lateral:
            values = record.measured.get(kind.name, unknown)
            data[f"measured_{kind.quantity}"] = _known(values[kept, axis])

    fired = np.flatnonzero(modulus(record.impulse_m_s.T))
    return data | {
        "true_angle_rad": angles[kept].tolist(),
        "true_rate_rad_s": rates[kept].tolist(),
        "true_predicted_miss_m": misses[kept].tolist(),
        "next_angle_rad": angles[after].tolist(),
        "next_rate_rad_s": rates[after].tolist(),
        "next_predicted_miss_m": misses[after].tolist(),
        "predicted_miss_m": _known(record.predicted_miss_m[kept, axis]),
        "impulse_m_s": record.impulse_m_s[kept, axis].tolist(),
        "fired_m_s": record.impulse_m_s[fired, axis].tolist(),
    }


def _outline_data(
    record: Record, axis: int, kept: Sequence[int], sets: _Sets, misses_m: Mapping[int, Floats]
) -> dict[str, str]:
    """Return the outlines of all sections along an axis, and the intervals of predicted misses."""
    tolerance = 0.0
    if len(kept) < record.steps:
        tolerance = OUTLINE_TOLERANCE
    intervals_m = np.concatenate([misses_m[step][axis] for step in kept])
    polygons = [section.omega_alpha[axis].polygon() for section in sets.sections]
    return {
        "predicted_miss_m": _packed(intervals_m, "<f8"),
        **packed_outlines(polygons, tolerance),
    }


def _member_data(
    courses: Sequence[MemberCourse], axis: int, kept: Sequence[int]
) -> list[dict[str, object]]:
    """Return the predicted misses of the members of a set that allows for wrong images along an
    axis, at the steps `kept`; `steps` are their indices there.
    """
    data: list[dict[str, object]] = []
    for course in courses:
        shown = [number for number, step in enumerate(kept) if step in course.steps]
        if not shown:
            continue
        intervals_m = np.array(course.intervals_m)[:, axis]
        places = [kept[number] - course.first for number in shown]
        data.append(
            {
                "steps": shown,
                "predicted_miss_m": intervals_m[places].tolist(),
                "leaves_out_class": course.group is None,
                "refuted": course.is_refuted,
            }
        )
    return data


def _known(values: Floats) -> list[Any]:
    """Return the values of steps; None for a step of which any number is not finite."""
    known: list[Any] = values.tolist()
    is_known = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    for step in np.flatnonzero(~is_known):
        known[step] = None
    return known


def computed_again(
    record: Record, kept: Collection[int]
) -> tuple[Mapping[int, tuple[Section, ...]], Mapping[int, Floats]]:
    """Return the sections and intervals of misses that a record does not contain, by step.

    The sections are predicted to the steps `kept` and to the steps after them; after an impulse k a
    section is the measured one with V reduced by k. The intervals are the intervals of the
    predicted misses of each measured section of the steps `kept`, m, shape (C, sections, 2). This
    takes as long as the steps of the set, a few ms.
    """
    wanted = {*kept}
    before = {}
    misses_m = {}
    sets = replayed(record.scenario, record.measured, record.impulse_m_s)

    # The sets before and after the measurement of a step follow each other. One before it is also
    # the set predicted from the step before.
    for number, information in enumerate(sets):
        step, is_measured = divmod(number, 2)
        if is_measured and step in wanted:
            # The set is of one run, with the index 0; sections that do not exist are left out.
            intervals = np.stack(information.predicted_miss_by_section_m(), axis=-1)
            misses_m[step] = intervals[:, 0, information.feasible[0]]
        elif not is_measured and {step - 1, step} & wanted:
            before[step] = tuple(information.sections())

    return before, misses_m


def packed_outlines(outlines: Sequence[Floats], tolerance: float = 0.0) -> dict[str, str]:
    """Return outlines as boxes and vertices on a grid of `STEPS_OF_A_BOX` across the box.

    An outline has at least one vertex. A box is the minimum of each coordinate, then the maximum,
    both exact. With a tolerance, a share of the box, outlines are simplified by the algorithm of
    Douglas and Peucker. `assets/sets.js` decodes the keys and their types of numbers.
    """
    counts = np.array([len(outline) for outline in outlines], dtype=np.int64)
    if not len(counts):
        return {"boxes": "", "counts": "", "vertices": ""}

    # The vertices of all outlines together, as shares of their boxes.
    points = np.concatenate(outlines)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    minimum = np.minimum.reduceat(points, starts)
    maximum = np.maximum.reduceat(points, starts)
    width = np.where(maximum > minimum, maximum - minimum, 1.0)
    share = (points - np.repeat(minimum, counts, axis=0)) / np.repeat(width, counts, axis=0)

    if tolerance:
        # Lines that end where they begin; the repeated vertex is dropped again.
        closed = np.insert(share, np.cumsum(counts), share[starts], axis=0)
        lines = shapely.linestrings(closed, indices=np.repeat(np.arange(len(counts)), counts + 1))
        share, line = shapely.get_coordinates(shapely.simplify(lines, tolerance), return_index=True)
        # A vertex is the last one of its line if the next one is of another line, or there is none.
        share = share[np.append(line[1:] == line[:-1], False)]
        counts = np.bincount(line) - 1

    return {
        "boxes": _packed(np.concatenate([minimum, maximum], axis=1), "<f8"),
        "counts": _packed(counts, "<u4"),
        "vertices": _packed(np.rint(share * STEPS_OF_A_BOX), "<u2"),
    }


def _packed(values: ArrayLike, kind: str) -> str:
    """Return numbers as base64 of a little-endian type: doubles keep all their digits."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
