"""Options of `infoset experiment`, `engage`, `compare`, `bound`, `adversary` and `replay`.

The default numbers of runs and of engagements are chosen.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from infoset.experiments.common.errors import shown
from infoset.experiments.common.options import (
    Csv,
    FileOptions,
    Html,
    Out,
    Overwrite,
    Quiet,
    Seed,
    Settings,
)

MAX_RUNS = 10_000_000
"""Maximum number of runs: one miss in so many runs is a share of hits of 99.99999 %, the last of
`study.WANTED_SHARES`."""

NEEDED = 0
"""Value of ``runs`` for ``--runs needed``: no study has zero runs."""


def run_count(text: Any) -> int:
    """Return the number of runs of the option ``--runs``; `NEEDED` for the word ``needed``.

    `text` is the default value, a number, if the option is not given.
    """
    if text == "needed":
        return NEEDED
    try:
        count = int(text)
    except ValueError:
        count = 0
    if not 1 <= count <= MAX_RUNS:
        raise typer.BadParameter(
            f"must be a whole number from 1 to {MAX_RUNS}, or needed: got {shown(text)}"
        )
    return count


ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO", help="A built-in scenario (see: infoset scenarios), or a scenario file."
    ),
]
StrategyName = Annotated[
    str | None,
    typer.Option(
        "--strategy",
        metavar="NAME",
        help=(
            "Guidance strategy: a built-in name, or FILE.py:CLASS for a class in a Python file. "
            "Default: that of the scenario."
        ),
    ),
]
Strategies = Annotated[
    str | None,
    typer.Option(
        "--strategies",
        metavar="A,B,C",
        help=(
            "Strategies, separated by commas: built-in names, or FILE.py:CLASS for a class in a "
            "Python file. Default: all built-in strategies."
        ),
    ),
]
NoiseName = Annotated[
    str | None,
    typer.Option(
        "--noise",
        metavar="NOISE",
        help=(
            "Measurement noise: random, gaussian, correlated, game, or FILE.py:CLASS for a class "
            "in a Python file. Default: that of the scenario."
        ),
    ),
]
ModelName = Annotated[
    Literal["paper", "guaranteed"] | None,
    typer.Option(
        "--model",
        help=(
            "Model of the information set. Default: that of the scenario in the commands "
            "experiment and engage, otherwise guaranteed. Another model than the scenario's "
            "starts from its default initial set."
        ),
    ),
]
RangeSensor = Annotated[
    bool | None,
    typer.Option(
        "--range-sensor/--no-range-sensor",
        help=(
            "Simulate with or without the scenario's range sensor. Default: with it, if there is "
            "one."
        ),
    ),
]
RecordFile = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE.npz", help="Write the record of the engagement."),
]


@dataclass(frozen=True)
class Experiment(FileOptions):
    """Simulate many runs with the noise of the scenario and with game noise.

    There are four cases (curves): the noise of the scenario or game noise, without or with the
    range sensor. Game noise is measurement errors chosen against the guidance. --noise replaces the
    noise of the scenario, and may not be game; if that of the scenario is game, the default is
    random. Run K starts from the same state in all four cases, and is the same engagement as in:
    infoset engage --run K. Without --out, --json or --csv no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    runs: Annotated[
        int,
        typer.Option(
            metavar="N",
            parser=run_count,
            help=(
                "Number of runs of each case; needed: the least number that can decide hit>=0.99, "
                "535."
            ),
        ),
    ] = 50
    noise: NoiseName = None
    seed: Seed = 0
    strategy: StrategyName = None
    model: ModelName = None
    remedy: Annotated[
        bool,
        typer.Option(
            "--remedy",
            help=(
                "For each cause of misses, find the least maximum impulse or budget, the earliest "
                "cut-off and the greatest errors of the angles without it, with the same random "
                "numbers; and the hits of other runs with this value."
            ),
        ),
    ] = False
    csv: Csv = None


