"""`infoset engage`: options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from experiments.common.options import Csv, FileOptions, Seed, Settings
from experiments.interception.options import MOST_RUNS, ModelName, RangeMeter, ScenarioName, StrategyName, TieName


@dataclass(frozen=True)
class Engage(FileOptions):
    """Simulate one engagement and show its result; with --noise both, one with each kind of noise.

    Run K has exactly the same numbers as run K of infoset experiment with the same seed.
    Without --out, --json, --csv or --record no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    noise: Annotated[
        Literal["random", "game", "both"] | None, typer.Option(help="Measurement noise. Default: that of the scenario.")
    ] = None
    range_meter: RangeMeter = None
    strategy: StrategyName = None
    model: ModelName = None
    tie: TieName = None
    seed: Seed = 0
    run: Annotated[int, typer.Option(metavar="K", min=0, max=MOST_RUNS - 1, help="Number of the run, from 0.")] = 0
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.npz", help="Write the record; with --noise both, FILE-random.npz and FILE-game.npz."
        ),
    ] = None
    csv: Csv = None
