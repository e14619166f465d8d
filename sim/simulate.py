"""Fly many engagements of one scenario."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from guidance import Strategy
from infoset.limits import WHOLE, shown
from sim.draws import draw
from sim.engagement import Engagements
from sim.results import Results, join
from sim.scenario import Scenario

ENGAGEMENTS_AT_ONCE = 200
SECTIONS_AT_ONCE = 6000


def simulate(
    scenario: Scenario,
    runs: int | Sequence[int] = 50,
    *,
    seed: int = 0,
    strategy: Strategy | None = None,
    guarantee: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Results:
    """Fly engagements whose starts and measurement errors are drawn at random.

    Parameters
    ----------
    scenario : Scenario
        The numbers of the engagement, noise and range meter included.
    runs : int or sequence of int
        How many, or which: run k of a seed is the same engagement in whatever company it is flown.
    seed : int
        The root seed.
    strategy : Strategy or None
        A strategy of your own; None is the scenario's.
    guarantee : bool
        Whether the guaranteed model keeps its guaranteed miss, which takes about as long as all the rest.
    progress : callable or None
        Is told the fraction done, from 0 to 1.

    Returns
    -------
    Results
        In the order of `runs`.

    Raises
    ------
    TypeError, ValueError
        If there is no run to fly, a number of a run or the seed is negative or no integer, or the strategy returns no
        proper impulses.
    """
    WHOLE.need("seed", seed)
    numbers = np.asarray(runs)
    if isinstance(runs, bool) or numbers.ndim > 1 or (numbers.dtype.kind not in "iu" and numbers.size):
        raise TypeError(f"runs must be how many runs, or a sequence of run numbers, all integers: got {shown(runs)}")
    numbers = np.arange(int(numbers)) if numbers.ndim == 0 else numbers.astype(np.int64)
    if numbers.size == 0 or numbers.min() < 0:
        raise ValueError(f"need at least one run, and run numbers not negative: got runs={runs}")
    parts = []
    # Few enough at once to stay in the processor's cache, and in memory when sections are very many.
    at_once = max(1, min(ENGAGEMENTS_AT_ONCE, SECTIONS_AT_ONCE // scenario.set_model.sections))
    for first in range(0, numbers.size, at_once):
        chunk = numbers[first : first + at_once]
        draws = draw(scenario, chunk.tolist(), seed)
        flight = Engagements(scenario, draws, strategy, guarantee=guarantee)
        steps = draws.steps
        while flight.flying:
            flight.advance()
            if progress is not None:
                progress((first + chunk.size * min(1.0, flight.step / steps)) / numbers.size)
        parts.append(flight.results(chunk))
        if progress is not None:
            progress((first + chunk.size) / numbers.size)
    return join(parts)