@dataclass(frozen=True)
class Engage(FileOptions):
    """Simulate one engagement.

    With --noise both, there is one with random and one with game noise, and --record FILE.npz
    writes FILE-random.npz and FILE-game.npz. Run K has exactly the same numbers as run K of infoset
    experiment with the same seed. Without --out, --json, --csv or --record no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    noise: NoiseName = None
    range_sensor: RangeSensor = None
    strategy: StrategyName = None
    model: ModelName = None
    seed: Seed = 0
    run: Annotated[
        int, typer.Option(metavar="K", min=0, max=MAX_RUNS - 1, help="Number of the run, from 0.")
    ] = 0
    record: RecordFile = None
    csv: Csv = None


@dataclass(frozen=True)
class Compare(FileOptions):
    """Compare guidance strategies by miss and spent impulse.

    Run K has the same initial state and the same random numbers for all strategies and noises. Game
    noise is simulated with each of its four tie rules, and a run is represented by the worst of the
    four. Run K is the same engagement as in: infoset engage --model guaranteed --run K. Without
    --out, --json or --csv no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    strategies: Strategies = None
    noise: Annotated[
        str,
        typer.Option(
            metavar="A,B,C",
            help=(
                "Measurement noises, separated by commas: random, gaussian, correlated, game, "
                "FILE.py:CLASS for a class in a Python file, or all, which are the first four. "
                "Which strategy is best, and how large the misses are, may depend on them: a "
                "table shows it."
            ),
        ),
    ] = "random,game"
    runs: Annotated[
        int,
        typer.Option(
            metavar="N", min=1, max=MAX_RUNS, help="Number of runs for each strategy and noise."
        ),
    ] = 50
    seed: Seed = 0
    model: ModelName = None
    range_sensor: RangeSensor = None
    csv: Csv = None


@dataclass(frozen=True)
class Bound(FileOptions):
    """Compute a lower bound of the guaranteed miss.

    It holds for all strategies: two true states whose measurements are equal until some step
    receive equal impulses until that step, so at least one of them misses. The bound is the maximum
    miss that such pairs prove; in space, they differ along both axes. Each strategy is simulated
    with these pairs, and in the searches of infoset adversary. With information_set.wrong_images
    some images of each pair are wrong for one of the two states, and the bound without wrong images
    is printed too. In special cases the bound is the value of the game up to a reserve; the output
    has the reserve, or the conditions that are not met. Without --out or --json no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    strategies: Strategies = None
    model: ModelName = None
    budget: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            max=MAX_RUNS,
            help=(
                "Number of engagements in the search for the worst one, for each strategy; 0 "
                "skips the search, and without --strategies all simulations."
            ),
        ),
    ] = 500
    seed: Seed = 0


@dataclass(frozen=True)
class Adversary(FileOptions):
    """Search for the engagement with the maximum miss.

    The search covers all initial states that the scenario allows, all errors within their bounds
    and, in the model guaranteed, targets that accelerate at the bound of the model. Two misses of
    the worst engagement are printed: the maximum one of any state that the set contains when
    control ends, and that of the simulated truth. Greater misses may exist. If the set became empty
    in some engagements, a second search includes them, and both results are printed. The same seed
    and budget give the same result; infoset bound has the searches with --objective fixed-truth.
    Without --out, --json or --record no file is written.
    """

    scenario: ScenarioName = "asteroid-1997"
    settings: Settings = None
    strategy: StrategyName = None
    model: ModelName = None
    range_sensor: RangeSensor = None
    budget: Annotated[
        int,
        typer.Option(metavar="N", min=1, max=MAX_RUNS, help="Number of engagements in a search."),
    ] = 2000
    objective: Annotated[
        Literal["any-state", "fixed-truth"],
        typer.Option(
            help=(
                "What the search maximises: the maximum miss of any state of the set when control "
                "ends, which agrees with all measurements until then, or the miss of the "
                "simulated truth."
            )
        ),
    ] = "any-state"
    seed: Seed = 0
    record: RecordFile = None


@dataclass(frozen=True)
class Replay:
    """Show records of engagements: page, animation, figures.

    Records are written by infoset engage --record. Nothing is simulated again.
    """

    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="A.npz [B.npz]", help="One record, or two records to show side by side."
        ),
    ]
    html: Html = None
    gif: Annotated[
        Path | None, typer.Option(metavar="FILE.gif", help="Write an animation of the sets.")
    ] = None
    out: Out = None
    times: Annotated[
        str,
        typer.Option(
            metavar="T1,T2,...",
            help=(
                "Times of the sets in the figure sets of --out, s, separated by commas; the "
                "nearest step is drawn."
            ),
            show_default=(
                "0.5,4,8, or, in a flight that is long or has a schedule, evenly over the "
                "logarithm of the time to go"
            ),
        ),
    ] = ""
    overwrite: Overwrite = False
    quiet: Quiet = False
