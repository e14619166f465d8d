"""Campaigns: as many engagements as one likes of one scenario, stored as they are flown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from guidance import Strategy
from sim.plan import CampaignNoise, Plan, chunk_size, with_noise
from sim.scenario import Scenario, strategy_name
from sim.statistics import QuantileEstimate, estimate_quantiles
from sim.stopping_rule import StoppingRule
from sim.storage import CampaignFolder, Damage, Manifest, StorageError, read_manifest
from sim.stored_flight import Progress, fly_into
from sim.versions import calculating_versions


@dataclass(frozen=True)
class CampaignResult:
    """What a campaign or a sweep has stored so far.

    Parameters
    ----------
    folder : CampaignFolder
    redone : tuple of Damage
        Shards that were found damaged and were flown again.
    """

    folder: CampaignFolder
    redone: tuple[Damage, ...] = ()

    @property
    def table(self) -> Any:
        """All rows as a pyarrow.Table, in the order of the runs; units stand in the metadata of its fields."""
        return self.folder.table()

    @property
    def complete(self) -> bool:
        """Whether every engagement is stored."""
        return self.folder.complete

    def to_pandas(self) -> Any:
        """All rows as a pandas.DataFrame; pandas must be installed, and nothing else here needs it."""
        return self.table.to_pandas()

    def quantile(self, quantity: str, level: float) -> QuantileEstimate:
        """Return a quantile of a quantity over all rows where it is known.

        Parameters
        ----------
        quantity : str
            Name of a column of numbers.
        level : float
            In (0, 1).

        Returns
        -------
        QuantileEstimate
        """
        (found,) = estimate_quantiles(self.folder.numbers(quantity).compressed(), [level])
        return found

    def __len__(self) -> int:
        """Engagements stored."""
        return self.folder.finished_runs


@dataclass(frozen=True)
class Campaign:
    """Many engagements of one scenario.

    Parameters
    ----------
    scenario : Scenario
    runs : int
        How many, from run 0; with a rule that stops it earlier: at most.
    folder : str or Path
        Where they are stored.
    seed : int
        Run K is the same engagement in every campaign and experiment of the seed.
    noise : CampaignNoise or None
        None is the scenario's.
    strategy : Strategy or None
        A strategy of one's own; None is the scenario's. The manifest holds the name of its type only.
    guarantee : bool
        Whether the guaranteed model keeps its guaranteed miss, which costs time.
    chunk : int or None
        Engagements a shard; it changes no number. None suits the number of runs.
    until : StoppingRule or None
        Stop earlier, at the end of a shard, once this is met.
    """

    scenario: Scenario
    runs: int
    folder: str | Path
    seed: int = 0
    noise: CampaignNoise | None = None
    strategy: Strategy | None = None
    guarantee: bool = True
    chunk: int | None = None
    until: StoppingRule | None = None

    def run(
        self,
        executor: Executor | None = None,
        *,
        workers: int | None = None,
        resume: bool = False,
        progress: Callable[[Progress], None] | None = None,
        beside: Mapping[str, str] | None = None,
    ) -> CampaignResult:
        """Fly what is not stored yet.

        Parameters
        ----------
        executor : Executor or None
            Any of `concurrent.futures`, or one that behaves like it; processes must be spawned, not forked. None is
            threads of this process, a core each.
        workers : int or None
            How many threads, or how many chunks an executor of one's own is given at once.
        resume : bool
            Whether to go on with a campaign that the folder holds; an empty folder begins one. It may be given more
            runs than it had.
        progress : callable or None
            Is told how far it is, after each chunk.
        beside : mapping of str to str
            Text files to put into the folder too.

        Returns
        -------
        CampaignResult

        Raises
        ------
        StorageError
            If the folder holds something else or cannot be written, or pyarrow is not installed. Whatever is stored
            by then stays, and the campaign can be resumed.
        ValueError
            If the numbers make no campaign.
        FloatingPointError
            If its results are not finite.
        """
        plan = self.plan()
        with CampaignFolder.begin(Path(self.folder), self.manifest(), resume=resume, beside=beside) as folder:
            damaged = tuple(folder.damaged)
            fly_into(folder, plan, executor=executor, workers=workers, rule=self.until, progress=progress)
        return CampaignResult(folder, damaged)

    def plan(self) -> Plan:
        """Return what is flown, and how it is cut into chunks; a campaign that is resumed keeps its chunks."""
        return Plan((self._scenario,), self.runs, self._chunk, self.seed, self._noise, self.guarantee, self.strategy)

    def manifest(self) -> Manifest:
        """Return what is written of the campaign beside its shards."""
        return Manifest(
            scenario=self._scenario,
            runs=self.runs,
            chunk=self._chunk,
            seed=self.seed,
            noise=self._noise.value,
            strategy=strategy_name(self.scenario, self.strategy),
            guarantee=self.guarantee,
            versions=dict(calculating_versions()),
            until=None if self.until is None else str(self.until),
        )

    @property
    def _noise(self) -> CampaignNoise:
        return CampaignNoise(self.scenario.noise.value if self.noise is None else self.noise)

    @property
    def _scenario(self) -> Scenario:
        return with_noise(self.scenario, self._noise)

    @property
    def _chunk(self) -> int:
        return chunk_of(Path(self.folder), self.chunk, self.runs)


def chunk_of(folder: Path, chunk: int | None, runs: int) -> int:
    """Return the engagements a shard: as asked for, else as a campaign in the folder has them, else what suits.

    Parameters
    ----------
    folder : Path
    chunk : int or None
    runs : int

    Returns
    -------
    int
    """
    if chunk is not None:
        return chunk
    try:
        return read_manifest(folder).chunk
    except StorageError:
        return chunk_size(runs)
