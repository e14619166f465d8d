"""`infoset adversary`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import Json, Overwrite, Quiet, Seed, Settings
from experiments.interception.options import (
    MOST_RUNS,
    RangeMeter,
    RecordFile,
    ScenarioName,
    StrategyName,
    StudyModel,
)


@dataclass(frozen=True)
class Adversary:
    """Search for the initial state and the measurement errors that give the greatest miss of a strategy.

    The search covers all initial states that the scenario allows, and all errors within their bounds. The result is a
    simulated miss: the strategy cannot guarantee a smaller one, and greater misses may exist. The same seed and budget
    give the same result. Without --json or --record no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    strategy: StrategyName = None
    model: StudyModel = None
    range_meter: RangeMeter = None
    budget: Annotated[
        int, typer.Option(metavar="N", min=1, max=MOST_RUNS, help="Number of engagements to simulate.")
    ] = 2000
    keep_set: Annotated[
        bool, typer.Option("--keep-set", help="Consider only engagements in which the set never became empty.")
    ] = False
    seed: Seed = 0
    record: RecordFile = None
    json: Json = None
    overwrite: Overwrite = False
    quiet: Quiet = False
