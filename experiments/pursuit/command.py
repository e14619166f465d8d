"""`infoset pursuit` and `infoset pursuit-map`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import Csv, FileOptions, Html, ProblemName, Seed, finite

ROWS = "thrust_ratio=0:0.8:17"

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Replace a value of the problem, for example evader.thrust_N=5; repeatable."
    ),
]


@dataclass(frozen=True)
class Pursuit(FileOptions):
    """Solve the game of two spacecraft in which the pursuer minimizes the time of capture and the evader maximizes it.

    Every capture has a certificate; a saddle point is claimed only if all its checks hold. Without --out, --json or
    --html no file is written.
    """

    problem: ProblemName = "geo-pursuit"
    settings: Settings = None
    certify: Annotated[
        bool,
        typer.Option(
            "--certify", help="Also search all directions for a branch on which the evader keeps a larger distance."
        ),
    ] = False
    feedback: Annotated[
        str | None,
        typer.Option(
            metavar="POLICY",
            help="Simulate a pursuer that replans against an evader with this policy: optimal, random, coast, "
            "prograde, retrograde, normal, antinormal, outward, inward, or a CSV file with lines time_s,policy.",
        ),
    ] = None
    replan_s: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            min=1.0,
            callback=finite,
            help="Time between plans. Default: 600 s, or a fiftieth of a game shorter than 30 000 s.",
        ),
    ] = None
    delay_s: Annotated[
        float, typer.Option(metavar="S", min=0.0, callback=finite, help="Age of the pursuer's observation.")
    ] = 0.0
    position_noise_m: Annotated[
        float,
        typer.Option(
            metavar="M", min=0.0, callback=finite, help="Standard deviation of each observed position component."
        ),
    ] = 0.0
    velocity_noise_m_s: Annotated[
        float,
        typer.Option(
            metavar="M/S", min=0.0, callback=finite, help="Standard deviation of each observed velocity component."
        ),
    ] = 0.0
    runs: Annotated[int, typer.Option(metavar="N", min=1, max=10_000, help="Number of simulations with feedback.")] = 1
    seed: Seed = 0
    html: Html = None


@dataclass(frozen=True)
class PursuitMap(FileOptions):
    """Solve a game on a grid of two parameters: phase_deg (the evader's lead), thrust_ratio, mass_ratio, or any key.

    Each point starts from the solutions of its neighbours; some points are solved from scratch to check the others.
    A point without a certified solution has no capture time. Without --out, --json or --csv no file is written.
    """

    problem: ProblemName = "geo-pursuit"
    columns: Annotated[
        str | None,
        typer.Option(
            "--x",
            metavar="KEY=FROM:TO:N",
            help="Parameter of the columns, first and last value, number of values. Default: phases that suit the "
            "pursuer's thrust.",
        ),
    ] = None
    rows: Annotated[str, typer.Option("--y", metavar="KEY=FROM:TO:N", help="The same for the rows.")] = ROWS
    settings: Settings = None
    certify: Annotated[
        bool,
        typer.Option(
            "--certify", help="Solve every point from scratch, with other branches where a branch folds (slow)."
        ),
    ] = False
    csv: Csv = None
