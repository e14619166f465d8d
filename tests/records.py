"""Records of the first steps of engagements."""

from __future__ import annotations

from dataclasses import replace

from infoset.sim import Record


def first_steps(record: Record, count: int) -> Record:
    """Return the first steps of an engagement."""
    return replace(
        record,
        time_s=record.time_s[:count],
        true_range_m=record.true_range_m[:count],
        true_angle_rad=record.true_angle_rad[:count],
        true_rate_rad_s=record.true_rate_rad_s[:count],
        measured={name: values[:count] for name, values in record.measured.items()},
        predicted_miss_m=record.predicted_miss_m[:count],
        impulse_m_s=record.impulse_m_s[:count],
        truth_margin_m=record.truth_margin_m[:count],
        sections=record.sections[:count],
    )
