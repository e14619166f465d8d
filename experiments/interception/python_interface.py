"""Interception from Python: the functions of `sim` with scenarios by name, and files of what they return."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

import sim
from experiments.common.errors import InputError
from experiments.common.output import to_csv, to_json, write_file
from experiments.interception.record_file import write_record
from experiments.interception.scenario_file import load_scenario
from sim import Record, Results, Scenario

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
