"""`infoset reach`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from infoset.experiments.common.options import Csv, FileOptions, Html, ProblemName, Seed, Settings


@dataclass(frozen=True)
class Reach(FileOptions):
    """Compute reachable sets and optimal controls of a rendezvous, or of a linear system of your
    own.

    The problem has constraints. The results are the minimum terminal norm, the forward sets, the
    tube of all optimal trajectories, and the set of all optimal controls. Selected optimal controls
    are simulated, those of a rendezvous on the linear and on the nonlinear model. Without --out,
    --json, --csv or --html no file is written.

    If the problem has measurements or an initial state with bounded errors ([sensor],
    [initial_error]), the result is how near the craft comes for certain: without measurements, with
    affine feedback, with a last impulse that is planned again, and what no strategy can improve.

    Axes: x radially outward, y along the motion, z along the orbit's normal (Hill's), at the
    passive craft.
    """

    problem: ProblemName = "rendezvous-2021"
    settings: Settings = None
    select: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,C",
            help=(
                "Optimal controls to simulate: energy, l1, norms (minimum sum of squares, of "
                "absolute values, of Euclidean norms), delta-v (minimum Delta-v), peak (minimum "
                "peak), chebyshev, analytic (centres of the set), vertices, samples:N (N random "
                "ones). Default: energy,l1,norms,peak,chebyshev,analytic; with impulses "
                "delta-v,energy,peak,chebyshev,analytic."
            ),
        ),
    ] = None
    replan: Annotated[
        bool,
        typer.Option(
            "--replan",
            help=(
                "Also simulate in closed loop on the nonlinear model, with a new plan every "
                "period; if the problem has navigation errors, also 10 times with them. With "
                "bounded errors: also simulate flights that are planned again after each "
                "measurement, whose guarantee never increases."
            ),
        ),
    ] = False
    backward: Annotated[
        bool,
        typer.Option(
            "--backward",
            help=(
                "Also compute the backward sets: the states at each time from which the terminal "
                "state of minimum norm can be reached."
            ),
        ),
    ] = False
    flights: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=0,
            max=100_000,
            help=(
                "Number of simulated flights for a problem with bounded errors, half of them with "
                "errors at their bounds. Default: 100 of affine feedback, and 10 of --replan."
            ),
        ),
    ] = None
    seed: Seed = 0
    csv: Csv = None
    html: Html = None
