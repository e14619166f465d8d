"""The sets of an engagement at each stage of each step, computed again from the measurements of its record."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from experiments.common.errors import InputError
from experiments.common.toml_values import shown
from infoset import InformationSet, Section
from sim import Record
from sim.gravity import on_board_model


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
    """Yield the stages of each step of a record, and the set after the last step.

    Yields
    ------
    Stages
        One per step, and one with an empty `measured`: the set predicted from the last step.

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
