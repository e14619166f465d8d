"""Campaigns: any number of engagements, stored during the simulation. A campaign is a sweep of one
cell.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from infoset.guidance import Strategy
from infoset.guidance.noise import NoiseSource
from infoset.limits import COUNT, WHOLE, Limits, shown
from infoset.sim.parallel import CampaignNoise, Task, simulate_tasks
from infoset.sim.requirement import AnyRequirement
from infoset.sim.scenario import Scenario, noise_name, strategy_name
from infoset.sim.simulate import ENGAGEMENTS_AT_ONCE
from infoset.sim.stopping_rule import StoppingRule
from infoset.sim.storage import MANIFEST, Axis, CampaignFolder, Manifest, fingerprint, read_manifest
from infoset.sim.undecided_cells import UndecidedCells
from infoset.sim.versions import versions

FEWEST_CHUNKS = 256
"""Number of chunks above which they are made longer, by whole batches: a large campaign then has
129 to 256 chunks, and more where `MAX_CHUNK` limits their length. So each of a hundred workers has
one, and a killed process loses less than 1 % of the runs.
"""
MAX_CHUNK = 4096
"""Limit of the engagements per chunk by default, of which whole batches are taken, 4000. Chosen;
results do not depend on it: a campaign of a million runs has some 250 files.
"""
FEWEST_A_CELL = 50
"""Minimum number of engagements per chunk of a sweep by default, so that files are few. Chosen;
results do not depend on it.
"""


@dataclass(frozen=True)
class RunsUntil:
    """Runs of a campaign, or of each cell of a sweep, until a rule is met or a requirement decided.

    The rule is checked for each noise at the ends of chunks.

    Parameters
    ----------
    rule : StoppingRule, Requirement or HitRequirement
        Rule that stops the campaign or the cell.
    max_runs, min_runs : int
        Maximum and minimum number of runs, of each cell in a sweep.

    Raises
    ------
    TypeError, ValueError
        If the rule is of another type, or a number is out of its range.
    """

    rule: StoppingRule | AnyRequirement
    max_runs: int
    min_runs: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.rule, StoppingRule | AnyRequirement):
            raise TypeError(f"rule must be a StoppingRule or a requirement: got {shown(self.rule)}")
        COUNT.need("min_runs", self.min_runs)
        Limits(minimum=self.min_runs, whole=True).need("max_runs", self.max_runs)


@dataclass(frozen=True)
class Campaign:
    """Many engagements of one scenario, or of the scenarios of a sweep.

    The cells of a sweep have the same starts and errors, so that only the varied values differ.

    Parameters
    ----------
    runs : int or RunsUntil
        Number of runs, of each cell in a sweep, from run 0; or a rule with a maximum number.
    seed : int
        Run K is the same engagement in every campaign and experiment with this seed.
    noise : CampaignNoise, NoiseSource or None
        Measurement noise, or one of your own, whose attribute `version` is in the manifest; None is
        the scenario's.
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
    axes : tuple of Axis
        Keys and values that a sweep varies, as in a scenario file; stored as a description.
    cells : tuple of Scenario
        Scenarios of a sweep, one for each combination of the values; the last axis varies fastest.
    require : Requirement, HitRequirement or None
        Requirement of a sweep for its reports; stored as a description. None is the requirement in
        `runs`, if there is one.

    Raises
    ------
    TypeError, ValueError
        If a number is out of its range, the noise is no `CampaignNoise` and neither has the method
        `measure` nor can be called, or the axes and the cells do not fit together.
    """

    scenario: Scenario
    runs: int | RunsUntil
    folder: str | Path
    seed: int = 0
    noise: CampaignNoise | NoiseSource | None = None
    strategy: Strategy | None = None
    guarantee: bool = True
    chunk: int | None = None
    axes: tuple[Axis, ...] = ()
    cells: tuple[Scenario, ...] = ()
    require: AnyRequirement | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.runs, RunsUntil):
            COUNT.need("runs", self.runs)
        WHOLE.need("seed", self.seed)
        if self.chunk is not None:
            COUNT.need("chunk", self.chunk)

        own = self._own_noise
        if own is not None and not (hasattr(own, "measure") or callable(own)):
            raise TypeError(
                f"noise must be None, a CampaignNoise, or have the method measure: got {own!r}"
            )

        # A campaign has no axes and no cells.
        combinations = math.prod(len(axis.values) for axis in self.axes) if self.axes else 0
        if len(self.cells) != combinations:
            raise ValueError(
                "a sweep needs at least one axis, and a scenario for each combination of their "
                "values"
            )

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
            Called after each chunk with the fraction done, from 0 to 1, of the maximum number of
            runs.
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
            known = None
            if progress is not None:
                known = _Progress(progress, folder, within_chunks and executor is None)
            self._simulate_missing(folder, executor, workers, known)
        return folder

    def manifest(self) -> Manifest:
        """Return the manifest of the campaign; a resumed campaign keeps the size of its chunks."""
        noise = self._noise
        own_noise = None
        if self._own_noise is not None:
            own_noise = getattr(self._own_noise, "version", None) or noise_name(self._own_noise)
        version = getattr(self.strategy, "version", None)
        hashes = ",".join(fingerprint(noise.applied_to(cell)) for cell in self.cells)

        rule = None if self._until is None else self._until.rule
        required = self.require
        if required is None and isinstance(rule, AnyRequirement):
            required = rule
        # 32 digits of a hash, 128 bits, tell the cells of two sweeps apart.
        return Manifest(
            scenario=noise.applied_to(self.scenario),
            runs=self._max_runs,
            chunk=self._chunk_size(),
            seed=self.seed,
            noise=noise,
            own_noise=own_noise,
            strategy=version or strategy_name(self.scenario, self.strategy),
            guarantee=self.guarantee,
            versions=versions(),
            axes=self.axes,
            cells_hash=hashlib.sha256(hashes.encode()).hexdigest()[:32] if self.cells else "",
            until=None if rule is None else str(rule),
            require=None if required is None else str(required),
        )

    @property
    def max_engagements(self) -> int:
        """Maximum number of engagements of all cells."""
        return self._max_runs * max(1, len(self.cells))

    @property
    def _until(self) -> RunsUntil | None:
        return self.runs if isinstance(self.runs, RunsUntil) else None

    @property
    def _max_runs(self) -> int:
        return self.runs.max_runs if isinstance(self.runs, RunsUntil) else self.runs

    @property
    def _min_runs(self) -> int:
        return self.runs.min_runs if isinstance(self.runs, RunsUntil) else self.runs

    @property
    def _noise(self) -> CampaignNoise:
        if self.noise is None:
            return CampaignNoise(self.scenario.noise.value)
        return self.noise if isinstance(self.noise, CampaignNoise) else CampaignNoise.OWN

    @property
    def _own_noise(self) -> NoiseSource | None:
        return None if isinstance(self.noise, CampaignNoise) else self.noise

    def _chunk_size(self) -> int:
        """Return the engagements per file: given, as in the folder, or the default."""
        if self.chunk is not None:
            return self.chunk
        folder = Path(self.folder)
        if (folder / MANIFEST).is_file():
            return read_manifest(folder).chunk
        return self._default_chunk()

    def _default_chunk(self) -> int:
        """Return the engagements per file: one or more batches of the engine.

        Small chunks limit the work that is lost if a process stops. Large chunks limit the number
        of files. Chunks of a sweep are not larger than the minimum number of runs of a cell or
        `FEWEST_A_CELL`, because cells may be extended later.
        """
        # Rounded up.
        batches = -(-self._max_runs // (FEWEST_CHUNKS * ENGAGEMENTS_AT_ONCE))
        size = max(1, min(batches, MAX_CHUNK // ENGAGEMENTS_AT_ONCE)) * ENGAGEMENTS_AT_ONCE
        return min(size, max(self._min_runs, FEWEST_A_CELL)) if self.axes else size

    def _simulate_missing(
        self,
        folder: CampaignFolder,
        executor: Executor | None,
        workers: int | None,
        progress: _Progress | None,
    ) -> None:
        """Simulate and store the chunks that the folder lacks; with a rule, those of undecided
        cells, until the rule stops the campaign.

        If the rule has stopped cells in an earlier session (`cell_runs`), only missing files of the
        runs before that are simulated.
        """
        cells = None
        store = folder.write
        missing: Iterator[tuple[int, range]]
        missing = (chunk for chunk in folder.manifest.chunks() if not folder.has(*chunk))
        is_stopped = bool(folder.manifest.cell_runs)
        if self._until is not None and not is_stopped:
            cells = UndecidedCells(folder, self._until.rule, self._until.min_runs)
            store = cells.store
            missing = cells.missing()

        tasks = (self._task(cell, runs, progress) for cell, runs in missing)
        with contextlib.closing(simulate_tasks(tasks, executor, workers)) as finished:
            for task, results in finished:
                store(task.cell, task.runs, results)
                if progress is not None:
                    progress.finish(task.cell, task.runs)
        if cells is not None and cells.runs:
            folder.stop(cells.runs)

    def _task(self, cell: int, runs: range, progress: _Progress | None) -> Task:
        scenario = self.cells[cell] if self.cells else self.scenario
        noise = self._own_noise or self._noise
        task = Task(scenario, runs, self.seed, noise, self.guarantee, self.strategy, cell)
        if progress is None or not progress.within_chunks:
            return task
        return replace(task, progress=progress.of_chunk(cell, runs))


class _Progress:
    """Fraction of the runs that is done, reported after each chunk and within the running ones."""

    def __init__(
        self, report: Callable[[float], None], folder: CampaignFolder, within_chunks: bool
    ) -> None:
        self.within_chunks = within_chunks
        self._report = report
        self._done = folder.finished_runs
        self._total = folder.wanted_runs
        self._running: dict[tuple[int, int], float] = {}

    def of_chunk(self, cell: int, runs: range) -> Callable[[float], None]:
        """Return the function that reports the fraction of a chunk, from any thread."""

        def report(share: float) -> None:
            self._running[cell, runs.start] = share * len(runs)
            self._report_all()

        return report

    def finish(self, cell: int, runs: Sequence[int]) -> None:
        """Report that a chunk is stored."""
        self._done += len(runs)
        self._running.pop((cell, runs[0]), None)
        self._report_all()

    def _report_all(self) -> None:
        """Report the runs that are stored and those of the running chunks."""
        # A list, because other threads change the dictionary.
        running = sum([*self._running.values()])
        # A chunk that is being finished may count twice for a moment.
        self._report(min(1.0, (self._done + running) / self._total))
