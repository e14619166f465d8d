"""`infoset campaign`, `infoset sweep` and `infoset report`: options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from experiments.common.options import Json, Out, Overwrite, Quiet, Seed
from experiments.interception.options import MOST_RUNS, ModelName, RangeMeter, ScenarioName, StrategyName, TieName

MOST_WORKERS = 1024
MOST_AT_ONCE = 1_000_000
EXECUTION = "Execution"

Required = Annotated[
    str,
    typer.Option("--require", metavar="RULE", help="Bound of a quantile, drawn as a contour."),
]
Shown = Annotated[
    str | None,
    typer.Option(
        metavar="QUANTILES",
        help='Quantiles to draw, separated by commas, for example "miss_m p99,impulse_m_s p90"; '
        "p50 and p99 of miss and impulse by default.",
    ),
]


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Options of a campaign and of a sweep."""

    scenario: ScenarioName = "asteroid-1997"
    runs: Annotated[int, typer.Option(metavar="N", min=1, max=MOST_RUNS, help="Engagements, of each cell in a sweep.")]
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the runs, shard by shard; made if it does not exist.")
    ]
    noise: Annotated[
        Literal["random", "game", "mixed"] | None,
        typer.Option(
            help="Measurement noise, in place of the scenario's; mixed: random in even runs, game in odd ones."
        ),
    ] = None
    seed: Seed = 0
    strategy: StrategyName = None
    model: ModelName = None
    tie: TieName = None
    range_meter: RangeMeter = None
    json: Json = None
    overwrite: Overwrite = False
    quiet: Quiet = False
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", rich_help_panel=EXECUTION, help="Continue the campaign in DIR; an empty DIR starts a new one."
        ),
    ] = False
    chunk: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=MOST_AT_ONCE,
            rich_help_panel=EXECUTION,
            help="Engagements of a shard; it changes no number. By default it suits the number of runs.",
        ),
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="W",
            min=1,
            max=MOST_WORKERS,
            rich_help_panel=EXECUTION,
            help="Threads on this machine; one a core by default.",
        ),
    ] = None
    processes: Annotated[
        int | None,
        typer.Option(
            metavar="W",
            min=1,
            max=MOST_WORKERS,
            rich_help_panel=EXECUTION,
            help="Processes on this machine in place of threads: faster for long campaigns.",
        ),
    ] = None
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            rich_help_panel=EXECUTION,
            help="Fly on a Dask cluster: the address of its scheduler, as tcp://host:8786.",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class Campaign(Flight):
    """Fly a campaign: thousands of engagements, each stored in DIR as soon as its shard is complete.

    After an interruption of any kind, --resume continues with the same command line; more runs extend the campaign.
    The numbers depend on the scenario, the seed and the run only, not on workers, shards or interruptions. Run K of a
    noise is the same engagement as: infoset engage --noise NOISE --run K. See the results with: infoset report DIR.
    """

    until: Annotated[
        str | None,
        typer.Option(
            metavar="RULE",
            help='Stop once the 95 % confidence interval of a quantile is narrow enough: "miss_m p99 ci<0.5".',
        ),
    ] = None
    guarantee: Annotated[
        bool,
        typer.Option(
            "--guarantee/--no-guarantee",
            help="Compute the bound Phi in the model guaranteed (doubles the run time).",
        ),
    ] = True


@dataclass(frozen=True, kw_only=True)
class Sweep(Flight):
    """Sweep values of a scenario: which sensor, which engine is needed for 99 % of the runs under 10 m?

    Every combination of the values is flown with the same starts and errors, and stored as a campaign is. DIR gets one
    table, sweep.parquet, with a row for each cell; a figure of lines (one key) or heat maps (two); and the runs.
    """

    vary: Annotated[
        str,
        typer.Option(
            metavar="KEY=FROM:TO:COUNT,...",
            help="Numeric keys of the scenario file, in its units; KEY=log:FROM:TO:COUNT spaces them evenly in the "
            "logarithm. Of a pair KEY.least or KEY.greatest is varied.",
        ),
    ]
    require: Required = "miss_m p99<10"
    show: Shown = None
    guarantee: Annotated[
        bool,
        typer.Option("--guarantee/--no-guarantee", help="Compute the bound Phi in the model guaranteed."),
    ] = False
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask before a sweep of more than a million engagements.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class Report:
    """Report on a campaign or a sweep, finished or not, from its files only.

    Of a campaign: quantiles with 95 % intervals, how the runs ended, the correlation of the miss with the initial
    state, and the worst ten runs with the command that flies each again; with --out figures of the distributions, of
    the convergence of the quantiles, and of the miss over the initial state. Of a sweep: where the requirement is met,
    with --out the table and the figure. --require and --show are for sweeps. Without --out or --json no file is
    written.
    """

    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of infoset campaign or infoset sweep.")]
    require: Required = "miss_m p99<10"
    show: Shown = None
    out: Out = None
    json: Json = None
    overwrite: Overwrite = False
    quiet: Quiet = False
