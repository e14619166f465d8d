"""A chunk of a campaign: consecutive runs of one scenario, simulated together by one worker."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from guidance import NoiseKind, Strategy
from infoset.arrays import Integers
from sim.results import Results, join
from sim.scenario import Scenario
from sim.simulate import ENGAGEMENTS_AT_ONCE, simulate
from sim.versions import VersionError, calculating_versions, differences

FEWEST_CHUNKS = 256
MAX_CHUNK = 4096


class CampaignNoise(Enum):
    """Measurement noise of a campaign; MIXED is random in even runs and game in odd ones."""

    RANDOM = "random"
    GAME = "game"
    MIXED = "mixed"

    @property
    def kinds(self) -> tuple[NoiseKind, ...]:
        """Noises of run 0, 1, 2, ..., repeated."""
        return (NoiseKind.RANDOM, NoiseKind.GAME) if self is CampaignNoise.MIXED else (NoiseKind(self.value),)

    def applied_to(self, scenario: Scenario) -> Scenario:
        """Return a scenario with this noise; MIXED leaves it unchanged."""
        return scenario if self is CampaignNoise.MIXED else replace(scenario, noise=NoiseKind(self.value))


@dataclass(frozen=True)
class Chunk:
    """Consecutive runs of one scenario, whose noise is not used; a campaign has the cell 0.

    `versions` are those of the packages that must compute it.
    """

    index: int
    cell: int
    scenario: Scenario
    runs: range
    seed: int
    noise: CampaignNoise
    guarantee: bool = True
    strategy: Strategy | None = None
    versions: tuple[tuple[str, str], ...] = field(default_factory=calculating_versions)

    def noises(self, runs: Integers) -> list[NoiseKind]:
        """Noise of each run."""
        kinds = self.noise.kinds
        return [kinds[run % len(kinds)] for run in runs.tolist()]


def fly_chunk(chunk: Chunk, check: Callable[[], None] | None = None) -> Results:
    """Simulate the runs of a chunk and return the results in the order of the runs.

    The results of a run do not depend on the chunk, the worker or the machine. `check` is called after every step; an
    exception that it raises stops the simulation. A VersionError is raised if the chunk needs other versions of the
    packages.
    """
    differ = differences(chunk.versions, calculating_versions())
    if differ:
        raise VersionError("; ".join(differ))
    runs = np.array(chunk.runs, dtype=np.int64)
    noises = chunk.noises(runs)
    parts = [
        simulate(
            replace(chunk.scenario, noise=kind),
            [run for run, noise in zip(chunk.runs, noises, strict=True) if noise is kind],
            seed=chunk.seed,
            strategy=chunk.strategy,
            guarantee=chunk.guarantee,
            progress=None if check is None else lambda _: check(),
        )
        for kind in dict.fromkeys(noises)
    ]
    joined = join(parts)
    return joined.take(np.argsort(joined.runs))


def chunk_size(runs: int) -> int:
    """Return the default number of engagements of a chunk: one or more batches of the engine.

    Small chunks limit the work that is lost if a process stops. Large chunks limit the number of files.
    """
    batches = -(-runs // (FEWEST_CHUNKS * ENGAGEMENTS_AT_ONCE))
    return max(1, min(batches, MAX_CHUNK // ENGAGEMENTS_AT_ONCE)) * ENGAGEMENTS_AT_ONCE
