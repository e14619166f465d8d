"""Campaigns: any number of engagements, stored as they are flown. A campaign is a sweep of one cell."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from guidance import Strategy
from infoset.limits import COUNT, WHOLE
from sim.chunk import CampaignNoise, Chunk, chunk_size
from sim.flights import fly_on, fly_on_threads
from sim.scenario import Scenario, strategy_name
from sim.statistics import QuantileEstimate, estimate_quantiles
from sim.stopping_rule import StoppingRule, Watch
from sim.storage import (
    Axis,
    CampaignFolder,
    CampaignWriter,
    Damage,
    Manifest,
    StorageError,
    read_manifest,
    scenario_hash,
)
from sim.versions import calculating_versions


@dataclass(frozen=True)
class CampaignResult:
    """The stored runs of a campaign or a sweep.

    Parameters
    ----------
    folder : CampaignFolder
        Where they are.
    redone : tuple of Damage
        Shards that were damaged and have been flown again.
    """

    folder: CampaignFolder
    redone: tuple[Damage, ...] = ()

    @property
    def table(self) -> Any:
        """All rows as a pyarrow.Table, in the order of cells and runs; the metadata of its fields has the units."""
        return self.folder.table()

    @property
    def complete(self) -> bool:
        """Whether every engagement is stored."""
        return self.folder.complete

    def to_pandas(self) -> Any:
        """All rows as a pandas.DataFrame; pandas must be installed."""
        return self.table.to_pandas()

    def quantile(self, quantity: str, level: float) -> QuantileEstimate:
        """Return the quantile at a level in (0, 1) of a quantity, over all rows where it is known."""
        (estimate,) = estimate_quantiles(self.folder.numbers(quantity).compressed(), [level])
        return estimate

    def __len__(self) -> int:
        """Engagements stored."""
        return self.folder.finished_runs


@dataclass(frozen=True)
class Progress:
    """How far a campaign is.

    Parameters
    ----------
    done, total : int
        Engagements stored in all sessions, and all engagements.
    flown : int
        Engagements stored in this session.
    elapsed_s : float
        Since this session began.
    """

    done: int
    total: int
    flown: int
    elapsed_s: float


@dataclass(frozen=True)
class Campaign:
    """Many engagements of one scenario.

    Parameters
    ----------
    scenario : Scenario
        What is flown.
    runs : int
        How many, from run 0; with `until`: at most.
    folder : str or Path
        Where they are stored.
    seed : int
        Run K is the same engagement in every campaign and experiment with this seed.
    noise : CampaignNoise or None
        None is the scenario's.
    strategy : Strategy or None
        A strategy of your own; None is the scenario's. The manifest holds its attribute `version`, if it has one, else
        its name: a campaign is not resumed with another.
    guarantee : bool
        Whether the guaranteed model computes the guaranteed miss Phi, which doubles the run time.
    chunk : int or None
        Engagements of a shard; it changes no number. None chooses one that suits the number of runs.
    until : StoppingRule or None
        Stop earlier, at the end of a shard, once this is met.
    axes : tuple of Axis
        What a sweep varies, for people: names and values as in a scenario file.
    cells : tuple of Scenario
        Scenarios of a sweep, one for each combination of the values; the last axis varies fastest.

    Raises
    ------
    TypeError, ValueError
        If a number is out of its range, the axes and the cells do not fit together, or a sweep has a stopping rule.
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
    axes: tuple[Axis, ...] = ()
    cells: tuple[Scenario, ...] = ()

    def __post_init__(self) -> None:
        for name, limits in (("runs", COUNT), ("seed", WHOLE), ("chunk", COUNT)):
            if name != "chunk" or self.chunk is not None:
                limits.need(name, getattr(self, name))
        if len(self.cells) != (math.prod(len(axis.values) for axis in self.axes) if self.axes else 0):
            raise ValueError("a sweep needs at least one axis, and a scenario for each combination of their values")
        if self.axes and self.until is not None:
            raise ValueError("a sweep has no stopping rule: give until to a campaign")

    def run(
        self,
        executor: Executor | None = None,
        *,
        workers: int | None = None,
        resume: bool = False,
        progress: Callable[[Progress], None] | None = None,
        beside: Mapping[str, str] | None = None,
    ) -> CampaignResult:
        """Fly the engagements that are not stored yet.

        Parameters
        ----------
        executor : Executor or None
            Any of `concurrent.futures`, or one that behaves like it; processes must be spawned, not forked. None
            uses threads of this process.
        workers : int or None
            Number of threads, by default one a core; or chunks handed to the executor at a time, by default two a core.
        resume : bool
            Whether the folder may hold this campaign already. It may be given more runs than it had.
        progress : callable or None
            Called after each chunk.
        beside : mapping of str to str
            Names and contents of text files to write into the folder.

        Raises
        ------
        StorageError
            If the folder holds something else or cannot be written, or pyarrow is not installed. What is stored stays,
            and the campaign can be resumed.
        VersionError
            If the executor flies with other versions of the packages.
        ValueError
            If there is not at least one worker.
        FloatingPointError
            If results are not finite.
        """
        if workers is not None and workers < 1:
            raise ValueError(f"need at least one worker: got {workers}")
        with CampaignWriter.begin(Path(self.folder), self.manifest(), resume=resume, beside=beside) as folder:
            damaged = tuple(folder.damaged)
            folder.discard_damaged()
            self._fly_missing(folder, executor, workers, progress)
        return CampaignResult(folder, damaged)

    def manifest(self) -> Manifest:
        """Return what is stored of the campaign besides its runs; a campaign that is resumed keeps its chunks."""
        noise = self._noise
        hashes = ",".join(scenario_hash(noise.applied_to(cell)) for cell in self.cells)
        return Manifest(
            scenario=noise.applied_to(self.scenario),
            runs=self.runs,
            chunk=self._chunk_size(),
            seed=self.seed,
            noise=noise,
            strategy=getattr(self.strategy, "version", None) or strategy_name(self.scenario, self.strategy),
            guarantee=self.guarantee,
            versions=dict(calculating_versions()),
            axes=self.axes,
            cells_hash=hashlib.sha256(hashes.encode()).hexdigest()[:32] if self.cells else "",
            until=None if self.until is None else str(self.until),
        )

    def chunk_at(self, index: int, manifest: Manifest) -> Chunk:
        """Return the chunk that has the number `index` in the campaign's manifest."""
        cell, runs = manifest.runs_of(index)
        scenario = self._noise.applied_to((self.cells or (self.scenario,))[cell])
        return Chunk(index, cell, scenario, runs, self.seed, self._noise, self.guarantee, self.strategy)

    @property
    def kind(self) -> str:
        """`campaign` or `sweep`."""
        return "sweep" if self.axes else "campaign"

    @property
    def engagements(self) -> int:
        """Engagements of all cells."""
        return self.runs * max(1, len(self.cells))

    @property
    def _noise(self) -> CampaignNoise:
        return CampaignNoise(self.scenario.noise.value) if self.noise is None else self.noise

    def _chunk_size(self) -> int:
        """Return the engagements of a shard: as asked for, or of the campaign in the folder, or the default."""
        if self.chunk is not None:
            return self.chunk
        try:
            return read_manifest(Path(self.folder)).chunk
        except StorageError:
            return chunk_size(self.runs)

    def _fly_missing(
        self,
        folder: CampaignWriter,
        executor: Executor | None,
        workers: int | None,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        manifest, began_s = folder.manifest, time.perf_counter()
        stopped = self._stop_check(folder)
        if stopped():
            return
        missing = [index for index in range(manifest.chunks) if index not in folder.finished]
        done = self.engagements - sum(len(manifest.runs_of(index)[1]) for index in missing)
        flown = 0

        def report() -> None:
            if progress is not None:
                progress(Progress(done, self.engagements, flown, time.perf_counter() - began_s))

        report()
        chunks = (self.chunk_at(index, manifest) for index in missing)
        cores = os.cpu_count() or 1
        flights = (
            fly_on_threads(min(workers or cores, max(1, len(missing))), chunks)
            if executor is None
            else fly_on(executor, chunks, workers or 2 * cores)
        )
        with contextlib.closing(flights):
            for chunk, results in flights:
                folder.write(chunk, results)
                done, flown = done + len(chunk.runs), flown + len(chunk.runs)
                report()
                if stopped():
                    return

    def _stop_check(self, folder: CampaignWriter) -> Callable[[], bool]:
        """Return a function that stops the campaign in its folder, and returns True, once the rule is met."""
        rule, manifest = self.until, folder.manifest
        if rule is None:
            return lambda: False
        noises = [kind.value for kind in self._noise.kinds]
        watch = Watch(
            rule,
            len(noises),
            lambda index: folder.chunk_samples(index, rule.quantile.quantity, noises),
            manifest.chunks,
        )

        def stopped() -> bool:
            chunks = watch.met(folder.finished.__contains__)
            if chunks is not None:
                folder.stop_after(min(chunks * manifest.chunk, manifest.runs))
            return chunks is not None

        return stopped


class Sweep(Campaign):
    """The same runs in each of many cells: starts and errors are shared, so that cells differ by their values alone.

    Parameters
    ----------
    scenario : Scenario
        The one that is varied.
    axes : tuple of Axis
        As of `Campaign`, at least one.
    cells : tuple of Scenario
        As of `Campaign`.
    runs : int
        Engagements of each cell.
    folder, seed, noise, guarantee, chunk, strategy, until
        As of `Campaign`; the guaranteed miss is not computed by default.

    Raises
    ------
    TypeError, ValueError
        As of `Campaign`, or if there is no axis.
    """

    def __init__(
        self,
        scenario: Scenario,
        axes: tuple[Axis, ...],
        cells: tuple[Scenario, ...],
        runs: int,
        folder: str | Path,
        seed: int = 0,
        noise: CampaignNoise | None = None,
        guarantee: bool = False,
        chunk: int | None = None,
        strategy: Strategy | None = None,
        until: StoppingRule | None = None,
    ) -> None:
        if not axes:
            raise ValueError("a sweep needs at least one axis, and a scenario for each combination of their values")
        super().__init__(scenario, runs, folder, seed, noise, strategy, guarantee, chunk, until, axes, cells)
