"""`infoset multipoint`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import typer

from infoset.experiments.common.options import Csv, FileOptions, Html, ProblemName, Settings


@dataclass(frozen=True)
class Multipoint(FileOptions):
    """Visit several moving targets with minimum energy.

    Each target is visited by a flyby or a rendezvous. With --order best and --times given, the
    times of the file are kept and the targets are exchanged: the target that is visited first has
    the earliest time. With max_control_m_s2 in the problem, the control stays within this bound at
    all times. Without --out, --json, --csv or --html no file is written.

    Axes: with orbit_rate_rad_s, x radially outward, y along the motion, z along the orbit's normal;
    otherwise inertial.
    """

    problem: ProblemName = "service-3"
    settings: Settings = None
    order: Annotated[
        Literal["given", "best"],
        typer.Option(help="Order of the targets: that of the file, or the best one found."),
    ] = "given"
    times: Annotated[
        Literal["given", "best"] | None,
        typer.Option(
            help=(
                "Times of the visits: those of the file, or the best ones found. Default: as in "
                "the file."
            )
        ),
    ] = None
    csv: Csv = None
    html: Html = None
