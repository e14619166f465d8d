"""What the interception commands share: files, parallel simulation, searches, and lines about
results.
"""

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
from infoset.experiments.interception.study import SetCounts
from infoset.guidance import Strategy
from infoset.sim import Results, Scenario
from infoset.sim.adversary import NothingCountsError, Objective, WorstEngagement, find_worst
from infoset.sim.gravity import on_board_model
from infoset.sim.parallel import Task, is_finite, simulate_tasks
from infoset.sim.scenario import strategy_name
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions

Progress = Callable[[float], None]


def simulate_all(tasks: Sequence[Task]) -> list[Results]:
    """Return the results of tasks, which are simulated in parallel; `InputError` if they are not
    finite.
    """
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
    """What a running command has: its scenario with warnings, its files and its progress."""

    scenario: Scenario
    warnings: Sequence[str]
    written: Output
    begin: BeginProgress
    began_s: float

    def save(self, results: Mapping[str, object]) -> None:
        """Write the scenario, and results as JSON after the keys that all commands share."""
        self.written.save("scenario.toml", to_toml(self.scenario))
        head = {
            "versions": versions(),
            "scenario": self.scenario.name,
            "scenario_hash": fingerprint(self.scenario),
            **({"warnings": self.warnings} if self.warnings else {}),
            "model": self.scenario.information_set.model.value,
            "range_sensor": self.scenario.range_sensor is not None,
            "elapsed_s": perf_counter() - self.began_s,
        }
        self.written.save("results.json", to_json({**head, **results}), "--json")


@contextlib.contextmanager
def work_of(
    options: Any,
    scenario: Scenario,
    names: Sequence[str] = (),
    files: Mapping[str, Path | None] | None = None,
    notes: Sequence[str] = (),
) -> Iterator[Work]:
    """Check the files of a command, and print notes and the warnings of its scenario.

    `names` are those of files in the folder of ``--out`` after the scenario and the results;
    `files` are single files by option.
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
    """Return the names of the figures of misses across the approach, one for each noise; none in a
    plane.
    """
    return [f"figure-b-plane-{noise}" for noise in noises] if scenario.is_spatial else []


def bound_name(scenario: Scenario) -> str:
    """Return the table heading of `guaranteed_miss_m`, which is no bound in the model `paper`."""
    return (
        "guaranteed miss, m"
        if scenario.set_model.is_guaranteed
        else "the paper's Phi (not a bound here), m"
    )


def allowance(scenario: Scenario) -> str | None:
    """Return a line with the disturbances that the guaranteed model allows for; None for the model
    `paper`.
    """
    model = on_board_model(scenario)
    if not model.is_guaranteed:
        return None
    accelerations = ", ".join(
        f"acceleration along {axis} at most {along.acceleration_m_s2:.5g} m/s^2 (manoeuvres "
        f"{along.disturbance_m_s2:g} and gravity {along.gravity_m_s2:.2g}, divided by 1 - "
        f"{along.speed_error:.4f})"
        for axis, along in ((axis, model.axis(axis)) for axis in model.axes)
    )
    pointing = model.pointing_error_rad
    direction = f", error of their direction at most {pointing:g} rad" if pointing else ""
    return (
        f"the guaranteed model assumes: {accelerations}; relative error of the closing speed at "
        f"most {model.speed_error:.2%}, of impulses at most "
        f"{model.execution_error_relative:.2%}{direction}"
    )


def certificate(sets: SetCounts, held: int, known: int) -> str:
    """Return a line about the sets of runs, and of the runs with a bound Phi, how many are within
    it.
    """
    if not known:
        return str(sets)
    missing = f" ({sets.runs - known} without a bound)" if known < sets.runs else ""
    return f"{sets}; miss within the bound Phi: {held} of {some_runs(known)}{missing}"


@dataclass(frozen=True)
class WorstMisses:
    """The engagements with the maximum values of a strategy: of those whose set never became empty,
    and of all.

    The first is None if there was none, the second if no miss was finite.
    """

    set_kept: WorstEngagement | None
    overall: WorstEngagement | None

    @property
    def engagements(self) -> tuple[WorstEngagement, ...]:
        """The one or two different engagements."""
        both = (
            (self.set_kept, self.overall) if self.set_kept is not self.overall else (self.overall,)
        )
        return tuple(engagement for engagement in both if engagement is not None)

    def misses(self) -> dict[str, float | None]:
        """Return both values as JSON, m."""
        named = {"worst_of_search_set_kept_m": self.set_kept, "worst_of_search_m": self.overall}
        return {
            name: None if engagement is None else engagement.value_m
            for name, engagement in named.items()
        }


def find_worst_misses(
    scenario: Scenario,
    own: Strategy | None,
    *,
    budget: int,
    seed: int,
    begin: BeginProgress,
    objective: Objective = Objective.FIXED_TRUTH,
) -> WorstMisses:
    """Search for the maximum miss with the set never empty, and for the maximum miss of all
    engagements.

    The second search is simulated only if the set became empty in the first one. Otherwise both are
    the same. The default objective is that of `infoset bound`, which compares simulated misses.
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
        return WorstMisses(set_kept, set_kept)
    overall = search(False, ", empty sets included")
    found = [engagement for engagement in (overall, set_kept) if engagement is not None]
    return WorstMisses(
        set_kept, max(found, key=lambda engagement: engagement.value_m, default=None)
    )
