"""What the commands that fly have in common: their options, and what is made of them. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.errors import InputError

if TYPE_CHECKING:
    from sim import Scenario

MOST_RUNS = 10_000_000


def _page_path(path: Path | None) -> Path | None:
    if path is not None and path.suffix != ".html":
        raise InputError(f"--html: {path} must end in .html; for example --html page.html")
    return path


ScenarioName = Annotated[
    str,
    typer.Argument(metavar="[SCENARIO]", help="A built-in scenario (see: infoset scenarios), or a scenario file."),
]
ProblemName = Annotated[
    str, typer.Argument(metavar="[PROBLEM]", help="A built-in problem (see: infoset problems list), or a problem file.")
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="N", min=0, help="Root seed. The same seed gives the same random numbers.")
]
StrategyName = Annotated[
    str | None, typer.Option("--strategy", metavar="NAME", help="Guidance strategy, in place of the scenario's.")
]
Strategies = Annotated[
    str | None,
    typer.Option("--strategies", metavar="A,B,C", help="Which, separated by commas; all there are by default."),
]
ModelName = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="NAME",
        help="Model of the information set, in place of the scenario's; another one starts from its own initial set.",
    ),
]
TieName = Annotated[
    str | None,
    typer.Option(
        "--tie", metavar="RULE", help="What game noise does between equals: upper, lower, alternate or random."
    ),
]
RangeMeter = Annotated[
    bool | None,
    typer.Option(
        "--range-meter/--no-range-meter", help="Fly with it or without; by default as the scenario's file has it."
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for figures and results; made if it is not there.")
]
Json = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write results as JSON; - prints it alone on stdout.")
]
Csv = Annotated[
    Path | None, typer.Option("--csv", metavar="FILE", help="Write a table as CSV; - prints it alone on stdout.")
]
Html = Annotated[
    Path | None,
    typer.Option(
        "--html",
        metavar="FILE.html",
        callback=_page_path,
        help="Write an interactive page: one file that opens in any browser, offline.",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files, and write into a folder that has some.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress and no tables.")]


def scenario_with(
    name: str,
    *,
    strategy: str | None = None,
    model: str | None = None,
    tie: str | None = None,
    sections: int | None = None,
) -> Scenario:
    """Read a scenario, and put what the options say in place of what it says.

    Parameters
    ----------
    name : str
        A built-in name or a path.
    strategy, model, tie : str or None
        Names; None keeps the scenario's.
    sections : int or None
        Number of sections at the start.

    Returns
    -------
    Scenario

    Raises
    ------
    InputError
        If the scenario is unsound, or there is no such name or number.
    """
    from experiments.interception.scenario_file import default_initial_set, load_scenario
    from guidance import TieRule, strategy_names
    from infoset import Model

    scenario = load_scenario(name)
    if strategy is not None:
        scenario = replace(scenario, strategy=choice("--strategy", strategy, strategy_names()))
    if tie is not None:
        scenario = replace(scenario, tie=TieRule(choice("--tie", tie, [each.value for each in TieRule])))
    set_model = scenario.set_model
    if model is not None:
        kind = Model(choice("--model", model, [each.value for each in Model]))
        if kind is not set_model.kind:
            set_model = replace(set_model, kind=kind, initial_set=default_initial_set(kind))
    if sections is not None:
        from infoset.model import MOST_SECTIONS

        fewest = set_model.fewest_sections
        if not fewest <= sections <= MOST_SECTIONS:
            raise InputError(
                f"--sections: must be from {fewest}, the scenario's information_set.fewest_sections, to "
                f"{MOST_SECTIONS}, found {sections}; for example --sections {max(29, fewest)}"
            )
        set_model = replace(set_model, sections=sections)
    return replace(scenario, set_model=set_model)


def with_range_meter(scenario: Scenario, range_meter: bool | None) -> Scenario:
    """Return a scenario with its range meter, or without; as it is where nothing is said.

    Parameters
    ----------
    scenario : Scenario
    range_meter : bool or None

    Returns
    -------
    Scenario

    Raises
    ------
    InputError
        If it has none.
    """
    if range_meter and scenario.range_sensor is None:
        raise InputError(
            f"--range-meter: the scenario {scenario.name} has no [range_sensor]; add that table to its file, for "
            "example period_s = 2.0 and relative_error = 0.05, or leave --range-meter out"
        )
    return replace(scenario, range_sensor=None) if range_meter is False else scenario


def choice(option: str, name: str, valid: Sequence[str]) -> str:
    """Return a name if it is one of those there are.

    Parameters
    ----------
    option : str
        What it was given to.
    name : str
    valid : sequence of str

    Returns
    -------
    str

    Raises
    ------
    InputError
        If it is none of them; the nearest is suggested.
    """
    if name in valid:
        return name
    from experiments.common.toml_values import nearest, shown

    guess = nearest(name, list(valid))
    hint = f"did you mean {guess}? " if guess else ""
    raise InputError(f"{option}: there is no {shown(name)}; {hint}choose one of: {', '.join(valid)}")


def chosen_strategies(names: str | None) -> list[str]:
    """Return the strategies of a list of names.

    Parameters
    ----------
    names : str or None
        Names separated by commas; None is all there are.

    Returns
    -------
    list of str

    Raises
    ------
    InputError
        If there is no such strategy, or one is named twice.
    """
    from guidance import strategy_names

    valid = strategy_names()
    if names is None:
        return valid
    chosen = [choice("--strategies", each.strip(), valid) for each in names.split(",")]
    if len(set(chosen)) < len(chosen):
        (twice, *_) = [each for each in chosen if chosen.count(each) > 1]
        raise InputError(f"--strategies: {twice} is named twice; name each strategy once")
    return chosen


def whole_number(option: str, value: int, least: int, greatest: int | None, example: int) -> int:
    """Return a whole number if it lies where it must.

    Parameters
    ----------
    option : str
        What it was given to.
    value, least : int
    greatest : int or None
    example : int
        A sound one, for the message.

    Returns
    -------
    int

    Raises
    ------
    InputError
        If it lies outside.
    """
    if value >= least and (greatest is None or value <= greatest):
        return value
    limits = f"at least {least}" if greatest is None else f"from {least} to {greatest}"
    digits = str(value) if abs(value) < 10**20 else "a number of more than 20 digits"
    raise InputError(f"{option}: must be {limits}, found {digits}; for example {option} {example}")
