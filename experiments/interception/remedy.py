"""Remedies of misses: the least change of one key at which no run misses for a cause, with the same random numbers."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from experiments.common.input_file import changed
from experiments.common.screen import some_runs
from experiments.interception.runs.shared import Progress, simulate_all
from experiments.interception.study import percent
from sim import HitEstimate, MissCause, Results, Scenario
from sim.parallel import Task
from sim.results import join

IMPULSE, BUDGET, CUT_OFF = "thruster.max_impulse_m_s", "thruster.budget_m_s", "thruster.last_impulse_s"
PIXEL, SCALE = "camera.pixel_error_rad", "angle_sensor.scale"
KEYS = {
    MissCause.ENGINE: (IMPULSE, CUT_OFF),
    MissCause.BUDGET: (BUDGET,),
    MissCause.KNOWLEDGE: (PIXEL, SCALE, CUT_OFF),
    MissCause.SATURATED: (IMPULSE, PIXEL, SCALE),
    MissCause.GUIDANCE: (),
}
MAX_DOUBLINGS = 10
NEAR = 1.02
"""Ratio of a value that is enough and one that is not, at which the search ends."""


@dataclass(frozen=True)
class Remedy:
    """Values of a key at which runs still miss for a cause, and at which none does.

    Parameters
    ----------
    now : float
        Value of the scenario; 1 of `angle_sensor.scale`, a factor of all error bounds.
    not_enough : float or None
        Nearest value found at which the cause occurs; None if `enough` follows in closed form.
    enough : float or None
        Value nearest to `now`, of three digits, at which it does not; None if no value up to `not_enough` is enough.
    hits : HitEstimate or None
        All runs with `enough`.
    missed : mapping of str to int
        Number of misses of all runs with `enough`, by cause.
    """

    cause: MissCause
    key: str
    now: float
    not_enough: float | None
    enough: float | None
    hits: HitEstimate | None = None
    missed: Mapping[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        head = f"remedy for {self.cause.value}:"
        if self.enough is None:
            return f"{head} no {self.key} from {self.now:g} to {self.not_enough:g}"
        limit = "in closed form" if self.not_enough is None else f"{self.not_enough:g} is not enough"
        then = ""
        if self.hits is not None:
            interval = f"95 % CI {percent(self.hits.lower)} to {percent(self.hits.upper)}"
            then = f"; then {self.hits.hits} of {some_runs(self.hits.runs)} hit ({interval})"
        if self.missed:
            then += f", missed by {', '.join(f'{name} {count}' for name, count in self.missed.items())}"
        return f"{head} {self.key} = {self.enough:g} instead of {self.now:g} ({limit}){then}"


def find_remedies(task: Task, results: Results, progress: Progress) -> list[Remedy]:
    """Return the remedies of all causes in the results of a task, for the keys that its scenario has.

    A maximum impulse for the cause `engine` follows in closed form, because its authority is proportional to it. The
    other values are found by bisection: the runs that miss for the cause are simulated again with each value.
    """
    wanted = [(cause, key) for cause in MissCause if cause in results.causes for key in KEYS[cause]]
    wanted = [(cause, key) for cause, key in wanted if _present(task.scenario, key)]
    remedies = []
    for index, (cause, key) in enumerate(wanted):
        remedies.append(_remedy(task, results, cause, key))
        progress((index + 1) / len(wanted))
    return remedies


def _remedy(task: Task, results: Results, cause: MissCause, key: str) -> Remedy:
    def simulated(value: float, runs: Sequence[int]) -> Results:
        scenario = _with(task.scenario, key, value)
        parts = [runs[first :: os.cpu_count() or 1] for first in range(min(len(runs), os.cpu_count() or 1))]
        each = replace(task, scenario=scenario, guarantee=False, progress=None, observe=None)
        return join(simulate_all([replace(each, runs=part) for part in parts]))

    now, missed = _present(task.scenario, key), np.array([each is cause for each in results.causes])
    not_enough: float | None = None
    if (cause, key) == (MissCause.ENGINE, IMPULSE):
        beyond_m = results.unguided_miss_m[missed] - (task.scenario.radius_m or 0.0)
        # 1.005 rounds up.
        enough = _rounded(1.005 * now * float(np.max(beyond_m / results.engine_corrects_m[missed])))
    else:
        runs, sign = results.runs[missed].tolist(), 1 if key in (IMPULSE, BUDGET) else -1
        not_enough, found = _search(lambda value: cause in simulated(value, runs).causes, now, sign)
        if found is None:
            return Remedy(cause, key, now, not_enough, None)
        enough = found
    then = simulated(enough, task.runs)
    left = {name: count for name, count in then.missed.items() if count and not name.endswith("_m")}
    return Remedy(cause, key, now, not_enough, enough, then.hits, left)


def _search(occurs: Callable[[float], bool], now: float, sign: int) -> tuple[float, float | None]:
    """Return the nearest values found at which something occurs and does not, above or below `now`."""
    not_enough = now
    for _ in range(MAX_DOUBLINGS):
        enough = _rounded(not_enough * 2.0**sign)
        if not occurs(enough):
            break
        not_enough = enough
    else:
        return not_enough, None
    while max(enough, not_enough) > NEAR * min(enough, not_enough):
        middle = _rounded(math.sqrt(enough * not_enough))
        if occurs(middle):
            not_enough = middle
        else:
            enough = middle
    return not_enough, enough


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _errors(scenario: Scenario) -> Iterator[tuple[str, float]]:
    """Yield the keys and values of the error bounds of an angle sensor that is not a camera."""
    for name, value in vars(scenario.angle_sensor).items() if scenario.angle_sensor is not None else ():
        if "error" in name and isinstance(value, float):
            yield f"angle_sensor.{name}", value


def _present(scenario: Scenario, key: str) -> float:
    """Return the value of a key; zero if the scenario does not have it."""
    if key == SCALE:
        return 1.0 if any(_errors(scenario)) else 0.0
    table, name = key.split(".")
    return getattr(getattr(scenario, table), name, None) or 0.0


def _with(scenario: Scenario, key: str, value: float) -> Scenario:
    changes = {name: value * error for name, error in _errors(scenario)} if key == SCALE else {key: value}
    return changed(scenario, changes, f"{scenario.name} with {key} = {value:g}")
