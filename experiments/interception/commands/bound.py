"""`infoset bound`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from experiments.common.options import FileOptions, Seed, Settings
from experiments.interception.options import MOST_RUNS, ScenarioName, Strategies, StudyModel


@dataclass(frozen=True)
class Bound(FileOptions):
    """Compute a lower bound of the guaranteed miss of all strategies, and simulate the pairs of states that prove it.

    Two true states whose measurements are equal until some step receive equal impulses until that step, so at least
    one of them misses. The bound is the greatest miss that such pairs prove. Each strategy is simulated with these
    pairs, and in the searches of infoset adversary. Without --out or --json no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    strategies: Strategies = None
    model: StudyModel = None
    budget: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            max=MOST_RUNS,
            help="Number of engagements in the search for the worst one, for each strategy; 0 skips the search.",
        ),
    ] = 500
    seed: Seed = 0
