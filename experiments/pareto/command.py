"""`infoset pareto`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import FileOptions, Html, ProblemName


@dataclass(frozen=True)
class Pareto(FileOptions):
    """Find a meeting of several craft that is Pareto-optimal: no craft can save energy unless another one uses more.

    Each craft flies with minimum energy. The meeting minimizes the group loss, the weighted sum of the costs of the
    craft beyond those of their own cheapest meetings. Other choices of the meeting, the coalitions and the bound on
    the control are also evaluated. Without --out, --json or --html no file is written.
    """

    problem: ProblemName = "pareto-2008"
    prefer: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=VALUE,..", help="A preferred meeting; the nearest Pareto-optimal one is added to the choices."
        ),
    ] = None
    samples: Annotated[
        int, typer.Option(metavar="N", min=2, max=10_001, help="Number of times in each trajectory of the JSON file.")
    ] = 31
    html: Html = None
