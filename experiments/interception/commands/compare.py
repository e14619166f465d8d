"""`infoset compare`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import Csv, FileOptions, Seed, Settings
from experiments.interception.options import MOST_RUNS, RangeMeter, ScenarioName, Strategies, StudyModel


@dataclass(frozen=True)
class Compare(FileOptions):
    """Compare strategies by miss and spent impulse, with random noise and with game noise.

    Run K has the same initial state and the same random errors for all strategies. Game noise is simulated with each
    of its four tie rules, and a run is represented by the worst of the four. Run K is the same engagement as in:
    infoset engage --model guaranteed --run K.
    Without --out, --json or --csv no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    strategies: Strategies = None
    runs: Annotated[
        int, typer.Option(metavar="N", min=1, max=MOST_RUNS, help="Number of runs for each strategy and noise.")
    ] = 50
    seed: Seed = 0
    model: StudyModel = None
    range_meter: RangeMeter = None
    csv: Csv = None
