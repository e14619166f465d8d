"""A chunk of a campaign: consecutive runs of one scenario, flown by whoever has time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from guidance import NoiseKind, Strategy
from sim.results import Results, join
from sim.scenario import Scenario
from sim.simulate import simulate
from sim.versions import VersionError, calculating_versions, differences


@dataclass(frozen=True)
class Chunk:
    """Consecutive runs of one scenario.

    Parameters
    ----------
    index : int
        Its number in the campaign.
    cell : int
        Number of the scenario in a sweep; 0 in a campaign.
    scenario : Scenario
    first, runs : int
        Number of the first run, and how many follow from there.
    seed : int
    mixed : bool
        Whether even runs have random noise and odd ones game noise, in place of the scenario's.
    guarantee : bool
        Whether the guaranteed model keeps its guaranteed miss.
    strategy : Strategy or None
        None is the scenario's.
    versions : tuple of pairs of str
        What it must be flown with.
    """

    index: int
    cell: int
    scenario: Scenario
    first: int
    runs: int
    seed: int
    mixed: bool = False
    guarantee: bool = True
    strategy: Strategy | None = None
    versions: tuple[tuple[str, str], ...] = field(default_factory=calculating_versions)

    def noises(self, runs: NDArray[np.int64]) -> list[NoiseKind]:
        """Noise of each run."""
        if not self.mixed:
            return [self.scenario.noise] * len(runs)
        return [NoiseKind.GAME if odd else NoiseKind.RANDOM for odd in (runs % 2).tolist()]


def fly_chunk(chunk: Chunk, check: Callable[[], None] | None = None) -> Results:
    """Fly the runs of a chunk.

    Parameters
    ----------
    chunk : Chunk
    check : callable or None
        Is called now and then, and may raise to break off.

    Returns
    -------
    Results
        In the order of the runs: the same numbers whatever chunk a run is flown in, and wherever.

    Raises
    ------
    VersionError
        If the chunk is to be flown with other versions than those at hand.
    """
    differ = differences(chunk.versions, calculating_versions())
    if differ:
        raise VersionError("; ".join(differ))
    runs = np.arange(chunk.first, chunk.first + chunk.runs, dtype=np.int64)
    noises = chunk.noises(runs)
    parts = []
    for kind in dict.fromkeys(noises):
        own = runs[np.array([noise is kind for noise in noises])]
        parts.append(
            simulate(
                replace(chunk.scenario, noise=kind),
                own.tolist(),
                seed=chunk.seed,
                strategy=chunk.strategy,
                guarantee=chunk.guarantee,
                progress=None if check is None else lambda _: check(),
            )
        )
    joined = join(parts)
    return joined.take(np.argsort(joined.runs))
