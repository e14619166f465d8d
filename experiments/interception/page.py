"""The replay page: one engagement, or two side by side, step by step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.common.page_document import page
from experiments.common.page_packing import packed_counts, packed_floats, packed_outlines
from experiments.interception.record_titles import outcome_title, record_titles
from experiments.interception.replayed_sets import replayed
from infoset import Section
from infoset.sensors import SENSORS
from sim import Record

MOST_RECORDS = 2


def interception_page(records: Sequence[Record]) -> str:
    """Return the replay page of one engagement, or of two side by side.

    Parameters
    ----------
    records : sequence of Record
        One or two.

    Returns
    -------
    str
        HTML.
    """
    if not 1 <= len(records) <= MOST_RECORDS:
        raise ValueError(f"a page shows one record or two: got {len(records)}")
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
        "starts": packed_counts(np.concatenate([[0], np.cumsum([len(state) for state in states])])),
        "labels_m": packed_floats([section.label_m for section in sections]),
        "ranges_m": packed_floats([section.range_m for section in sections]),
        "predicted_miss_m": packed_floats(misses),
        **packed_outlines([_omega_alpha(section) for section in sections]),
    }


def _omega_alpha(section: Section) -> NDArray[np.float64]:
    """Vertices of a section in (omega, alpha), as `Section.omega_alpha` but without its checks."""
    v, z = section.polygon.vertices[: int(section.polygon.counts)].T
    alpha = z / section.range_m
    return np.stack([(v + section.closing_speed_m_s * alpha) / section.range_m, alpha], axis=1)
