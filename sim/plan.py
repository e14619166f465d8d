"""What a campaign or a sweep flies, cut into chunks: decided before the first engagement, whoever flies them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from guidance import NoiseKind, Strategy
from infoset.limits import INTEGER
from sim.chunk import Chunk
from sim.scenario import Scenario
from sim.simulate import ENGAGEMENTS_AT_ONCE

FEWEST_CHUNKS = 256
LARGEST_CHUNK = 4096


class CampaignNoise(Enum):
    """Measurement noise of a campaign; MIXED is random in even runs and game in odd ones."""

    RANDOM = "random"
    GAME = "game"
    MIXED = "mixed"


@dataclass(frozen=True)
class Plan:
    """The engagements of some cells, each of the same runs, and how they are cut into chunks.

    Parameters
    ----------
    scenarios : tuple of Scenario
        One a cell; a campaign has a single cell. Their own noise does not count.
    runs : int
        Engagements a cell, from run 0.
    chunk : int
        Engagements a chunk; the last of a cell may be smaller. It changes no number.
    seed : int
    noise : CampaignNoise
    guarantee : bool
        Whether the guaranteed model keeps its guaranteed miss.
    strategy : Strategy or None
        A strategy of one's own; None is the scenarios'.

    Raises
    ------
    TypeError, ValueError
        If the numbers make no campaign.
    """

    scenarios: tuple[Scenario, ...]
    runs: int
    chunk: int
    seed: int
    noise: CampaignNoise
    guarantee: bool
    strategy: Strategy | None = None

    def __post_init__(self) -> None:
        for name in ("runs", "chunk", "seed"):
            INTEGER.need(name, getattr(self, name))
        if not self.scenarios or self.runs < 1 or self.chunk < 1 or self.seed < 0:
            raise ValueError(
                "a campaign needs a scenario, at least one run, chunks of at least one and a seed not negative: got "
                f"{len(self.scenarios)} scenarios, runs={self.runs}, chunk={self.chunk}, seed={self.seed}"
            )

    @property
    def engagements(self) -> int:
        """All of them, over all cells."""
        return self.runs * len(self.scenarios)

    @property
    def chunks_a_cell(self) -> int:
        """How many chunks the runs of a cell make."""
        return -(-self.runs // self.chunk)

    @property
    def chunks(self) -> int:
        """How many chunks there are; they are numbered from 0, cell by cell."""
        return self.chunks_a_cell * len(self.scenarios)

    def size(self, index: int) -> int:
        """Engagements of a chunk."""
        first = index % self.chunks_a_cell * self.chunk
        return min(self.chunk, self.runs - first)

    def chunk_at(self, index: int) -> Chunk:
        """The chunk of a number."""
        cell, place = divmod(index, self.chunks_a_cell)
        return Chunk(
            index=index,
            cell=cell,
            scenario=with_noise(self.scenarios[cell], self.noise),
            first=place * self.chunk,
            runs=self.size(index),
            seed=self.seed,
            mixed=self.noise is CampaignNoise.MIXED,
            guarantee=self.guarantee,
            strategy=self.strategy,
        )


def with_noise(scenario: Scenario, noise: CampaignNoise) -> Scenario:
    """Return a scenario under a campaign's noise; as it is where that is mixed."""
    return scenario if noise is CampaignNoise.MIXED else replace(scenario, noise=NoiseKind(noise.value))


def chunk_size(runs: int) -> int:
    """Return the chunk that suits a number of runs: a few hundred chunks, each of some batches of the engine.

    Notes
    -----
    A process that dies loses the chunks under way, so they are small; each is a file, so there are not too many.
    """
    batches = -(-runs // (FEWEST_CHUNKS * ENGAGEMENTS_AT_ONCE))
    return max(1, min(batches, LARGEST_CHUNK // ENGAGEMENTS_AT_ONCE)) * ENGAGEMENTS_AT_ONCE
