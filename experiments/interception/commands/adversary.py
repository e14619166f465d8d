"""`infoset adversary`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import FileOptions, Seed, Settings
from experiments.interception.options import (
    MOST_RUNS,
    RangeMeter,
    RecordFile,
    ScenarioName,
    StrategyName,
    StudyModel,
)


@dataclass(frozen=True)
class Adversary(FileOptions):
    """Search for the initial state and the measurement errors that give the greatest miss of a strategy.

    The search covers all initial states that the scenario allows, and all errors within their bounds. The result is a
    simulated miss: the strategy cannot guarantee a smaller one, and greater misses may exist. If the set became empty
    in some engagements, a second search includes them, and both greatest misses are printed. The same seed and budget
    give the same result, also in infoset bound. Without --out, --json or --record no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    strategy: StrategyName = None
    model: StudyModel = None
    range_meter: RangeMeter = None
    budget: Annotated[
        int, typer.Option(metavar="N", min=1, max=MOST_RUNS, help="Number of engagements in a search.")
    ] = 2000
    keep_set: Annotated[
        bool,
        typer.Option("--keep-set", help="Record and draw the worst engagement in which the set never became empty."),
    ] = False
    seed: Seed = 0
    record: RecordFile = None
