"""Remedies of misses: the least change of one key at which no run misses for a cause.

All values are examined with the same random numbers.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from infoset.experiments.common.input_file import changed
from infoset.experiments.interception.runs.shared import Progress, simulate_all
from infoset.experiments.interception.study import percent
from infoset.limits import MAXIMUM
from infoset.sim import HitEstimate, MissCause, Results, Scenario
from infoset.sim.parallel import Task
from infoset.sim.results import join

IMPULSE = "thruster.max_impulse_m_s"
BUDGET = "thruster.budget_m_s"
CUT_OFF = "thruster.last_impulse_s"
PIXEL = "camera.pixel_error_rad"
SCALE = "angle_sensor.scale"
KEYS = {
    MissCause.ENGINE: (IMPULSE, CUT_OFF),
    MissCause.BUDGET: (BUDGET,),
    MissCause.KNOWLEDGE: (PIXEL, SCALE, CUT_OFF),
    MissCause.SATURATED: (IMPULSE, PIXEL, SCALE),
    MissCause.GUIDANCE: (),
}
"""Keys whose change can remove a cause; another strategy is not a key."""
MAX_DOUBLINGS = 10
"""Maximum number of doublings, or halvings, of a value: a factor of 1024 is another mission."""
NEAR = 1.02
"""Ratio of a value that is enough and one that is not, at which the search ends.

Values have three digits, so neighbours can differ by 1 %.
"""


@dataclass(frozen=True)
class Remedy:
    """Values of a key at which runs still miss for a cause, and at which none does.

    Parameters
    ----------
    now : float
        Value of the scenario; 1 of `angle_sensor.scale`, a factor of all error bounds.
    not_enough : float or None
        Value farthest from `now` found at which the cause occurs; None if `enough` follows in
        closed form.
    enough : float or None
        Value nearest to `now` found, of three digits, at which it does not; its ratio to
        `not_enough` is at most `NEAR`. None if no value up to `not_enough` is enough.
    hits : HitEstimate or None
        Hits of as many other runs with `enough`. The value was chosen for the first ones, so their
        share of hits is biased.
    missed : mapping of str to int
        Misses of these other runs by cause.
    """

    cause: MissCause
    key: str
    now: float
    not_enough: float | None
    enough: float | None
    hits: HitEstimate | None = None
    missed: Mapping[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        head = f"remedy for {self.cause.value}: "
        if self.enough is None or self.hits is None:
            return f"{head}no {self.key} from {self.now:g} to {self.not_enough:g}"

        limit = "in closed form"
        if self.not_enough is not None:
            limit = f"{self.not_enough:g} is not enough"
        text = (
            f"{head}{self.key} = {self.enough:g} instead of {self.now:g} ({limit}); then "
            f"{self.hits.hits} of {self.hits.runs} other runs hit (95 % CI "
            f"{percent(self.hits.lower)} to {percent(self.hits.upper)})"
        )
        if self.missed:
            others = ", ".join(f"{name} {count}" for name, count in self.missed.items())
            text += f", missed by {others}"
        return text


def find_remedies(task: Task, results: Results, progress: Progress) -> list[Remedy]:
    """Return the remedies of all causes in the results of a task.

    Keys that its scenario does not have are left out. A maximum impulse for the cause `engine`
    follows in closed form, because the miss that the engine corrects is proportional to it. The
    other values are found by bisection: all runs are simulated again with each value.
    """
    wanted = [
        (cause, key)
        for cause in MissCause
        if cause in results.causes
        for key in KEYS[cause]
        if _values(task.scenario, key)
    ]
    remedies = []
    for cause, key in wanted:
        remedies.append(_remedy(task, results, cause, key))
        progress(len(remedies) / len(wanted))
    return remedies


def _remedy(task: Task, results: Results, cause: MissCause, key: str) -> Remedy:
    """Return the least change of a key without a cause, and the hits of other runs with it."""
    scenario = task.scenario
    cores = os.cpu_count() or 1
    values = _values(scenario, key)
    now = 1.0 if key == SCALE else values[key]

    @functools.cache
    def simulated(value: float, runs: Sequence[int] = task.runs) -> Results:
        changes = {name: old * value / now for name, old in values.items()}
        flown = changed(scenario, changes, f"{scenario.name} with {key} = {value:g}")
        # Neither Phi nor courses are needed, and `find_remedies` reports the progress.
        flight = replace(task, scenario=flown, guarantee=False, progress=None, observe=None)
        # One task for each core: a task is simulated by one thread.
        parts = [runs[first::cores] for first in range(min(len(runs), cores))]
        return join(simulate_all([replace(flight, runs=part) for part in parts]))

    not_enough = None
    enough: float | None
    if (cause, key) == (MissCause.ENGINE, IMPULSE):
        needed = (
            results.unguided_miss_m - (scenario.outer_radius_m or 0.0)
        ) / results.engine_corrects_m
        # The factor 1.005 is greater than the rounding to three digits: the value is no smaller.
        enough = _rounded(1.005 * now * float(needed.max()))
    else:
        # A greater impulse or budget can be a remedy: these are doubled. Of the errors and of the
        # time of the last impulse before the arrival smaller values can be: these are halved.
        factor = 2.0 if key in (IMPULSE, BUDGET) else 0.5
        not_enough, enough = _search(lambda value: cause in simulated(value).causes, now, factor)
        if enough is None:
            return Remedy(cause, key, now, not_enough, None)

    # The value was chosen for the runs of the task: other runs show its hits.
    next_run = max(task.runs) + 1
    then = simulated(enough, range(next_run, next_run + len(task.runs)))
    left = {name: count for name, count in then.missed.items() if count and not name.endswith("_m")}
    return Remedy(cause, key, now, not_enough, enough, then.hits, left)


def _values(scenario: Scenario, key: str) -> dict[str, float]:
    """Return the values that a key changes in proportion, by their keys.

    There are none if the scenario does not have the key, or it is 0: a factor does not change it.
    """
    table, name = key.split(".")
    part = getattr(scenario, table)
    if part is None:
        return {}
    owner = vars(part)
    names = [name]
    if key == SCALE:
        names = [each for each in owner if "error" in each]
    # A maximum impulse of `MAXIMUM` is not set: it follows from the thrust and the step.
    return {
        f"{table}.{each}": owner[each]
        for each in names
        if owner.get(each) not in (None, 0.0, MAXIMUM)
    }


def _search(
    occurs: Callable[[float], bool], now: float, factor: float
) -> tuple[float, float | None]:
    """Return the nearest values found at which something occurs and does not, from `now` on.

    It occurs at `now`. The second value is None if it occurs at all values up to the first.
    """
    not_enough = now
    for _ in range(MAX_DOUBLINGS):
        enough = _rounded(not_enough * factor)
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
