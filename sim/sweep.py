"""Sweeps: the same runs of a scenario in which a few values vary, every value with every other."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from sim.campaign import CampaignResult, chunk_of
from sim.fingerprint import scenario_hash
from sim.plan import CampaignNoise, Plan, with_noise
from sim.scenario import Scenario, strategy_name
from sim.storage import Axis, CampaignFolder, Manifest
from sim.stored_flight import Progress, fly_into
from sim.versions import calculating_versions


@dataclass(frozen=True)
class Sweep:
    """The same runs in each of many cells: starts and errors are shared, so that cells differ by their values alone.

    Parameters
    ----------
    scenario : Scenario
        The one that is varied.
    axes : tuple of Axis
        What is varied, for people: names and values as in a scenario file.
    cells : tuple of Scenario
        One for each combination of the values; the last axis varies fastest.
    runs : int
        Engagements a cell.
    folder : str or Path
    seed : int
    noise : CampaignNoise or None
        None is the scenario's.
    guarantee : bool
        Whether the guaranteed model keeps its guaranteed miss, which costs time.
    chunk : int or None
        Engagements a shard; None suits the number of runs.

    Raises
    ------
    ValueError
        If there is no axis, or not a scenario for each combination of values.
    """

    scenario: Scenario
    axes: tuple[Axis, ...]
    cells: tuple[Scenario, ...]
    runs: int
    folder: str | Path
    seed: int = 0
    noise: CampaignNoise | None = None
    guarantee: bool = False
    chunk: int | None = None

    def __post_init__(self) -> None:
        if not self.axes or len(self.cells) != math.prod(len(axis.values) for axis in self.axes):
            raise ValueError("a sweep needs at least one axis, and a scenario for each combination of their values")

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
            As of a campaign; None is threads of this process.
        workers : int or None
        resume : bool
            Whether to go on with the sweep that the folder holds.
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
            If the folder holds something else or cannot be written, or pyarrow is not installed.
        ValueError
            If the numbers make no sweep.
        FloatingPointError
            If its results are not finite.
        """
        plan = self.plan()
        with CampaignFolder.begin(Path(self.folder), self.manifest(), resume=resume, beside=beside) as folder:
            damaged = tuple(folder.damaged)
            fly_into(folder, plan, executor=executor, workers=workers, progress=progress)
        return CampaignResult(folder, damaged)

    def plan(self) -> Plan:
        """Return what is flown, and how it is cut into chunks."""
        return Plan(self.cells, self.runs, self._chunk, self.seed, self._noise, self.guarantee)

    def manifest(self) -> Manifest:
        """Return what is written of the sweep beside its shards."""
        hashes = ",".join(scenario_hash(with_noise(cell, self._noise)) for cell in self.cells)
        return Manifest(
            scenario=with_noise(self.scenario, self._noise),
            runs=self.runs,
            chunk=self._chunk,
            seed=self.seed,
            noise=self._noise.value,
            strategy=strategy_name(self.scenario, None),
            guarantee=self.guarantee,
            versions=dict(calculating_versions()),
            axes=self.axes,
            cells_hash=hashlib.sha256(hashes.encode()).hexdigest()[:32],
        )

    @property
    def _noise(self) -> CampaignNoise:
        return CampaignNoise(self.scenario.noise.value) if self.noise is None else self.noise

    @property
    def _chunk(self) -> int:
        return chunk_of(Path(self.folder), self.chunk, self.runs)
