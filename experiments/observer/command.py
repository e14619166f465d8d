"""`infoset observe`: options."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from infoset.experiments.common.options import FileOptions, Html, ProblemName, Seed, Settings

MAX_STEPS = 10_000
"""Maximum number of steps of a run, measured or simulated; chosen: the sets of two states then take
some ten seconds, and their JSON file 10 MB.
"""


class Errors(Enum):
    """Errors of simulated measurements and disturbances."""

    EXTREMAL = "extremal"
    UNIFORM = "uniform"


@dataclass(frozen=True)
class Observe(FileOptions):
    """Compute the sets of states that agree with measurements.

    The linear system is x+ = A x + B u + c + w with w in a set W, and y = C x + v with v within
    bounds. The sets are exact up to rounding, and contain the true state if w and v are in their
    sets. The measurements are in a CSV file or in the problem file; otherwise they are simulated.

    Without --out, --json, --csv or --html no file is written.
    """

    problem: ProblemName = "observer-2005"
    settings: Settings = None
    data: Annotated[
        Path | None,
        typer.Option(
            "--data",
            metavar="FILE.csv",
            help=(
                "Measurements: one row for each step, columns y1, y2, .. and u1, u2, ..; an empty "
                "cell of y, or NaN, is a missing measurement. The u of a row acts after its "
                "measurement."
            ),
        ),
    ] = None
    columns: Annotated[
        str,
        typer.Option(
            "--columns",
            metavar="NAME=COLUMN,..",
            help="Columns of --data with other names, for example y1=range_m.",
        ),
    ] = ""
    errors: Annotated[
        Errors,
        typer.Option(
            "--errors",
            help=(
                "Errors of a simulation: extremal (at a bound, at random) or uniform (within the "
                "bounds)."
            ),
        ),
    ] = Errors.EXTREMAL
    seed: Seed = 0
    smooth: Annotated[
        bool,
        typer.Option(
            "--smooth", help="Add what later measurements imply about the state of each step."
        ),
    ] = False
    csv: Annotated[
        Path | None,
        typer.Option(
            "--csv", metavar="FILE", help="Write the bounds of each step as CSV; - prints CSV only."
        ),
    ] = None
    html: Html = None
