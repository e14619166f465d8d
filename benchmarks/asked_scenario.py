"""Common options of the scripts that compare strategies: scenario, model, range sensor, runs and
seed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from infoset import Model
from infoset.experiments import load_scenario
from infoset.sim import Scenario


def asked_scenario(
    description: str | None, arguments: Sequence[str] | None, *, runs: int, seed: int
) -> tuple[Scenario, int, int]:
    """Return the scenario, the number of runs and the seed of a command line."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenario", nargs="?", default="asteroid-1997")
    parser.add_argument(
        "--model", choices=[model.value for model in Model], default=Model.GUARANTEED.value
    )
    parser.add_argument("--no-range-sensor", action="store_true")
    parser.add_argument("--runs", type=int, default=runs)
    parser.add_argument("--seed", type=int, default=seed)
    options = parser.parse_args(arguments)
    scenario = load_scenario(options.scenario)
    kind = Model(options.model)
    if kind is not scenario.information_set.model:
        settings = replace(scenario.information_set, model=kind, initial_set=None)
        scenario = replace(scenario, information_set=settings)
    if options.no_range_sensor:
        scenario = replace(scenario, range_sensor=None)
    return scenario, options.runs, options.seed
