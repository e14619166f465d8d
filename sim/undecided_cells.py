"""Cells of a campaign or a sweep, to which runs are added until a rule is decided in each."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from infoset.arrays import Floats
from infoset.sim.requirement import AnyRequirement, decides
from infoset.sim.results import Results
from infoset.sim.stopping_rule import StoppingRule
from infoset.sim.storage import CampaignFolder

GROWTH = 1.05
"""A sample grows by at least this factor between two checks of a quantile: a check after each chunk
would cost O(N^2), and a campaign is at most 5 % and one chunk longer than needed.
"""


class CellSample:
    """Runs of one noise of a cell, by which a rule is decided.

    A quantile is checked after certain numbers of chunks, which depend neither on the workers nor
    on their speed: a campaign stops at the same run with any number of workers and interruptions.
    The cost is O(N log N) over a campaign. A requirement is checked after each run, and its
    decision is final. A quantile can be undecided again at a later check, which is made if another
    noise of the cell is undecided, or the cell has fewer runs than its minimum.
    """

    def __init__(self, rule: StoppingRule | AnyRequirement, chunks: int) -> None:
        self.decided = False
        self._rule = rule
        self._last = chunks
        self._count = 0
        self._next_check = 1
        self._values: Floats = np.empty(0)

    def add(self, values: Floats) -> None:
        """Add the values of a chunk, the chunks in the order of their runs; NaN is left out."""
        self._count += 1
        before = len(self._values)
        self._values = np.append(self._values, values[~np.isnan(values)])

        if not isinstance(self._rule, StoppingRule):
            runs = np.arange(1, len(self._values) + 1)
            counts = np.cumsum(self._rule.holds(self._values))
            self.decided |= bool(decides(runs[before:], counts[before:], self._rule.share).any())
        elif self._count == min(self._next_check, self._last):
            self._next_check = max(self._count + 1, math.ceil(GROWTH * self._count))
            self.decided = self._rule.met_by(self._values)


@dataclass
class _Cell:
    """Progress of a cell: its chunks, the judged runs by noise, the number of judged chunks, and
    simulated chunks, by their runs, that wait for an earlier one.
    """

    chunks: list[range]
    samples: dict[str, CellSample]
    judged: int = 0
    waiting: dict[Sequence[int], Results] = field(default_factory=dict)


class UndecidedCells:
    """The chunks that must still be simulated, and simulated ones that wait for an earlier chunk.

    The number of runs in the manifest of the folder is the limit of each cell, `min_runs` its
    minimum number. The rule is decided for each noise. A chunk is stored only if
    the chunks before it in its cell are stored and have not decided. The stored runs are therefore
    the same for any number of workers and after any interruption.
    """

    def __init__(
        self, folder: CampaignFolder, rule: StoppingRule | AnyRequirement, min_runs: int
    ) -> None:
        self._folder = folder
        self._rule = rule
        self._min_runs = min_runs
        chunks: list[list[range]] = [[] for _ in range(folder.manifest.cells)]
        for cell, runs in folder.manifest.chunks():
            chunks[cell].append(runs)
        noises = [kind.value for kind in folder.manifest.noise.kinds]
        self._cells = [
            _Cell(each, {noise: CellSample(rule, len(each)) for noise in noises}) for each in chunks
        ]
        for cell in range(len(self._cells)):
            self._advance(cell)

    @property
    def runs(self) -> tuple[int, ...]:
        """Engagements stored without a gap from run 0 on, for each cell.

        It is empty if the rule has stopped no cell.
        """
        if not any(map(self._is_decided, self._cells)):
            return ()
        counts = []
        for number, cell in enumerate(self._cells):
            stored = itertools.takewhile(partial(self._folder.has, number), cell.chunks)
            counts.append(sum(map(len, stored)))
        return tuple(counts)

    def missing(self) -> Iterator[tuple[int, range]]:
        """Yield the chunks to simulate: in rounds, the next one of each undecided cell."""
        for cell, runs in self._folder.manifest.chunks():
            if not self._is_done(self._cells[cell]) and not self._folder.has(cell, runs):
                yield cell, runs

    def store(self, cell: int, runs: Sequence[int], results: Results) -> None:
        """Write a simulated chunk once all chunks before it are written.

        It is discarded if its cell is decided by then.
        """
        self._cells[cell].waiting[runs] = results
        self._advance(cell)

    def _is_decided(self, cell: _Cell) -> bool:
        runs = min(cell.judged * self._folder.manifest.chunk, self._folder.manifest.runs)
        return runs >= self._min_runs and all(sample.decided for sample in cell.samples.values())

    def _is_done(self, cell: _Cell) -> bool:
        return cell.judged == len(cell.chunks) or self._is_decided(cell)

    def _advance(self, number: int) -> None:
        """Judge the chunks of a cell in order, up to the first unknown chunk or the decision."""
        cell = self._cells[number]
        while not self._is_done(cell):
            runs = cell.chunks[cell.judged]
            if runs in cell.waiting:
                self._folder.write(number, runs, cell.waiting.pop(runs))
            elif not self._folder.has(number, runs):
                return

            frame = self._folder.read_chunks([(number, runs)], ["noise", self._rule.quantity])
            for noise, sample in cell.samples.items():
                values = frame.loc[frame["noise"] == noise, self._rule.quantity]
                sample.add(self._rule.numbers(values))
            cell.judged += 1

        # Of a decided cell; without a decision nothing waits after the last chunk.
        cell.waiting.clear()
