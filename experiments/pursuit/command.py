"""`infoset pursuit` and `infoset pursuit-map`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from infoset.experiments.common.options import Csv, FileOptions, Html, ProblemName, Seed, Settings


@dataclass(frozen=True)
class Pursuit(FileOptions):
    """Solve the game of a pursuing and an evading spacecraft.

    The pursuer minimizes the time of capture, and the evader maximizes it. Each capture has a
    certificate (a list of checks). The result is called a saddle point only if no check fails. The
    check with the longest computation, a search in all directions, is made with --certify only.
    Without --out, --json, --csv or --html no file is written.

    Axes: inertial, z along the planet's axis. Figures and pages also show the pursuer relative to
    the evader: x radially outward, y along the motion, z along the orbit's normal (Hill's).
    """

    problem: ProblemName = "geo-pursuit"
    settings: Settings = None
    certify: Annotated[
        bool,
        typer.Option(
            "--certify",
            help=(
                "Add the last check of the certificate: search all directions at the capture for "
                "a solution in which the evader keeps a larger distance."
            ),
        ),
    ] = False
    feedback: Annotated[
        str | None,
        typer.Option(
            metavar="POLICY",
            help=(
                "Simulate a pursuer that replans and an evader that follows this policy: optimal, "
                "random, coast, prograde, retrograde, normal, antinormal, outward or inward."
            ),
        ),
    ] = None
    replan_s: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            min=1.0,
            help=(
                "Time between plans, s. Default: 600 s, or 1/50 of the duration of the game if "
                "that is shorter."
            ),
        ),
    ] = None
    delay_s: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Delay of the pursuer's observation, s.")
    ] = 0.0
    position_noise_m: Annotated[
        float,
        typer.Option(
            metavar="M", min=0.0, help="Standard deviation of each observed position component, m."
        ),
    ] = 0.0
    velocity_noise_m_s: Annotated[
        float,
        typer.Option(
            metavar="M/S",
            min=0.0,
            help="Standard deviation of each observed velocity component, m/s.",
        ),
    ] = 0.0
    runs: Annotated[
        int,
        typer.Option(metavar="N", min=1, max=10_000, help="Number of simulations with feedback."),
    ] = 1
    seed: Seed = 0
    csv: Csv = None
    html: Html = None


@dataclass(frozen=True)
class PursuitMap(FileOptions):
    """Solve a pursuit game on a grid of two parameters.

    A parameter is phase_deg (lead of the evader), thrust_ratio, or any key of the file. A point
    without a certified solution has no capture time. Without --out, --json or --csv no file is
    written.
    """

    problem: ProblemName = "geo-pursuit"
    columns: Annotated[
        str,
        typer.Option(
            "--x",
            metavar="KEY=FROM:TO:N",
            help="Parameter of the columns: first value, last value, number of values.",
        ),
    ] = "phase_deg=-30:30:61"
    rows: Annotated[
        str,
        typer.Option(
            "--y", metavar="KEY=FROM:TO:N", help="Parameter of the rows, in the same form."
        ),
    ] = "thrust_ratio=0:0.8:17"
    settings: Settings = None
    certify: Annotated[
        bool,
        typer.Option(
            "--certify",
            help="Follow other branches where a branch of solutions folds (slow).",
        ),
    ] = False
    csv: Csv = None
