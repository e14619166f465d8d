"""`infoset experiment`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import Csv, FileOptions, Seed, Settings
from experiments.interception.options import MOST_RUNS, ModelName, ScenarioName, StrategyName, TieName


@dataclass(frozen=True)
class Experiment(FileOptions):
    """Simulate many runs of four cases (curves): random or game noise, without or with the range meter.

    Game noise is measurement errors chosen against the guidance. Run K starts from the same state in all four cases,
    and is the same engagement as in: infoset engage --run K. Without --out, --json or --csv no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    runs: Annotated[int, typer.Option(metavar="N", min=1, max=MOST_RUNS, help="Number of runs of each case.")] = 50
    seed: Seed = 0
    strategy: StrategyName = None
    model: ModelName = None
    tie: TieName = None
    sections: Annotated[
        int | None, typer.Option(metavar="N", help="Number of sections at t = 0. Default: that of the scenario.")
    ] = None
    csv: Csv = None
