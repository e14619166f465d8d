"""The replay page: one engagement, or two side by side, step by step."""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats
from infoset.experiments.common.page_document import page
from infoset.experiments.common.units import duration_text
from infoset.experiments.interception.course import (
    Clock,
    complete_steps,
    kept_steps,
    marks,
    min_to_go_s,
    outcome_title,
    record_titles,
    true_predicted_misses,
)
from infoset.experiments.interception.record_file import replayed
from infoset.experiments.interception.study import max_guarantee_m
from infoset.guidance.thruster import modulus
from infoset.sensors import SENSORS
from infoset.set_queries import Section
from infoset.sim import Record
from infoset.sim.gravity import on_board_model

MAX_RECORDS = 2
TOLERANCE = 5e-4
"""Tolerance of outlines in a page of a long flight, as a part of their box: about 0.2 pixels on a
screen.
"""
STEPS_OF_A_BOX = 65535
"""Steps of the vertex grid across the box of a polygon: about 0.01 pixels on a screen."""


def interception_page(records: Sequence[Record]) -> str:
    """Return the replay page of one engagement, or of two side by side, as HTML."""
    heading = f"Replay of {' and '.join(dict.fromkeys(record.scenario.name for record in records))}"
    in_space = any(record.scenario.is_spatial for record in records)
    data = {
        "heading": heading,
        "about": list(
            filter(None, dict.fromkeys(record.scenario.description for record in records))
        ),
        "counts_down": Clock.of(records).counts_down,
        "records": list(map(_data, records, record_titles(records), _kept_steps_of(records))),
    }
    scripts = ["sets.js", *(["b-plane.js", "projection.js"] if in_space else []), "interception.js"]
    return page(heading, scripts, data)


def _kept_steps_of(records: Sequence[Record]) -> list[list[int]]:
    """Return the steps of each record that the page has: the same ones if the records have steps at
    the same times.
    """
    kept = [kept_steps(record) for record in records]
    if len({record.scenario.set_model.step_s for record in records}) > 1:
        return kept
    together = sorted(set().union(*kept))
    return [[index for index in together if index < record.steps] for record in records]


def _data(record: Record, title: str, kept: Sequence[int]) -> dict[str, object]:
    scenario = record.scenario
    thruster = scenario.thruster
    model = scenario.set_model
    modulus_m_s = modulus(record.impulse_m_s.T)
    before, misses_m = computed_again(record, kept)
    states: list[tuple[Section, ...]] = []
    numbers: list[tuple[int, int, int]] = []
    for previous, index in zip([-2, *kept], kept, strict=False):
        if index != previous + 1:
            states.append(before[index])
        states += [record.sections[index], before[index + 1]]
        numbers.append((len(states) - 3, len(states) - 2, len(states) - 1))
    sections = [section for state in states for section in state]
    outlines = [section.omega_alpha for section in sections]
    thinned = (
        f"; the page has {len(kept)} of {record.steps} steps" if len(kept) < record.steps else ""
    )
    fired = np.flatnonzero(modulus_m_s)
    return {
        "title": title,
        "outcome": outcome_title(record),
        "facts": f"{record.strategy} strategy, {model.model.value} model, seed {record.seed}, "
        f"run {record.run}{thinned}",
        "arrival_s": scenario.nominal_arrival_s,
        "min_to_go_s": min_to_go_s(scenario),
        "marks": [[name, duration_text(time), time] for name, time in marks(scenario).items()],
        "guaranteed_miss_m": max_guarantee_m(record.result),
        "closing_speed_m_s": model.closing_speed_m_s,
        "range_error_relative": scenario.range_sensor.relative_error
        if scenario.range_sensor is not None
        else None,
        "rate_error_rad_s": scenario.rate_sensor.error_rad_s
        if scenario.rate_sensor is not None
        else None,
        "max_impulse_m_s": thruster.max_impulse_m_s,
        "budget_m_s": thruster.budget_m_s,
        "radius_m": scenario.radius_m,
        "time_s": record.time_s[kept].tolist(),
        "measured_range_m": _known(record.measured["range"][kept])
        if "range" in record.measured
        else [None] * len(kept),
        "complete_steps": int(
            np.searchsorted(kept, complete_steps(record).max(initial=-1), side="right")
        ),
        "true_range_m": record.true_range_m[kept].tolist(),
        "next_range_m": record.true_range_m[_next(record, kept)].tolist(),
        "modulus_m_s": modulus_m_s[kept].tolist(),
        "fired_s": record.time_s[fired].tolist(),
        "fired_modulus_m_s": modulus_m_s[fired].tolist(),
        "budget_left_m_s": np.maximum(thruster.budget_m_s - np.cumsum(modulus_m_s), 0.0)[
            kept
        ].tolist(),
        "sections": {
            "states": _packed(numbers, "<u4"),
            "starts": _packed(
                np.concatenate([[0], np.cumsum([len(state) for state in states])]), "<u4"
            ),
            "labels_m": _packed([section.label_m for section in sections], "<f8"),
            "ranges_m": _packed([section.range_m for section in sections], "<f8"),
        },
        "axes": [
            {
                "along": f" along {axis}" if scenario.is_spatial else "",
                "measured_name": f"measured angle along {axis}"
                if scenario.is_spatial
                else "measured angle",
                **_axis_data(record, number, kept),
                "fired_m_s": record.impulse_m_s[fired, number].tolist(),
                "outlines": {
                    "predicted_miss_m": _packed(
                        np.concatenate([misses_m[k][number] for k in kept]), "<f8"
                    ),
                    **packed_outlines(
                        [outline[number].polygon() for outline in outlines],
                        TOLERANCE * bool(thinned),
                    ),
                },
            }
            for number, axis in enumerate(model.axes)
        ],
    }


