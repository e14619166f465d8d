"""`infoset campaign`, `infoset sweep` and `infoset report`: options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from infoset.experiments.common.options import (
    Csv,
    FileOptions,
    Json,
    Overwrite,
    Quiet,
    Seed,
    Settings,
)
from infoset.experiments.interception.command import (
    MAX_RUNS,
    ModelName,
    NoiseName,
    RangeSensor,
    ScenarioName,
    StrategyName,
    run_count,
)

MAX_WORKERS = 1024
"""Maximum number of workers: more cores than a machine has; more would be a typing error."""
MAX_AT_ONCE = 1_000_000
"""Maximum number of runs in a shard, which a worker keeps in memory: 0.2 GB."""

Required = Annotated[
    str | None,
    typer.Option(
        "--require",
        metavar="RULE",
        help=(
            'Requirement: the upper bound of a quantile, "miss_m p99<10" (without a quantile p99: '
            '"miss_m<10"), or the minimum probability of a hit, "hit>=0.95", or of no miss of a '
            'cause (engine, budget, knowledge, saturated, guidance), "no-engine>=0.99". Each cell '
            "meets it, does not meet it, or is undecided, with 95 % confidence. Default: in a "
            "report, that of the sweep; otherwise hit>=0.95 if the body has a size, else miss_m "
            "p99<10."
        ),
    ),
]


@dataclass(frozen=True, kw_only=True)
class FlightOptions:
    """Options of a campaign and of a sweep."""

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    runs: Annotated[
        int,
        typer.Option(
            metavar="N",
            parser=run_count,
            help=(
                "Number of runs; needed: the least number that can decide hit>=0.99, 535 of each "
                "noise."
            ),
        ),
    ]
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the runs; created if needed.")
    ]
    noise: NoiseName = None
    seed: Seed = 0
    strategy: StrategyName = None
    model: ModelName = None
    range_sensor: RangeSensor = None
    json: Json = None
    overwrite: Overwrite = False
    quiet: Quiet = False
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Continue the campaign in DIR; if DIR is empty, start a new one."
        ),
    ] = False
    chunk: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=MAX_AT_ONCE,
            help=(
                "Number of runs in a shard. The results of a run do not depend on it; --until can "
                "stop at the end of a shard only. Default: depends on the number of runs."
            ),
        ),
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="W",
            min=1,
            max=MAX_WORKERS,
            help=(
                "Number of cores of this machine to use: by threads, or by processes in a long "
                "campaign. Default: all."
            ),
        ),
    ] = None
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help=(
                "Simulate on a Dask cluster: address of its scheduler, for example tcp://host:8786."
            ),
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class CampaignOptions(FlightOptions):
    """Simulate a campaign: thousands of runs, stored in a folder.

    The runs are stored in DIR in shards (files of many runs). A shard is written as soon as its
    runs are complete. After any interruption, the same command with --resume continues the
    campaign; with a greater --runs it extends the campaign. The numbers of a run depend only
    on the scenario, the noise, the strategy, the seed and its number, not on workers, shards or
    interruptions. With --noise mixed, even runs have random noise and odd ones game noise. Run K
    with a noise is the same engagement as in: infoset engage DIR/scenario.toml --noise NOISE --seed
    SEED --run K. To see the results: infoset report DIR.
    """

    until: Annotated[
        str | None,
        typer.Option(
            metavar="RULE",
            help=(
                "Stop when the 95 % confidence interval of a quantile is narrow enough, for "
                'example "miss_m p99 ci<0.5" (m).'
            ),
        ),
    ] = None
    guarantee: Annotated[
        bool,
        typer.Option(
            "--guarantee/--no-guarantee",
            help=(
                "Compute the bound Phi in the model guaranteed (1.1 to 1.9 times the time, with "
                "rates up to 9)."
            ),
        ),
    ] = True
    csv: Csv = None


@dataclass(frozen=True, kw_only=True)
class Sweep(FlightOptions):
    """Find the values of a scenario's keys that meet a requirement.

    For example, to find which sensor and which engine hit a body of a given size. Each combination
    of values is a cell. It meets the requirement, does not meet it, or is undecided. All cells have
    the same initial states and random errors, and are stored like a campaign. DIR contains the
    runs; one table, sweep.parquet, with one row for each cell; and a figure for each noise: lines
    for one key, maps for two keys. With --noise mixed, even runs have random noise and odd ones
    game noise.

    Forms of --vary: KEY=FROM:TO:COUNT, equal spacing; KEY=log:FROM:TO:COUNT, logarithmic spacing;
    KEY1=KEY2=FROM:TO:COUNT, two keys with the same values; KEY.min or KEY.max, an end of a pair;
    angle_sensor.scale, a factor of all error bounds of a sensor. For example: --vary
    angle_sensor.scale=1:8:8 --vary thruster.max_impulse_m_s=2.5:20:8.
    """

    runs: Annotated[
        int,
        typer.Option(
            metavar="N",
            parser=run_count,
            help=(
                "Number of runs of each cell; needed: the least number that can decide the "
                "requirement, of each noise."
            ),
        ),
    ] = 400
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the runs; created if needed.")
    ] = Path("sweep")
    vary: Annotated[
        list[str],
        typer.Option(
            metavar="KEY=VALUES,...",
            help=(
                "Keys of the scenario file and their values, in the units of the keys; the forms "
                "are above. Can be repeated."
            ),
        ),
    ]
    require: Required = None
    until: Annotated[
        Literal["decided"] | None,
        typer.Option(
            help=(
                "decided: add runs to each cell until the requirement is met or not met there, at "
                "most --max-runs. The confidence of the decisions holds although runs are added."
            )
        ),
    ] = None
    max_runs: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=MAX_RUNS,
            help="Maximum number of runs of a cell with --until; at least --runs. Default: 2000.",
        ),
    ] = None
    guarantee: Annotated[
        bool,
        typer.Option(
            "--guarantee/--no-guarantee", help="Compute the bound Phi in the model guaranteed."
        ),
    ] = False


@dataclass(frozen=True)
class ReportOptions(FileOptions):
    """Report on a stored campaign or sweep.

    The campaign or sweep may be incomplete. For a campaign: quantiles with 95 % confidence
    intervals, outcomes of the runs, correlation of the miss with the initial state, and the ten
    worst runs, each with the command that simulates it again; with --out, figures of the
    distributions, of the convergence of the quantiles, and of the miss against the initial state.
    For a sweep: the values that meet the requirement; with --out, the table and the figures.
    --require is for sweeps. Without --out, --json or --csv no file is written.
    """

    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder written by infoset campaign or infoset sweep."),
    ]
    require: Required = None
    csv: Csv = None
