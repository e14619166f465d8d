"""The replay page: one engagement, or two side by side, step by step."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.common.errors import InputError, shown
from experiments.common.page_document import page
from experiments.interception.record_titles import outcome_title, record_titles
from infoset import InformationSet, Section
from infoset.sensors import SENSORS
from sim import Record
from sim.gravity import on_board_model

Floats = NDArray[np.float64]

MOST_RECORDS = 2
STEPS_OF_A_BOX = 65535
"""Steps of the vertex grid across the box of a polygon: about 0.01 pixels on a screen."""


def interception_page(records: Sequence[Record]) -> str:
    """Return the replay page of one engagement, or of two side by side, as HTML.

    Parameters
    ----------
    records : sequence of Record
        One or two.
    """
    names = list(dict.fromkeys(record.scenario.name for record in records))
    titles = record_titles(records)
    return page(
        f"Replay of {' and '.join(names)}",
        ["sets.js", "interception.js"],
        {
            "heading": f"Replay of {' and '.join(names)}",
            "about": list(
                dict.fromkeys(record.scenario.description for record in records if record.scenario.description)
            ),
            "records": [_data(record, title) for record, title in zip(records, titles, strict=True)],
        },
    )


def _data(record: Record, title: str) -> dict[str, object]:
    scenario, steps = record.scenario, record.steps
    sensor, thruster, model = scenario.set_model.angle_sensor, scenario.thruster, scenario.set_model
    impulses = np.array([step.impulse_m_s for step in steps])
    velocity_x_m_s = float(record.result.velocity_m_s[0, 1])
    return {
        "title": title,
        "outcome": outcome_title(record),
        "facts": f"{record.strategy} strategy, {model.kind.value} model, seed {record.seed}, run {record.run}",
        "closing_speed_m_s": model.closing_speed_m_s,
        "angle_error_rad": sensor.error_at_zero_range_rad,
        "angle_error_slope_rad_m": sensor.error_slope_rad_per_m,
        "range_error_relative": scenario.range_sensor.relative_error if scenario.range_sensor is not None else None,
        "rate_error_rad_s": scenario.rate_sensor.error_rad_s if scenario.rate_sensor is not None else None,
        "greatest_impulse_m_s": thruster.greatest_impulse_m_s,
        "budget_m_s": thruster.budget_m_s,
        "time_s": [step.time_s for step in steps],
        **{f"measured_{kind.quantity}": [step.measured.get(kind.name) for step in steps] for kind in SENSORS},
        "true_angle_rad": [step.true_angle_rad for step in steps],
        "true_rate_rad_s": [step.true_rate_rad_s for step in steps],
        "true_range_m": [step.true_range_m for step in steps],
        # omega r^2 = V_z x - V_x z, and z + V_z x / |V_x| is the miss of the true state without further impulses.
        "true_predicted_miss_m": [-step.true_rate_rad_s * step.true_range_m**2 / velocity_x_m_s for step in steps],
        "predicted_miss_m": [step.predicted_miss_m for step in steps],
        "impulse_m_s": impulses.tolist(),
        "budget_left_m_s": np.maximum(thruster.budget_m_s - np.cumsum(np.abs(impulses)), 0.0).tolist(),
        "sets": _sets(record),
    }


def _sets(record: Record) -> dict[str, str]:
    """Sections in (omega, alpha) of every state: of step i before the measurement (2 i) and after it (2 i + 1)."""
    states: list[tuple[Section, ...]] = []
    misses: list[tuple[float, float]] = []
    for stages in replayed(record):
        states += [stages.before, stages.measured]
        misses += stages.miss_m
    sections = [section for state in states for section in state]
    return {
        "starts": _packed(np.concatenate([[0], np.cumsum([len(state) for state in states])]), "<u4"),
        "labels_m": _packed([section.label_m for section in sections], "<f8"),
        "ranges_m": _packed([section.range_m for section in sections], "<f8"),
        "predicted_miss_m": _packed(misses, "<f8"),
        **packed_outlines([_omega_alpha(section) for section in sections]),
    }


def _omega_alpha(section: Section) -> Floats:
    """Vertices of a section in (omega, alpha), as `Section.omega_alpha` but without its checks."""
    v, z = section.polygon.vertices[: int(section.polygon.counts)].T
    alpha = z / section.range_m
    return np.stack([(v + section.closing_speed_m_s * alpha) / section.range_m, alpha], axis=1)


@dataclass(frozen=True)
class Stages:
    """The sections of one step before and after its measurement.

    Parameters
    ----------
    before : tuple of Section
        Predicted from the previous step.
    measured : tuple of Section
        After the measurement: equal to the recorded sections.
    miss_m : tuple of tuple of float
        Predicted-miss interval of each measured section, m.
    """

    before: tuple[Section, ...]
    measured: tuple[Section, ...]
    miss_m: tuple[tuple[float, float], ...]


def replayed(record: Record) -> Iterator[Stages]:
    """Yield the stages of each step of a record, computed again from its measurements.

    The last stages have an empty `measured`: the set predicted from the last step.

    Raises
    ------
    InputError
        If the sets differ from the recorded ones: another version of the library wrote the record.

    Notes
    -----
    After the impulse k a section is the measured one with V reduced by k; after the prediction it is `before` of the
    next step. Two of the four stages are therefore enough. The cost is that of the steps of the set, a few ms.
    """
    scenario = record.scenario
    information = InformationSet(on_board_model(scenario))
    for number, step in enumerate(record.steps):
        before = tuple(information.sections())
        values = {name: np.array([value]) for name, value in step.measured.items()}
        for name, sensor in scenario.sensors.items():
            if name in values:
                sensor.cut(information, values, np.array([True]))
        measured = tuple(information.sections())
        if [section.label_m for section in measured] != [section.label_m for section in step.sections]:
            raise InputError(
                f"the record of {shown(scenario.name)}: replaying it gives different sets at step {number}; "
                "another version of infoset wrote it: create it again with `infoset engage --record FILE.npz`"
            )
        lower, upper = information.predicted_miss_by_section_m()
        living = information.living[0]
        ends = zip(lower[0][living].tolist(), upper[0][living].tolist(), strict=True)
        yield Stages(before, measured, tuple(ends))
        information.shift(step.impulse_m_s)
        information.drop_below_threshold()
        information.predict()
    yield Stages(tuple(information.sections()), (), ())


def packed_outlines(outlines: Sequence[Floats]) -> dict[str, str]:
    """Return outlines with their boxes exactly and their vertices on a grid of `STEPS_OF_A_BOX` across the box.

    An outline has at least one vertex. A box is the least of each coordinate, then the greatest.
    """
    counts = np.array([len(outline) for outline in outlines], dtype=np.int64)
    if not len(counts):
        return {"boxes": "", "counts": "", "vertices": ""}
    points = np.concatenate(outlines)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    least, greatest = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
    width = np.where(greatest > least, greatest - least, 1.0)
    share = (points - np.repeat(least, counts, axis=0)) / np.repeat(width, counts, axis=0)
    return {
        "boxes": _packed(np.concatenate([least, greatest], axis=1), "<f8"),
        "counts": _packed(counts, "<u4"),
        "vertices": _packed(np.rint(share * STEPS_OF_A_BOX), "<u2"),
    }


def _packed(values: ArrayLike, kind: str) -> str:
    """Return numbers as base64 of a little-endian type: doubles keep all their digits."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
