"""Interception from Python: the functions of `sim` with scenarios by name, files and figures of what they return."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from matplotlib.figure import Figure

import sim
from experiments.common.errors import InputError
from experiments.common.figure_style import INK, SET_EDGE, figure_grid, style
from experiments.common.output import to_csv, to_json, write_file
from experiments.interception.figures.distributions import draw_band
from experiments.interception.figures.process import draw_process
from experiments.interception.record_file import write_record
from experiments.interception.scenario_file import load_scenario
from sim import Record, Results, Scenario, empirical_distribution

ScenarioOrName = Scenario | str | os.PathLike[str]
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def _by_name(
    function: Callable[Concatenate[Scenario, _Arguments], _Result],
) -> Callable[Concatenate[ScenarioOrName, _Arguments], _Result]:
    """Return a function that also takes a built-in scenario by name, or the path of a scenario file."""

    @functools.wraps(function)
    def called(scenario: ScenarioOrName, *args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        known = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        return function(known, *args, **kwargs)

    return called  # type: ignore[return-value]  # the first parameter may also be given by keyword


simulate = _by_name(sim.simulate)
fly_one = _by_name(sim.fly_one)
find_worst = _by_name(sim.find_worst)
lower_bound = _by_name(sim.lower_bound)


def save(results: Results | Record, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write results as CSV or JSON, or the record of one engagement as ``.npz``.

    Parameters
    ----------
    results : Results or Record
        `load_record` reads a record again.
    path : str or path
        Its suffix selects the format: ``.csv`` or ``.json`` for results, ``.npz`` for a record.

    Raises
    ------
    InputError
        If the suffix is none of these, or the file exists or cannot be written.
    """
    file = Path(path)
    if isinstance(results, Record):
        write_record(results, file, overwrite=overwrite)
        return
    columns = results.to_dict()
    if file.suffix == ".json":
        text = to_json(columns)
    elif file.suffix == ".csv":
        text = to_csv(list(columns), list(zip(*columns.values(), strict=True)))
    else:
        raise InputError(f"{file}: results are written as .csv or .json; for example results.csv")
    write_file(file, text, overwrite=overwrite)


def plot(results: Results | Record | Sequence[Record]) -> Figure:
    """Draw results, or the course of up to two engagements.

    Parameters
    ----------
    results : Results, Record or sequence of Record
        Results give the distributions of miss and impulse, each with its 95 % confidence band. Records give angle,
        rate, predicted miss and impulses over time (`draw_process`).
    """
    if not isinstance(results, Results):
        return draw_process([results] if isinstance(results, Record) else results)
    with style():
        figure, (left, right) = figure_grid(75.0, 1, 2, (14.0, 4.0, 12.0, 7.0), (9.0, 0.0))
        panels = ((left, "miss, m", results.miss_m), (right, "impulse spent, m/s", results.impulse_m_s))
        for axes, label, sample in panels:
            found = empirical_distribution(sample)
            draw_band(axes, found.values, found.lower, found.upper, SET_EDGE)
            axes.plot(found.values, found.probability, drawstyle="steps-post", color=INK)
            axes.set_xlabel(label)
        left.set_ylabel(f"share of {len(results)} runs")
    return figure
