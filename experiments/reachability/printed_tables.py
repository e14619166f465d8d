"""Tables 1 to 3 of Shorikov and Goranov (2021), as printed and corrected, compared with computed controls.

The tables and the rows of the comparison are in the paper's axes; problems, controls and states are in Hill's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.common.hill_axes import from_paper, to_paper
from experiments.reachability.file import Rendezvous, load_rendezvous
from experiments.reachability.report import Member, fly_members
from infoset.arrays import Floats
from rendezvous.reachability import OptimalControls, Solution, minimum_energy, minimum_l1, nearest

PROBLEM = "rendezvous-2021"
Row = tuple[int, str, str, int, float, float | None, float]
COLUMNS = ("table", "ours", "quantity", "period", "printed", "corrected", "computed")


@dataclass(frozen=True)
class PrintedTable:
    """A table of the paper, as printed: u(t), t = 0..3, and x(t), t = 1..4.

    `ours` is the optimal control that it is compared with. A misprint has a quantity, t, the component from 1, and the
    correct number.
    """

    number: int
    ours: str
    controls: tuple[tuple[float, ...], ...]
    nonlinear: tuple[tuple[float, ...], ...]
    linear: tuple[tuple[float, ...], ...]
    nonlinear_miss: float
    misprints: tuple[tuple[str, int, int, float], ...]


def _rows(text: str) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(number) for number in row.split()) for row in text.split(";"))


TABLES = (
    PrintedTable(
        1,
        "least energy",
        _rows("-0.1206 0.0555 -0.2164; -0.0337 0.0042 -0.0883; 0.0358 -0.0690 0.0414; 0.0821 -0.1623 0.1703"),
        _rows(
            "1879.7 -2018.0 2110.9 -5.47 3.94 -3.10; 902.6 -1214.5 1318.9 -5.14 5.01 -5.68; 200.8 -397.2 386.3 "
            "-2.90 4.01 -4.66; -54.3 -29.1 -40.6 -0.12 -0.03 -0.07"
        ),
        _rows(
            "1884.2 -2014.2 2114.6 -5.42 3.98 -3.05; 937.24 -1202.0 1332.6 -5.05 5.07 -5.62; 234.85 -375.2 413.2 "
            "-2.80 -4.06 -4.58; 0 0 0 0 0 0"
        ),
        73.19,
        (
            ("linear x", 3, 5, 4.06),
            ("linear x", 1, 6, -3.06),
            ("nonlinear x", 2, 1, 920.6),
            ("nonlinear x", 3, 1, 200.9),
        ),
    ),
    PrintedTable(
        2,
        "least L1",
        _rows("-0.1254 -0.0373 -0.2612; -0.0034 0.0021 -0.0012; 0.0055 -0.0019 0.0001; 0.0893 -0.2055 0.1685"),
        _rows(
            "1864.0 -2060.9 2002.2 -5.66 3.47 -4.31; 937.6 -1356.5 1206.2 -4.59 4.34 -4.52; 227.6 -502.2 382.7 "
            "-3.26 5.13 -4.61; -55.7 -32.3 -39.6 -0.12 -0.03 -0.07"
        ),
        _rows(
            "1868.5 -2057.1 2005.9 -5.61 3.51 -4.27; 954.3 -1343.4 1219.6 -4.50 4.40 -4.46; 262.05 -478.2 480.9 "
            "-3.15 5.19 -4.54; 0 0 0 0 0 0"
        ),
        75.37,
        (("u", 0, 2, 0.0373), ("linear x", 3, 3, 408.9)),
    ),
    PrintedTable(
        3,
        "nearest optimal",
        _rows("-0.0879 -0.0559 -0.1314; -0.0899 0.0115 -0.2357; 0.0519 -0.0732 0.0846; 0.0895 -0.1655 0.1913"),
        _rows(
            "1958.7 -2024.4 2317.1 -4.59 3.83 -0.81; 1017.6 -1232.2 1575.6 -5.80 5.07 -7.41; 219.1 -402.2 435.4 "
            "-3.11 4.07 -5.23; -54.8 -27.0 -43.9 -0.11 -0.02 -0.82"
        ),
        _rows(
            "1963.2 -2020.6 2320.9 -4.54 3.87 -0.77; 1034.5 -1220.1 1590.6 -5.72 5.12 -7.34; 253.5 -381.3 464.2 "
            "-3.15 5.19 -4.54; 0 0 0 0 0 0"
        ),
        74.85,
        (
            ("u", 0, 2, 0.0559),
            ("linear x", 3, 4, -3.01),
            ("linear x", 3, 5, 4.12),
            ("linear x", 3, 6, -5.15),
            ("linear x", 2, 3, 1590.0),
            ("nonlinear x", 4, 6, -0.08),
        ),
    ),
)


@dataclass(frozen=True, eq=False)
class Comparison:
    """A printed table, the optimal control nearest to it, and the printed control, corrected, on our models."""

    table: PrintedTable
    ours: Member
    printed: Member

    @property
    def largest_difference(self) -> float:
        """Return the largest difference of a control."""
        return float(np.abs(self.ours.controls - self.printed.controls).max())

    @property
    def rows(self) -> list[Row]:
        """Rows of `COLUMNS`: every printed number, its correction, if it has one, and the computed number."""
        table, ours = self.table, self.ours
        corrections = {(quantity, t, component): value for quantity, t, component, value in table.misprints}
        blocks = (
            ("u", 0, table.controls, to_paper(ours.controls)),
            ("linear x", 1, table.linear, to_paper(ours.linear[1:])),
            ("nonlinear x", 1, table.nonlinear, to_paper(ours.nonlinear[1:])),
        )
        rows: list[Row] = []
        for quantity, first, printed, computed in blocks:
            for t, (known, ours_then) in enumerate(zip(printed, computed, strict=True), start=first):
                for component, (number, value) in enumerate(zip(known, ours_then, strict=True), start=1):
                    correction = corrections.get((quantity, t, component))
                    name = f"{quantity}{component}"
                    rows.append((table.number, table.ours, name, t, number, correction, float(value)))
        miss = ours.nonlinear_miss
        rows.append((table.number, table.ours, "nonlinear miss", 4, table.nonlinear_miss, None, miss))
        return rows


def is_published(rendezvous: Rendezvous) -> bool:
    """Return whether a problem has the values of the published one."""
    return rendezvous.hash == load_rendezvous(PROBLEM).hash


def compare_published(rendezvous: Rendezvous, solution: Solution) -> tuple[Comparison, ...]:
    """Compare the tables of the paper with optimal controls of the published problem."""
    printed = [from_paper(corrected(table, "u")) for table in TABLES]
    ours = [_ours(table, solution.optimal, control) for table, control in zip(TABLES, printed, strict=True)]
    names = [f"table {table.number}" for table in TABLES]
    members = fly_members(rendezvous, [*names, *names], np.array([*ours, *printed]))
    return tuple(
        Comparison(table, one, other) for table, one, other in zip(TABLES, members[:3], members[3:], strict=True)
    )


def corrected(table: PrintedTable, quantity: str) -> Floats:
    """Return the printed "u", "linear x" or "nonlinear x" with the misprints corrected, in the paper's axes."""
    first, printed = {"u": (0, table.controls), "linear x": (1, table.linear), "nonlinear x": (1, table.nonlinear)}[
        quantity
    ]
    numbers = np.array(printed)
    for misprinted, t, component, value in table.misprints:
        if misprinted == quantity:
            numbers[t - first, component - 1] = value
    return numbers


def _ours(table: PrintedTable, optimal: OptimalControls, printed: Floats) -> Floats:
    choices = {"least energy": minimum_energy, "least L1": minimum_l1}
    return choices[table.ours](optimal) if table.ours in choices else nearest(optimal, printed)
