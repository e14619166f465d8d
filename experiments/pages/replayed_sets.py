"""The sets of an engagement at each stage of each step, had by replaying what its record says was measured and done."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from infoset import InformationSet, Section
from sim import Record
from sim.gravity import on_board_model


@dataclass(frozen=True)
class Stages:
    """The sections of one step before and after its measurement.

    Parameters
    ----------
    before : tuple of Section
        As predicted from the step before.
    measured : tuple of Section
        As recorded.
    miss_m : tuple of tuple of float
        Predicted-miss interval of each measured section, m.
    """

    before: tuple[Section, ...]
    measured: tuple[Section, ...]
    miss_m: tuple[tuple[float, float], ...]


def replayed(record: Record) -> Iterator[Stages]:
    """Go through a record's history again, and yield the stages of each step; what is left at the end comes last.

    Parameters
    ----------
    record : Record

    Yields
    ------
    Stages
        One a step, and one more whose `measured` is empty: the set as predicted from the last step.

    Notes
    -----
    After the impulse k a section is the measured one with V less by k; after the prediction it is the next step's
    `before`. So two of the four stages are enough. Cost: that of the set's own steps, some milliseconds.
    """
    scenario = record.scenario
    information = InformationSet(on_board_model(scenario))
    for step in record.steps:
        before = tuple(information.sections())
        if step.measured_range_m is not None and scenario.range_sensor is not None:
            information.measure_range(
                step.measured_range_m, scenario.range_sensor.relative_error, alpha_rad=step.measured_angle_rad
            )
        if step.measured_angle_rad is not None:
            information.measure_angle(step.measured_angle_rad)
        if step.measured_rate_rad_s is not None and scenario.rate_sensor is not None:
            information.measure_rate(step.measured_rate_rad_s, scenario.rate_sensor.error_rad_s)
        yield Stages(before, step.sections, _misses(information, step.sections))
        information.shift(step.impulse_m_s)
        information.drop_below_threshold()
        information.predict()
    yield Stages(tuple(information.sections()), (), ())


def _misses(information: InformationSet, sections: tuple[Section, ...]) -> tuple[tuple[float, float], ...]:
    """Predicted-miss interval of each section, by its label."""
    lower, upper = information.predicted_miss_by_section_m()
    living = information.living[0]
    found = {
        label: (least, greatest)
        for label, least, greatest in zip(
            information.labels_m[0][living].tolist(), lower[0][living].tolist(), upper[0][living].tolist(), strict=True
        )
    }
    return tuple(found[section.label_m] for section in sections)
