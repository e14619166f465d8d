"""Runs are added to the cells of a sweep until a requirement is decided in each cell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from sim.chunk import Chunk
from sim.requirement import AnyRequirement, decides
from sim.results import Results
from sim.storage import CampaignWriter


@dataclass
class _Cell:
    """Progress of a cell: judged chunks; for each noise the runs, those that satisfy the bound, and the decision."""

    chunks: int = 0
    runs: list[int] = field(default_factory=list)
    holding: list[int] = field(default_factory=list)
    decided: list[bool] = field(default_factory=list)


class UndecidedCells:
    """The chunks of a sweep that must still be simulated, and those that were simulated before an earlier chunk.

    The number of runs in the manifest of the folder is the limit of each cell, `min_runs` its minimum number. The
    requirement is decided for each noise, by the confidence sequence of `sim.requirement.judge`. A chunk is stored only
    if the chunks before it in its cell are stored and have not decided. The stored runs are therefore the same for any
    number of workers and after any interruption.
    """

    def __init__(
        self, folder: CampaignWriter, requirement: AnyRequirement, noises: Sequence[str], min_runs: int
    ) -> None:
        self._folder = folder
        self._requirement = requirement
        self._noises = noises
        self._min_runs = min_runs
        self._waiting: dict[int, tuple[Chunk, Results]] = {}
        zeros, none = [0] * len(noises), [False] * len(noises)
        self._cells = [_Cell(0, [*zeros], [*zeros], [*none]) for _ in range(folder.manifest.cells)]
        for cell in range(len(self._cells)):
            self._advance(cell)

    @property
    def undecided(self) -> int:
        """Number of cells that need more runs."""
        return sum(not self._is_done(cell) for cell in range(len(self._cells)))

    @property
    def runs(self) -> tuple[int, ...]:
        """Engagements stored without a gap from run 0 on, for each cell."""
        manifest = self._folder.manifest
        counts = []
        for cell in range(manifest.cells):
            number = 0
            while number < manifest.chunks_a_cell and self._folder.has(manifest.index_of(cell, number)):
                number += 1
            counts.append(min(number * manifest.chunk, manifest.runs))
        return tuple(counts)

    def missing(self) -> Iterator[int]:
        """Yield the chunks to simulate: the next one of each cell that is undecided at that time, in rounds."""
        manifest = self._folder.manifest
        for number in range(manifest.chunks_a_cell):
            for cell in range(manifest.cells):
                index = manifest.index_of(cell, number)
                if not self._is_done(cell) and not self._folder.has(index):
                    yield index

    def store(self, chunk: Chunk, results: Results) -> None:
        """Write a simulated chunk once all chunks before it are written; discard it if its cell is then decided."""
        self._waiting[chunk.index] = chunk, results
        self._advance(chunk.cell)

    def _is_done(self, cell: int) -> bool:
        manifest, state = self._folder.manifest, self._cells[cell]
        runs = min(state.chunks * manifest.chunk, manifest.runs)
        return runs == manifest.runs or (runs >= self._min_runs and all(state.decided))

    def _advance(self, cell: int) -> None:
        """Judge the chunks of a cell in their order, up to the first unknown chunk or the decision of the cell."""
        while not self._is_done(cell):
            index = self._folder.manifest.index_of(cell, self._cells[cell].chunks)
            if index in self._waiting:
                self._folder.write(*self._waiting.pop(index))
            elif not self._folder.has(index):
                return
            self._judge(cell, index)
        for index in [index for index, (chunk, _) in self._waiting.items() if chunk.cell == cell]:
            del self._waiting[index]

    def _judge(self, cell: int, index: int) -> None:
        state = self._cells[cell]
        required = self._requirement
        samples = self._folder.chunk_samples(index, required.quantity, self._noises, unknown=required.unknown)
        for noise, values in enumerate(samples):
            counts = state.holding[noise] + np.cumsum(required.holds(values))
            if not values.size:
                continue
            before = state.runs[noise]
            runs = np.arange(before + 1, before + values.size + 1)
            state.decided[noise] |= bool(decides(runs, counts, required.share).any())
            state.runs[noise], state.holding[noise] = before + values.size, int(counts[-1])
        state.chunks += 1
