"""Parts that the interception commands share: files, simulation, searches and lines."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import to_toml
from infoset.experiments.common.output import Output, output_of, to_json
from infoset.experiments.common.screen import (
    NOT_FINITE,
    BeginProgress,
    progress_bar,
    say_warnings,
    some_runs,
)
from infoset.experiments.interception.scenario_file import all_warnings
from infoset.experiments.interception.strategies import own_code_errors
from infoset.experiments.interception.study import SetCounts, some_wrong_images
from infoset.guidance import Strategy
from infoset.sim import Results, Scenario
from infoset.sim.adversary import NothingCountsError, Objective, WorstEngagement, find_worst
from infoset.sim.gravity import on_board_model
from infoset.sim.parallel import Task, is_finite, simulate_tasks
from infoset.sim.scenario import strategy_name
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions

Progress = Callable[[float], None]
"""Function that sets the fraction done."""


def simulate_all(tasks: Sequence[Task]) -> list[Results]:
    """Return the results of tasks, simulated in parallel; `InputError` if one is not finite."""
    try:
        results = dict(simulate_tasks(tasks))
    except FloatingPointError:
        raise InputError(NOT_FINITE) from None
    return [results[task] for task in tasks]


def need_finite(results: Results) -> None:
    """Raise `InputError` if results overflowed: no file and no figure can show them."""
    if not is_finite(results):
        raise InputError(NOT_FINITE)


@dataclass(frozen=True)
class Work:
    """A running command: its scenario with warnings, its files and its progress."""

    scenario: Scenario
    warnings: Sequence[str]
    written: Output
    begin: BeginProgress
    began_s: float

    def save(self, results: Mapping[str, object]) -> None:
        """Write the scenario, and results as JSON after the keys that all commands share.

        A key of `results` replaces a shared one: `engage` gives the time of its engagement.
        """
        self.written.save("scenario.toml", to_toml(self.scenario))
        keys: dict[str, object] = {
            "versions": versions(),
            "scenario": self.scenario.name,
            "scenario_hash": fingerprint(self.scenario),
        }
        if self.warnings:
            keys["warnings"] = self.warnings
        keys["model"] = self.scenario.information_set.model.value
        keys["range_sensor"] = self.scenario.range_sensor is not None
        keys["elapsed_s"] = perf_counter() - self.began_s
        self.written.save("results.json", to_json({**keys, **results}), "--json")


@contextlib.contextmanager
def work_of(
    options: Any,
    scenario: Scenario,
    names: Sequence[str] = (),
    files: Mapping[str, Path | None] | None = None,
    notes: Sequence[str] = (),
) -> Iterator[Work]:
    """Check the files of a command, and print notes and the warnings of its scenario.

    `names` are the files that the command writes into the folder of ``--out`` in addition to the
    scenario and the results; `files` are single files by option, None where the option is not
    given. Errors in the block that the code of a Python file raises become messages.
    """
    wanted = ("scenario.toml", "results.json", *names)
    with (
        own_code_errors(),
        output_of(options, wanted, files) as written,
        progress_bar(options.quiet) as begin,
    ):
        warnings = all_warnings(scenario)
        say_warnings(warnings, options.quiet, notes)
        yield Work(scenario, warnings, written, begin, perf_counter())


def b_plane_figures(scenario: Scenario, noises: Iterable[str]) -> list[str]:
    """Return the names of the figures of misses across the approach; none in a plane.

    There is one figure for each noise.
    """
    if not scenario.is_spatial:
        return []
    return [f"figure-b-plane-{noise}" for noise in noises]


def bound_name(scenario: Scenario) -> str:
    """Return the table heading of `guaranteed_miss_m`, which is no bound in the model `paper`."""
    if scenario.set_model.is_guaranteed:
        return "guaranteed miss, m"
    return "the paper's Phi (not a bound here), m"


def allowance(scenario: Scenario) -> str | None:
    """Return a line with the assumptions of the guaranteed model; None for the model `paper`."""
    model = on_board_model(scenario)
    if not model.is_guaranteed:
        return None

    accelerations = []
    for axis in model.axes:
        along = model.axis(axis)
        accelerations.append(
            f"acceleration along {axis} at most {along.acceleration_m_s2:.5g} m/s^2 (manoeuvres "
            f"{along.disturbance_m_s2:g} and gravity {along.gravity_m_s2:.2g}, divided by 1 - "
            f"{along.speed_error:.4f})"
        )

    line = (
        f"the guaranteed model assumes: {', '.join(accelerations)}; relative error of the closing "
        f"speed at most {model.speed_error:.2%}, of impulses at most "
        f"{model.execution_error_relative:.2%}"
    )
    if model.pointing_error_rad:
        line += f", error of their direction at most {model.pointing_error_rad:g} rad"
    if model.wrong_images:
        line += f"; at most {some_wrong_images(scenario.information_set.wrong_images)} in a flight"
    if scenario.range_sensor is not None and scenario.range_sensor.wrong_measurements:
        line += f"; at most {scenario.range_sensor.wrong_measurements} wrong ranges in a flight"
    return line


def certificate(sets: SetCounts, held: int, known: int) -> str:
    """Return a line about the sets of runs and their bounds Phi.

    Of the runs, `known` have a bound, and in `held` of these the miss is at most the bound.
    """
    if not known:
        return str(sets)
    line = f"{sets}; miss within the bound Phi: {held} of {some_runs(known)}"
    if known < sets.runs:
        line += f" ({sets.runs - known} without a bound)"
    return line


@dataclass(frozen=True)
class WorstMisses:
    """The engagements with the maximum values of a strategy.

    `set_kept` is the worst engagement whose set never became empty; None if there was none.
    `overall` is the worst of all, which can be `set_kept`; None if no miss was finite.
    `evaluations` is the number of engagements of one search or two, also if one found nothing.
    `sets_emptied` is the number of engagements whose set became empty, in the search with more.
    """

    set_kept: WorstEngagement | None
    overall: WorstEngagement | None
    evaluations: int = 0
    sets_emptied: int = 0

    @property
    def engagements(self) -> tuple[WorstEngagement, ...]:
        """The one or two different engagements."""
        both = [self.overall]
        if self.set_kept is not self.overall:
            both.insert(0, self.set_kept)
        return tuple(engagement for engagement in both if engagement is not None)

    def misses(self) -> dict[str, float | None]:
        """Return the values that the search maximised, m, by their JSON keys; None without one.

        The order is the order of the columns of `infoset bound`.
        """
        named = {"worst_of_search_set_kept_m": self.set_kept, "worst_of_search_m": self.overall}
        values: dict[str, float | None] = dict.fromkeys(named)
        for name, engagement in named.items():
            if engagement is not None:
                values[name] = engagement.value_m
        return values


def find_worst_misses(
    scenario: Scenario,
    own: Strategy | None,
    *,
    budget: int,
    seed: int,
    begin: BeginProgress,
    objective: Objective = Objective.FIXED_TRUTH,
) -> WorstMisses:
    """Search for the maximum miss with the set never empty, and of all engagements.

    Each search simulates `budget` engagements. The second one is simulated only if the set became
    empty in the first one; otherwise both results are the same. The default objective is the
    objective of `infoset bound`, which compares simulated misses.
    """

    def search(keep_set: bool, name: str) -> WorstEngagement | None:
        try:
            return find_worst(
                scenario,
                strategy=own,
                objective=objective,
                budget=budget,
                seed=seed,
                keep_set=keep_set,
                threads=os.cpu_count() or 1,
                progress=begin(f"worst against {strategy_name(scenario, own)}{name}"),
            )
        except NothingCountsError:
            return None

    set_kept = search(True, "")
    if set_kept is not None and set_kept.sets_emptied == 0:
        return WorstMisses(set_kept, set_kept, evaluations=budget)

    # The search with all engagements can find less than the first one.
    overall = search(False, ", empty sets included")
    found = [engagement for engagement in (overall, set_kept) if engagement is not None]
    worst = max(found, key=lambda engagement: engagement.value_m, default=None)
    return WorstMisses(
        set_kept,
        worst,
        evaluations=2 * budget,
        sets_emptied=max((engagement.sets_emptied for engagement in found), default=0),
    )
