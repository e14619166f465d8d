"""Campaigns: any number of engagements, stored during the simulation. A campaign is a sweep of one cell."""

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
from infoset.limits import COUNT, WHOLE, Limits
from sim.chunk import CampaignNoise, Chunk, chunk_size
from sim.flights import fly_on, fly_on_threads
from sim.requirement import AnyRequirement
from sim.scenario import Scenario, strategy_name
from sim.statistics import HitEstimate, QuantileEstimate, estimate_hits, estimate_quantiles
from sim.stopping_rule import StoppingRule, Watch
from sim.storage import (
    Axis,
    CampaignFolder,
    CampaignWriter,
    Damage,
    Manifest,
    StorageError,
    fingerprint,
    read_manifest,
)
from sim.undecided_cells import UndecidedCells
from sim.versions import calculating_versions

FEWEST_A_SHARD = 50
"""Minimum number of engagements per shard of a sweep."""


@dataclass(frozen=True)
class CampaignResult:
    """The stored runs of a campaign or a sweep.

    Parameters
    ----------
    redone : tuple of Damage
        Damaged shards whose runs were simulated again.
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

    @property
    def hits(self) -> HitEstimate | None:
        """Probability of a hit over all rows, with its confidence interval; None if the body has no size."""
        hit = self.folder.numbers("hit")
        return estimate_hits(int(hit.sum()), int(hit.count())) if hit.count() else None

    def __len__(self) -> int:
        """Engagements stored."""
        return self.folder.finished_runs


@dataclass(frozen=True)
class Progress:
    """Progress of a campaign.

    Parameters
    ----------
    done, total : int
        Engagements stored in all sessions, and all engagements.
    flown, elapsed_s : int and float
        Engagements stored in this session, and the time since its start.
    undecided : int or None
        Cells that need more runs to decide a requirement; None without one. `total` is then an upper bound.
    """

    done: int
    total: int
    flown: int
    elapsed_s: float
    undecided: int | None = None


@dataclass(frozen=True)
class Campaign:
    """Many engagements of one scenario.

    Parameters
    ----------
    runs : int
        Number of runs, from run 0; with `until` the maximum number.
    seed : int
        Run K is the same engagement in every campaign and experiment with this seed.
    noise : CampaignNoise or None
        Measurement noise; None is the scenario's.
    strategy : Strategy or None
        A strategy of your own; None is the scenario's. The manifest contains its attribute `version`, or its name
        without this attribute; a campaign cannot be resumed with another strategy.
    guarantee : bool
        Whether the guaranteed model computes the guaranteed miss Phi, which doubles the run time.
    chunk : int or None
        Engagements per shard; results do not depend on it. None chooses a value for the number of runs.
    until : StoppingRule, Requirement, HitRequirement or None
        A campaign stops at the end of a shard once this rule is met; a cell of a sweep, once this requirement is
        decided.
    axes : tuple of Axis
        Keys and values that a sweep varies, as in a scenario file; stored as a description.
    cells : tuple of Scenario
        Scenarios of a sweep, one for each combination of the values; the last axis varies fastest.
    max_runs : int or None
        Maximum number of runs of a cell with a requirement in `until`; `runs` is then the minimum. None is `runs`.
    require : Requirement, HitRequirement or None
        Requirement of a sweep for its reports; stored as a description. None is that of `until`.

    Raises
    ------
    TypeError, ValueError
        If a number is out of its range, the noise is not a `CampaignNoise`, the axes and the cells do not fit together,
        or `until` does not fit.
    """

    scenario: Scenario
    runs: int
    folder: str | Path
    seed: int = 0
    noise: CampaignNoise | None = None
    strategy: Strategy | None = None
    guarantee: bool = True
    chunk: int | None = None
    until: StoppingRule | AnyRequirement | None = None
    axes: tuple[Axis, ...] = ()
    cells: tuple[Scenario, ...] = ()
    max_runs: int | None = None
    require: AnyRequirement | None = None

    def __post_init__(self) -> None:
        for name, limits in (("runs", COUNT), ("seed", WHOLE), ("chunk", COUNT)):
            if name != "chunk" or self.chunk is not None:
                limits.need(name, getattr(self, name))
        if self.noise is not None and not isinstance(self.noise, CampaignNoise):
            choices = ", ".join(map(str, CampaignNoise))
            raise TypeError(f"noise must be None or one of {choices}: got {self.noise!r}")
        if len(self.cells) != (math.prod(len(axis.values) for axis in self.axes) if self.axes else 0):
            raise ValueError("a sweep needs at least one axis, and a scenario for each combination of their values")
        if self.until is not None and isinstance(self.until, AnyRequirement) != bool(self.axes):
            raise ValueError("until must be a stopping rule of a campaign, or a requirement of a sweep")
        if self.max_runs is not None:
            Limits(minimum=self.runs, whole=True).need("max_runs", self.max_runs)

    def run(
        self,
        executor: Executor | None = None,
        *,
        workers: int | None = None,
        resume: bool = False,
        progress: Callable[[Progress], None] | None = None,
        beside: Mapping[str, str] | None = None,
    ) -> CampaignResult:
        """Simulate the engagements that are not stored yet.

        Parameters
        ----------
        executor : Executor or None
            An executor of `concurrent.futures`, or one with the same interface; processes must be spawned, not forked.
            None uses threads of this process.
        workers : int or None
            Number of threads, by default one per core; with an executor, the number of chunks that are submitted at a
            time, by default two per core.
        resume : bool
            Whether the folder may contain this campaign already. The number of runs may be greater than before.
        progress : callable or None
            Called after each chunk.
        beside : mapping of str to str
            Names and contents of text files to write into the folder.

        Raises
        ------
        StorageError
            If the folder contains something else or cannot be written, or pyarrow is not installed. Stored runs are
            kept, and the campaign can be resumed.
        VersionError
            If the workers of the executor have other versions of the packages.
        ValueError, FloatingPointError
            If there is no worker, or results are not finite.
        """
        if workers is not None and workers < 1:
            raise ValueError(f"need at least one worker: got {workers}")
        with CampaignWriter.begin(Path(self.folder), self.manifest(), resume=resume, beside=beside) as folder:
            damaged = folder.discard_damaged()
            self._fly_missing(folder, executor, workers, progress)
        return CampaignResult(folder, damaged)

    def manifest(self) -> Manifest:
        """Return the manifest of the campaign; a resumed campaign keeps the size of its chunks."""
        noise, stored = self._noise, self._stored()
        required = self.until if self.require is None and isinstance(self.until, AnyRequirement) else self.require
        hashes = ",".join(fingerprint(noise.applied_to(cell)) for cell in self.cells)
        return Manifest(
            scenario=noise.applied_to(self.scenario),
            runs=self.cell_runs,
            chunk=self.chunk or (self._default_chunk() if stored is None else stored.chunk),
            seed=self.seed,
            noise=noise,
            strategy=self._strategy_name,
            guarantee=self.guarantee,
            versions=dict(calculating_versions()),
            axes=self.axes,
            cells_hash=hashlib.sha256(hashes.encode()).hexdigest()[:32] if self.cells else "",
            until=None if self.until is None else str(self.until),
            require=None if required is None else str(required),
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
        """Engagements of all cells, at most."""
        return self.cell_runs * max(1, len(self.cells))

    @property
    def cell_runs(self) -> int:
        """Maximum number of runs of a cell."""
        return self.runs if self.max_runs is None else self.max_runs

    @property
    def _noise(self) -> CampaignNoise:
        return CampaignNoise(self.scenario.noise.value) if self.noise is None else self.noise

    @property
    def _strategy_name(self) -> str:
        return getattr(self.strategy, "version", None) or strategy_name(self.scenario, self.strategy)

    def _stored(self) -> Manifest | None:
        """Return the manifest in the folder, if there is one."""
        try:
            return read_manifest(Path(self.folder))
        except StorageError:
            return None

    def _default_chunk(self) -> int:
        """Return the engagements per shard; small for cells with few runs, because they may be extended later."""
        size = chunk_size(self.cell_runs)
        return min(size, max(self.runs, FEWEST_A_SHARD)) if self.axes else size

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
        cells = None
        if isinstance(self.until, AnyRequirement):
            cells = UndecidedCells(folder, self.until, [kind.value for kind in self._noise.kinds], self.runs)
        done = self.engagements - sum(len(manifest.runs_of(index)[1]) for index in missing)
        stored = 0

        def report() -> None:
            if progress is not None:
                undecided = None if cells is None else cells.undecided
                progress(Progress(done, self.engagements, stored, time.perf_counter() - began_s, undecided))

        report()
        chunks = (self.chunk_at(index, manifest) for index in (missing if cells is None else cells.missing()))
        cores = os.cpu_count() or 1
        flights = (
            fly_on_threads(min(workers or cores, max(1, len(missing))), chunks)
            if executor is None
            else fly_on(executor, chunks, workers or 2 * cores)
        )
        with contextlib.closing(flights):
            for chunk, results in flights:
                (folder.write if cells is None else cells.store)(chunk, results)
                done, stored = done + len(chunk.runs), stored + len(chunk.runs)
                report()
                if stopped():
                    return
        if cells is not None:
            folder.stop_cells(cells.runs)

    def _stop_check(self, folder: CampaignWriter) -> Callable[[], bool]:
        """Return a function that stops the campaign in its folder, and returns True, once the rule is met."""
        rule, manifest = self.until, folder.manifest
        if not isinstance(rule, StoppingRule):
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
    """A sweep: the same runs in many cells. Starts and errors are the same, so that only the varied values differ.

    Parameters
    ----------
    scenario : Scenario
        Scenario that is varied.
    axes : tuple of Axis
        As for `Campaign`; at least one.
    runs : int
        Engagements per cell.
    cells, folder, seed, noise, guarantee, chunk, strategy, until, max_runs, require
        As for `Campaign`; the guaranteed miss is not computed by default.

    Raises
    ------
    TypeError, ValueError
        As for `Campaign`, or if there is no axis.
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
        until: AnyRequirement | None = None,
        max_runs: int | None = None,
        require: AnyRequirement | None = None,
    ) -> None:
        if not axes:
            raise ValueError("a sweep needs at least one axis, and a scenario for each combination of their values")
        super().__init__(
            scenario, runs, folder, seed, noise, strategy, guarantee, chunk, until, axes, cells, max_runs, require
        )
