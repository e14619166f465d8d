"""`infoset reach`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import typer

from experiments.common.options import FileOptions, Html, ProblemName, Seed


@dataclass(frozen=True)
class Reach(FileOptions):
    """Compute all optimal controls of a rendezvous under constraints, and its reachable sets.

    The results are the least terminal norm, the forward sets, the tube of all optimal trajectories, and the set of
    all optimal controls. Selected optimal controls are simulated on the linear and on the nonlinear model. Without
    --out, --json or --html no file is written.
    """

    problem: ProblemName = "rendezvous-2021"
    select: Annotated[
        str,
        typer.Option(
            metavar="A,B,C",
            help="Optimal controls to show: energy, l1, norms (least sums of squares, absolute values, Euclidean "
            "norms), peak, chebyshev, analytic, vertices, samples:N.",
        ),
    ] = "energy,l1,norms,peak,chebyshev,analytic"
    route: Annotated[
        Literal["auto", "exact", "lifted"],
        typer.Option(help="Representation of the sets: exact polytopes, or lifted linear programs."),
    ] = "auto"
    replan: Annotated[
        bool,
        typer.Option("--replan", help="Also simulate in closed loop: a new plan every period, nonlinear model."),
    ] = False
    noisy_flights: Annotated[
        int,
        typer.Option(min=0, max=1000, help="Number of simulations with navigation errors, if the problem has them."),
    ] = 10
    seed: Seed = 0
    html: Html = None
