"""`infoset pareto`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from infoset.experiments.common.options import Csv, FileOptions, Html, ProblemName, Settings


@dataclass(frozen=True)
class Pareto(FileOptions):
    """Find a Pareto-optimal meeting of several craft.

    Pareto-optimal means that no craft can save energy unless another one uses more. Each craft
    moves with minimum energy. The excess of a craft is its cost minus the cost of its cheapest
    meeting. The meeting minimizes the group loss, which is the weighted sum of the excesses. Other
    choices of the meeting and the coalitions are also evaluated. With max_control_m_s2 in the
    problem, the controls to the meeting stay within this bound at all times.

    Without --out, --json, --csv or --html no file is written.

    Axes: x radially outward, y along the motion, z along the orbit's normal (Hill's).
    """

    problem: ProblemName = "pareto-2008"
    settings: Settings = None
    prefer: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=VALUE,..",
            help=(
                "Preferred meeting, for example x_m=0,z_m=50. The nearest Pareto-optimal meeting "
                "is also evaluated."
            ),
        ),
    ] = None
    csv: Csv = None
    html: Html = None
