"""`infoset experiment`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import Csv, FileOptions, Seed
from experiments.interception.options import MOST_RUNS, ModelName, ScenarioName, StrategyName, TieName


@dataclass(frozen=True)
class Experiment(FileOptions):
    """Simulate four curves of many runs: random and game noise, each without and with the range meter.

    All curves have the same starts and errors, run by run. Run K is the same engagement as in: infoset engage --run K.
    Without --out, --json or --csv no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    runs: Annotated[int, typer.Option(metavar="N", min=1, max=MOST_RUNS, help="Number of runs per curve.")] = 50
    seed: Seed = 0
    strategy: StrategyName = None
    model: ModelName = None
    tie: TieName = None
    sections: Annotated[
        int | None, typer.Option(metavar="N", help="Number of sections at the start, in place of the scenario's.")
    ] = None
    csv: Csv = None
