"""Options and arguments of the commands that simulate interceptions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

MOST_RUNS = 10_000_000

ScenarioName = Annotated[
    str, typer.Argument(metavar="[SCENARIO]", help="A built-in scenario (see: infoset scenarios), or a scenario file.")
]
StrategyName = Annotated[
    str | None,
    typer.Option(
        "--strategy",
        metavar="NAME",
        help="Guidance strategy: a built-in name, or FILE.py:CLASS for a class in a Python file. Default: that of the "
        "scenario.",
    ),
]
Strategies = Annotated[
    str | None,
    typer.Option(
        "--strategies",
        metavar="A,B,C",
        help="Strategies, separated by commas: built-in names, or FILE.py:CLASS for a class in a Python file; or all, "
        "for all built-in names. Default: symmetric-miss, patient, zero-effort-miss, kalman, least-squares, pn-kalman, "
        "apn-kalman and predictive-kalman.",
    ),
]
ModelName = Annotated[
    Literal["paper", "guaranteed"] | None,
    typer.Option(
        "--model",
        help="Model of the information set. Default: that of the scenario. A model other than the scenario's starts "
        "from its default initial set.",
    ),
]
StudyModel = Annotated[
    Literal["paper", "guaranteed"] | None,
    typer.Option(
        "--model",
        help="Model of the information set, whatever the scenario file says. A model other than the file's starts from "
        "its default initial set.",
        show_default="guaranteed",
    ),
]
TieName = Annotated[
    Literal["upper", "lower", "alternate", "random"] | None,
    typer.Option("--tie", help="How game noise breaks ties."),
]
RangeMeter = Annotated[
    bool | None,
    typer.Option("--range-meter/--no-range-meter", help="Simulate with or without the scenario's range meter."),
]
SetTimes = Annotated[
    str | None,
    typer.Option(
        "--times",
        metavar="T1,T2,...",
        help="Times of the sets in figure 3 of --out, s, separated by commas; the nearest step is drawn. Default: "
        "0.5,4,8.",
    ),
]
RecordFile = Annotated[
    Path | None, typer.Option("--record", metavar="FILE.npz", help="Write the record of the engagement.")
]
