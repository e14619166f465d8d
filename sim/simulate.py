"""Simulation of many engagements of one scenario."""

from __future__ import annotations

import inspect
import math
import warnings
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from infoset.arrays import Integers
from infoset.guidance import Strategy
from infoset.guidance.noise import NoiseSource
from infoset.limits import WHOLE, shown
from infoset.model import SetSettings
from infoset.sim.draws import draw, max_number_of_steps
from infoset.sim.engagement import Engagements, Step
from infoset.sim.results import GuaranteeWarning, Results, join
from infoset.sim.scenario import Scenario, with_noise, with_strategy

ENGAGEMENTS_AT_ONCE = 200
"""Maximum number of engagements of a batch: 25 % faster than 64 (docs/measured/performance.md);
larger ones gain little, and their sections leave the processor's cache.
"""
SECTIONS_AT_ONCE = 6000
"""Maximum number of sections of a batch: 200 engagements with 29 sections, which take 3.7 MB (L3
cache).
"""
STEPS_AT_ONCE = 500_000
"""Maximum number of engagements of a batch times their steps; each takes about 600 bytes."""
FLIGHT_SHARE = 0.75
"""Share of the steps in the time of a batch; afterwards margins and bounds are computed from the
whole history. Chosen; it affects the progress bar only.
"""


def simulate(
    scenario: Scenario,
    runs: int | Sequence[int] = 50,
    *,
    seed: int = 0,
    strategy: Strategy | str | None = None,
    noise: NoiseSource | str | None = None,
    guarantee: bool = True,
    progress: Callable[[float], None] | None = None,
    observe: Callable[[int, Step], None] | None = None,
) -> Results:
    """Simulate engagements whose starts and measurement errors are drawn at random.

    A `GuaranteeWarning` says in how many runs a guarantee failed, once in a call.

    Parameters
    ----------
    scenario : Scenario
        Scenario to simulate; `infoset.load_scenario` reads one.
    runs : int or sequence of int
        Number of runs, or the run numbers. Run k of a seed is the same engagement in every call.
    strategy : Strategy, str or None
        A strategy of your own, the name of a registered one, or None for the scenario's.
    noise : MeasurementNoise, callable, str or None
        A noise of your own, the name of a kind, or None for the scenario's. A class, or a function
        without arguments, is called once for each batch and returns its noise. An object is used
        for all batches, by several threads at the same time if there are threads.
    guarantee : bool
        Compute the bound Phi in the guaranteed model; a run takes 1.1 to 1.9 times as long, with a
        rate sensor 1.4 to 9 times.
    progress : callable or None
        Called with the fraction done, from 0 to 1.
    observe : callable or None
        Called at each step of each batch, with the index in `runs` of the batch's first run, and
        the step: `time_s`, `tracking`, `measured`, `predicted_miss`, `impulse_m_s` and
        `information` (the view of the set), among others.

    Returns
    -------
    Results
        In the order of `runs`.

    Raises
    ------
    TypeError, ValueError
        If there are no runs, a run number or the seed is not a whole number, the strategy or the
        noise is not registered, or one of your own returns values that are not allowed.
    """
    results = simulate_runs(
        scenario,
        runs,
        seed=seed,
        strategy=strategy,
        noise=noise,
        guarantee=guarantee,
        progress=progress,
        observe=observe,
    )
    warn_of_failures(scenario, results)
    return results


def warn_of_failures(scenario: Scenario, results: Results) -> None:
    """Give one warning of runs whose set failed or whose miss exceeds the bound Phi."""
    failures = results.failures
    if not failures:
        return
    if scenario.set_model.is_guaranteed:
        broken = broken_assumption(scenario.information_set)
        reason = f"an assumption of the model does not hold: {broken}"
    else:
        reason = (
            "the model paper does not promise to keep the true state; information_set.model = "
            "guaranteed does"
        )
    warnings.warn(
        f"{scenario.name}: {failures}: {reason}", GuaranteeWarning, stacklevel=_level_of_user()
    )


def broken_assumption(settings: SetSettings) -> str:
    """Return why a set of the guaranteed model can fail, as text."""
    reasons = (
        "the noise exceeds the bounds of the sensors, or the scenario exceeds those of the model; "
        "infoset scenarios check FILE examines it"
    )
    if not settings.wrong_images:
        return reasons
    return (
        "a flight has more wrong images than information_set.wrong_images, "
        f"{settings.wrong_images}, or {reasons}"
    )


def _level_of_user() -> int:
    """Return the `stacklevel` for `warnings.warn` in the calling function.

    The warning then names the line of the first caller outside the project.
    """
    frame = inspect.currentframe()
    level = 0
    while frame is not None and frame.f_globals.get("__name__", "").startswith("infoset."):
        frame = frame.f_back
        level += 1
    return level


def simulate_runs(
    scenario: Scenario,
    runs: int | Sequence[int],
    *,
    seed: int,
    strategy: Strategy | str | None = None,
    noise: NoiseSource | str | None = None,
    guarantee: bool = True,
    progress: Callable[[float], None] | None = None,
    observe: Callable[[int, Step], None] | None = None,
) -> Results:
    """Return the results of `simulate` without its warning: commands report failures themselves.

    Raises
    ------
    TypeError, ValueError
        As `simulate`.
    """
    WHOLE.need("seed", seed)
    scenario, own = with_strategy(scenario, strategy)
    scenario, own_noise = with_noise(scenario, noise)
    numbers = _run_numbers(runs)
    at_once = _engagements_at_once(scenario)
    parts = []
    for first in range(0, numbers.size, at_once):
        batch = numbers[first : first + at_once]
        draws = draw(scenario, batch.tolist(), seed)
        flight = Engagements(scenario, draws, own, noise=own_noise, guarantee=guarantee)

        observe_batch = None if observe is None else partial(observe, first)
        while flight.flying:
            flight.advance(observe_batch)
            if progress is not None:
                share = min(1.0, flight.step / draws.steps)
                progress((first + FLIGHT_SHARE * batch.size * share) / numbers.size)

        parts.append(flight.results(batch))
        if progress is not None:
            progress((first + batch.size) / numbers.size)
    return join(parts)


def _run_numbers(runs: int | Sequence[int]) -> Integers:
    """Return run numbers from their number or a sequence of them."""
    numbers = np.asarray(runs)
    # An empty sequence has the type float.
    is_integer = numbers.dtype.kind in "iu" or not numbers.size
    if isinstance(runs, bool) or numbers.ndim > 1 or not is_integer:
        raise TypeError(
            "runs must be the number of runs or a sequence of run numbers, all integers: got "
            f"{shown(runs)}"
        )
    numbers = np.arange(int(numbers)) if numbers.ndim == 0 else numbers.astype(np.int64)
    if numbers.size == 0 or numbers.min() < 0:
        raise ValueError(f"need at least one run, and no negative run numbers: got runs={runs}")
    return numbers


def _engagements_at_once(scenario: Scenario) -> int:
    """Return the number of engagements of a batch.

    The sections of a batch must fit into the processor's cache, its history into memory (500 000
    times 600 bytes are 300 MB).
    """
    model = scenario.set_model
    sets = math.comb(model.classes, model.wrong_images)
    by_sections = SECTIONS_AT_ONCE // (model.sections * sets)
    by_steps = STEPS_AT_ONCE // max_number_of_steps(scenario)
    return max(1, min(ENGAGEMENTS_AT_ONCE, by_sections, by_steps))
