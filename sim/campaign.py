"""Campaigns: any number of engagements, stored during the simulation. A campaign is a sweep of one
cell.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from infoset.guidance import Strategy
from infoset.guidance.noise import NoiseSource
from infoset.limits import COUNT, WHOLE, Limits
from infoset.sim.parallel import CampaignNoise, Task, simulate_tasks
from infoset.sim.requirement import AnyRequirement
from infoset.sim.scenario import Scenario, noise_name, strategy_name
from infoset.sim.simulate import ENGAGEMENTS_AT_ONCE
from infoset.sim.stopping_rule import StoppingRule
from infoset.sim.storage import MANIFEST, Axis, CampaignFolder, Manifest, fingerprint, read_manifest
from infoset.sim.undecided_cells import UndecidedCells
from infoset.sim.versions import versions

FEWEST_CHUNKS = 256
MAX_CHUNK = 4096
FEWEST_A_CELL = 50
"""Minimum number of engagements per chunk of a sweep."""


@dataclass(frozen=True)
class Campaign:
    """Many engagements of one scenario, or of the scenarios of a sweep.

    The cells of a sweep have the same starts and errors, so that only the varied values differ.

    Parameters
    ----------
    runs : int
        Number of runs, from run 0; with `until` the maximum number.
    seed : int
        Run K is the same engagement in every campaign and experiment with this seed.
    noise : CampaignNoise, NoiseSource or None
        Measurement noise, or one of your own, whose attribute `version` is in the manifest like
        that of a strategy; None is the scenario's.
    strategy : Strategy or None
        A strategy of your own; None is the scenario's. The manifest contains its attribute
        `version`, or its name without this attribute; a campaign cannot be resumed with another
        strategy.
    guarantee : bool
        Whether the guaranteed model computes the guaranteed miss Phi. A run takes 1.1 to 1.9 times
        as long, with a rate sensor 1.4 to 9 times.
    chunk : int or None
        Engagements per file; results do not depend on it. None chooses a value for the number of
        runs.
    until : StoppingRule, Requirement, HitRequirement or None
        A campaign, or a cell of a sweep, stops at the end of a chunk once this rule is met or this
        requirement is decided for each noise.
    axes : tuple of Axis
        Keys and values that a sweep varies, as in a scenario file; stored as a description.
    cells : tuple of Scenario
        Scenarios of a sweep, one for each combination of the values; the last axis varies fastest.
    max_runs : int or None
        Maximum number of runs of a cell with a requirement in `until`; `runs` is then the minimum.
        None is `runs`.
    require : Requirement, HitRequirement or None
        Requirement of a sweep for its reports; stored as a description. None is that of `until`.

    Raises
    ------
    TypeError, ValueError
        If a number is out of its range, the noise is not a `CampaignNoise`, or the axes and the
        cells do not fit together.
    """

    scenario: Scenario
    runs: int
    folder: str | Path
    seed: int = 0
    noise: CampaignNoise | NoiseSource | None = None
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
        if self._own_noise is not None and not (
            hasattr(self.noise, "measure") or callable(self.noise)
        ):
            raise TypeError(
                "noise must be None, a CampaignNoise, or have the method measure: got "
                f"{self.noise!r}"
            )
        if len(self.cells) != (
            math.prod(len(axis.values) for axis in self.axes) if self.axes else 0
        ):
            raise ValueError(
                "a sweep needs at least one axis, and a scenario for each combination of their "
                "values"
            )
        if self.max_runs is not None:
            Limits(minimum=self.runs, whole=True).need("max_runs", self.max_runs)

    def run(
        self,
        executor: Executor | None = None,
        *,
        workers: int | None = None,
        resume: bool = False,
        progress: Callable[[float], None] | None = None,
        within_chunks: bool = False,
    ) -> CampaignFolder:
        """Simulate the engagements that are not stored yet.

        Parameters
        ----------
        executor : Executor or None
            An executor of `concurrent.futures`, or one with the same interface; processes must be
            spawned, not forked. None uses threads of this process.
        workers : int or None
            Number of threads, by default one per core; with an executor, the number of chunks that
            are submitted at a time, by default two per core.
        resume : bool
            Whether the folder may contain this campaign already. The number of runs may be greater
            than before.
        progress : callable or None
            Called after each chunk with the fraction done, from 0 to 1; with `until`, of the
            maximum number of runs.
        within_chunks : bool
            Whether threads call `progress` after each step of a chunk, too.

        Returns
        -------
        CampaignFolder
            The stored runs.

        Raises
        ------
        StorageError
            If the folder contains something else or cannot be written. Stored runs are kept, and
            the campaign can be resumed.
        VersionError
            If the workers of the executor have other versions of the packages.
        FloatingPointError
            If results are not finite.
        """
        with CampaignFolder.begin(Path(self.folder), self.manifest(), resume=resume) as folder:
            within = within_chunks and executor is None
            self._simulate_missing(folder, executor, workers, progress, within)
        return folder

    def manifest(self) -> Manifest:
        """Return the manifest of the campaign; a resumed campaign keeps the size of its chunks."""
        noise = self._noise
        own = self._own_noise
        chunk = self.chunk
        if chunk is None:
            folder = Path(self.folder)
            chunk = (
                read_manifest(folder).chunk
                if (folder / MANIFEST).is_file()
                else self._default_chunk()
            )
        required = (
            self.until
            if self.require is None and isinstance(self.until, AnyRequirement)
            else self.require
        )
        hashes = ",".join(fingerprint(noise.applied_to(cell)) for cell in self.cells)
        return Manifest(
            scenario=noise.applied_to(self.scenario),
            runs=self.cell_runs,
            chunk=chunk,
            seed=self.seed,
            noise=noise,
            own_noise=None if own is None else getattr(own, "version", None) or noise_name(own),
            strategy=getattr(self.strategy, "version", None)
            or strategy_name(self.scenario, self.strategy),
            guarantee=self.guarantee,
            versions=versions(),
            axes=self.axes,
            cells_hash=hashlib.sha256(hashes.encode()).hexdigest()[:32] if self.cells else "",
            until=None if self.until is None else str(self.until),
            require=None if required is None else str(required),
        )

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
        if self.noise is None:
            return CampaignNoise(self.scenario.noise.value)
        return self.noise if isinstance(self.noise, CampaignNoise) else CampaignNoise.OWN

    @property
    def _own_noise(self) -> NoiseSource | None:
        return None if isinstance(self.noise, CampaignNoise) else self.noise

    def _default_chunk(self) -> int:
        """Return the engagements per file: one or more batches of the engine.

        Small chunks limit the work that is lost if a process stops. Large chunks limit the number
        of files. Chunks of a sweep are not larger than a cell, because cells may be extended later.
        """
        batches = -(-self.cell_runs // (FEWEST_CHUNKS * ENGAGEMENTS_AT_ONCE))
        size = max(1, min(batches, MAX_CHUNK // ENGAGEMENTS_AT_ONCE)) * ENGAGEMENTS_AT_ONCE
        return min(size, max(self.runs, FEWEST_A_CELL)) if self.axes else size

    def _simulate_missing(
        self,
        folder: CampaignFolder,
        executor: Executor | None,
        workers: int | None,
        progress: Callable[[float], None] | None,
        within_chunks: bool,
    ) -> None:
        done = folder.finished_runs
        total = folder.wanted_runs
        is_stopped = bool(folder.manifest.cell_runs)
        cells = (
            None
            if self.until is None or is_stopped
            else UndecidedCells(folder, self.until, self.runs)
        )
        missing = (chunk for chunk in folder.manifest.chunks() if not folder.has(*chunk))
        running: dict[tuple[int, int], float] = {}

        def task_of(cell: int, runs: range) -> Task:
            scenario = (self.cells or (self.scenario,))[cell]
            noise = self._own_noise or self._noise
            task = Task(scenario, runs, self.seed, noise, self.guarantee, self.strategy, cell)
            if progress is None or not within_chunks:
                return task

            def report(share: float) -> None:
                running[cell, runs.start] = share * len(runs)
                progress(min(1.0, (done + sum([*running.values()])) / total))

            return replace(task, progress=report)

        tasks = (
            task_of(cell, runs) for cell, runs in (missing if cells is None else cells.missing())
        )
        with contextlib.closing(simulate_tasks(tasks, executor, workers)) as finished:
            for task, results in finished:
                (folder.write if cells is None else cells.store)(task.cell, task.runs, results)
                done += len(task.runs)
                running.pop((task.cell, task.runs[0]), None)
                if progress is not None:
                    progress(done / total)
        if cells is not None and cells.runs:
            folder.stop(cells.runs)