def _next(record: Record, kept: Sequence[int]) -> list[int]:
    """Return the steps after some steps; the last step follows itself."""
    return [min(index + 1, record.steps - 1) for index in kept]


def _axis_data(record: Record, axis: int, kept: Sequence[int]) -> dict[str, object]:
    """Return what belongs to one lateral axis: the line of sight in its plane with x, impulses and
    predicted misses.
    """
    name = record.scenario.set_model.axes[axis]
    after = _next(record, kept)
    model = on_board_model(record.scenario).axis(name)
    angles, rates, misses = (
        values[:, axis]
        for values in (record.true_angle_rad, record.true_rate_rad_s, true_predicted_misses(record))
    )
    unknown = np.full(record.true_angle_rad.shape, np.nan)
    return {
        "axis": name,
        "angle_error_rad": model.angle_sensor.constant_error_rad,
        "angle_error_slope_rad_m": model.angle_sensor.error_slope_rad_per_m,
        "centroid_error_m": model.angle_sensor.centroid_error_m,
        "disturbance_m_s2": model.disturbance_m_s2,
        **{
            f"measured_{kind.quantity}": _known(record.measured.get(kind.name, unknown)[kept, axis])
            for kind in SENSORS
            if kind.is_lateral
        },
        "true_angle_rad": angles[kept].tolist(),
        "true_rate_rad_s": rates[kept].tolist(),
        "true_predicted_miss_m": misses[kept].tolist(),
        "next_angle_rad": angles[after].tolist(),
        "next_rate_rad_s": rates[after].tolist(),
        "next_predicted_miss_m": misses[after].tolist(),
        "predicted_miss_m": _known(record.predicted_miss_m[kept, axis]),
        "impulse_m_s": record.impulse_m_s[kept, axis].tolist(),
    }


def _known(values: Floats) -> list[Any]:
    """Return the values of steps; None where they are not known."""
    known: Flags = np.asarray(np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    return [
        value if is_known else None for value, is_known in zip(values.tolist(), known, strict=True)
    ]


def computed_again(
    record: Record, kept: Collection[int]
) -> tuple[Mapping[int, tuple[Section, ...]], Mapping[int, Floats]]:
    """Return by step what a record does not contain: sections before the measurement, and intervals
    of misses.

    The sections are those predicted to the steps `kept` and to the steps after them; after an
    impulse k a section is the measured one with V reduced by k. The intervals are those of the
    predicted misses of each measured section of the steps `kept`, m, shape (C, sections, 2). The
    cost is that of the steps of the set, a few ms.
    """
    wanted = {*kept}
    before = {}
    misses_m = {}
    for number, information in enumerate(
        replayed(record.scenario, record.measured, record.impulse_m_s)
    ):
        step, is_measured = divmod(number, 2)
        if is_measured and step in wanted:
            intervals = np.stack(information.predicted_miss_by_section_m(), axis=-1)
            misses_m[step] = intervals[:, 0, information.feasible[0]]
        elif not is_measured and {step - 1, step} & wanted:
            before[step] = tuple(information.sections())
    return before, misses_m


def packed_outlines(outlines: Sequence[Floats], tolerance: float = 0.0) -> dict[str, str]:
    """Return outlines with their boxes exactly and their vertices on a grid of `STEPS_OF_A_BOX`
    across the box.

    An outline has at least one vertex. A box is the minimum of each coordinate, then the maximum.
    With a tolerance, a part of the box, outlines are simplified by the algorithm of Douglas and
    Peucker.
    """
    counts = np.array([len(outline) for outline in outlines], dtype=np.int64)
    if not len(counts):
        return {"boxes": "", "counts": "", "vertices": ""}
    points = np.concatenate(outlines)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    minimum = np.minimum.reduceat(points, starts)
    maximum = np.maximum.reduceat(points, starts)
    width = np.where(maximum > minimum, maximum - minimum, 1.0)
    share = (points - np.repeat(minimum, counts, axis=0)) / np.repeat(width, counts, axis=0)
    if tolerance:
        closed = np.insert(share, np.cumsum(counts), share[starts], axis=0)
        lines = shapely.linestrings(closed, indices=np.repeat(np.arange(len(counts)), counts + 1))
        share, line = shapely.get_coordinates(shapely.simplify(lines, tolerance), return_index=True)
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
