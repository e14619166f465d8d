"""The scenario and the strategies that the options of a command choose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from experiments.common.errors import InputError
from experiments.common.options import choice
from experiments.interception.own_strategy import is_own_strategy, own_strategy
from experiments.interception.scenario_file import load_scenario, with_model
from guidance import Strategy, TieRule, strategy_names
from infoset import Model
from infoset.model import MAX_SECTIONS
from sim import Scenario
from sim.scenario import strategy_name


def scenario_with(options: Any) -> Scenario:
    """Read the scenario of a command and replace what its options set; None keeps the value of the scenario.

    The command may have the options `strategy`, `model`, `tie`, `sections` and `range_sensor`. ``--strategy
    FILE.py:CLASS`` leaves the strategy of the scenario; `own_strategy` returns it. Raise `InputError` if the scenario
    is unsound, or an option does not fit it.
    """
    strategy, model, tie, sections, range_sensor = (
        getattr(options, name, None) for name in ("strategy", "model", "tie", "sections", "range_sensor")
    )
    scenario = load_scenario(options.scenario, options.settings)
    if strategy is not None and not is_own_strategy(strategy):
        scenario = replace(scenario, strategy=choice("--strategy", strategy, strategy_names()))
    if tie is not None:
        scenario = replace(scenario, tie=TieRule(tie))
    if range_sensor and scenario.range_sensor is None:
        raise InputError(
            f"--range-sensor: the scenario {scenario.name} has no [range_sensor]; add that table to its file, for "
            "example period_s = 2.0 and relative_error = 0.05, or omit --range-sensor"
        )
    if range_sensor is False:
        scenario = replace(scenario, range_sensor=None)
    if model is not None:
        scenario = with_model(scenario, Model(model))
    settings = scenario.information_set
    if sections is not None:
        fewest = settings.fewest_sections
        if not fewest <= sections <= MAX_SECTIONS:
            raise InputError(
                f"--sections: must be from {fewest}, the scenario's information_set.fewest_sections, to "
                f"{MAX_SECTIONS}, found {sections}; for example --sections {max(29, fewest)}"
            )
        settings = replace(settings, sections=sections)
    return replace(scenario, information_set=settings)


def study_scenario(options: Any, resumed: Model | None = None) -> tuple[Scenario, list[str]]:
    """Return the scenario of a study, whose default model is the guaranteed one, whatever the scenario file says.

    With the model `paper`, quantiles can include runs whose set lost the true state. The list contains a line for the
    screen if the default replaces the model of the file. ``--model`` and ``--set`` may choose the model; if a folder is
    resumed, its model is the default.
    """
    scenario = scenario_with(options)
    chosen = any(text.partition("=")[0].strip() == "information_set.model" for text in options.settings or ())
    of_file, default = scenario.information_set.model.value, resumed or Model.GUARANTEED
    if chosen or options.model is not None or default.value == of_file:
        return scenario, []
    try:
        changed = with_model(scenario, default)
    except InputError as error:
        raise InputError(f"{error}; or choose the model of the file with --model {of_file}") from None
    if resumed:
        return changed, [f"model: {default.value}, the model of the resumed folder; the scenario file has {of_file}"]
    return changed, [f"model: {default.value}, the default of studies; to use that of the file, add --model {of_file}"]


def chosen_strategies(scenario: Scenario, names: str | None) -> Mapping[str, Strategy | None]:
    """Return the strategies of a list: by name, with the strategy of a Python file, None for a built-in one.

    `names` are built-in names and ``FILE.py:CLASS``, separated by commas; None is all built-in strategies. Raise
    `InputError` if there is no such strategy, or one is named twice.
    """
    valid = strategy_names()
    chosen: dict[str, Strategy | None] = {}
    for text in valid if names is None else [part.strip() for part in names.split(",")]:
        own = own_strategy(text, scenario, "--strategies")
        name = choice("--strategies", text, valid) if own is None else strategy_name(scenario, own)
        if name in chosen:
            raise InputError(f"--strategies: {name} is named twice; name each strategy once")
        chosen[name] = own
    return chosen
