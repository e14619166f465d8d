"""Tables 1 to 3 of Shorikov and Goranov (2021), as printed and corrected, compared with computed controls.

A table has u(t), t = 0..3, the linear and nonlinear x(t), t = 1..4, and the nonlinear norm of x(4). All are in the
paper's axes; problems, controls and states are in Hill's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from experiments.common.hill_axes import from_paper, to_paper
from experiments.common.printed_numbers import PrintedNumber, read_paper
from experiments.reachability.file import Rendezvous, load_rendezvous
from experiments.reachability.report import Member, fly_members
from infoset.arrays import Floats
from rendezvous.reachability import OptimalControls, Solution, minimum_energy, minimum_l1, nearest
from sim.storage.codec import fingerprint

PAPER = "reachability"
PROBLEM = "rendezvous-2021"
CHOICES = {"table 1": "minimum energy", "table 2": "minimum L1", "table 3": "nearest optimal"}
"""Optimal control that a table is compared with."""
COLUMNS = ("table", "ours", "quantity", "printed", "corrected", "computed")
_U, _LINEAR, _NONLINEAR = slice(0, 12), slice(12, 36), slice(36, 60)


@dataclass(frozen=True)
class PrintedTable:
    """A table of the paper."""

    numbers: tuple[PrintedNumber, ...]

    @property
    def contradicted(self) -> np.ndarray:
        """Return which controls the states contradict, of which the correct ones are not known: shape (4, 3)."""
        found = [number.corrected is not None and float(number.corrected) == 0.0 for number in self.numbers[_U]]
        return np.reshape(found, (4, 3))

    @property
    def controls(self) -> Floats:
        """Return the controls, shape (4, 3), with misprints corrected except for contradicted ones."""
        printed = np.reshape([number.value for number in self.numbers[_U]], (4, 3))
        return np.where(self.contradicted, printed, self._corrected(_U, 3))

    @property
    def linear(self) -> Floats:
        """Return the linear states, shape (4, 6), with misprints corrected."""
        return self._corrected(_LINEAR, 6)

    @property
    def nonlinear(self) -> Floats:
        """Return the nonlinear states, shape (4, 6), as printed."""
        return np.reshape([number.value for number in self.numbers[_NONLINEAR]], (4, 6))

    def _corrected(self, part: slice, columns: int) -> Floats:
        numbers = [float(number.corrected or number.printed) for number in self.numbers[part]]
        return np.reshape(numbers, (4, columns))


@cache
def printed_tables() -> dict[str, PrintedTable]:
    """Return the tables by name."""
    return {name: PrintedTable(numbers) for name, numbers in read_paper(PAPER).tables.items()}


@dataclass(frozen=True, eq=False)
class TableComparison:
    """A printed table, the optimal control nearest to it, and the printed control, corrected, on our models."""

    name: str
    table: PrintedTable
    ours: Member
    printed: Member

    @property
    def max_difference(self) -> float:
        """Return the largest difference of a control."""
        return float(np.abs(self.ours.controls - self.printed.controls).max())

    @property
    def rows(self) -> list[tuple[str, str, str, str, str | None, float]]:
        """Rows of `COLUMNS`: every printed number, its correction, if it has one, and the computed number."""
        return [
            (self.name, CHOICES[self.name], number.name, number.printed, number.corrected, value)
            for number, value in zip(self.table.numbers, numbers_of(self.ours), strict=True)
        ]


def numbers_of(member: Member) -> list[float]:
    """Return the numbers of a control and its states, in the order of a table."""
    parts = (member.controls, member.linear[1:], member.nonlinear[1:])
    return [*np.concatenate([to_paper(part).ravel() for part in parts]).tolist(), member.nonlinear_miss]


def is_published(rendezvous: Rendezvous) -> bool:
    """Return whether a problem has the values of the published one."""
    return fingerprint(rendezvous) == fingerprint(load_rendezvous(PROBLEM))


def compare_published(rendezvous: Rendezvous, solution: Solution) -> Sequence[TableComparison]:
    """Compare the tables of the paper with optimal controls of the published problem."""
    tables = printed_tables()
    printed = [from_paper(table.controls) for table in tables.values()]
    ours = [_ours(CHOICES[name], solution.optimal, control) for name, control in zip(tables, printed, strict=True)]
    members = fly_members(rendezvous, [*tables, *tables], np.array([*ours, *printed]))
    flown = zip(tables.items(), members[:3], members[3:], strict=True)
    return [TableComparison(name, table, one, other) for (name, table), one, other in flown]


def _ours(choice: str, optimal: OptimalControls, printed: Floats) -> Floats:
    choices = {"minimum energy": minimum_energy, "minimum L1": minimum_l1}
    return choices[choice](optimal) if choice in choices else nearest(optimal, printed)
