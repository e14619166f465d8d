"""Public interface of the package `experiments`: files, functions that take scenarios by name, and figures.

Every name is loaded when it is first used, so that the command line starts without heavy libraries.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.common.input_file import load_problem
    from experiments.interception.figures.bound import draw_bound
    from experiments.interception.figures.commands import plot
    from experiments.interception.figures.process import draw_process
    from experiments.interception.figures.sets import draw_sets
    from experiments.interception.python_interface import find_worst, fly_one, lower_bound, save, simulate
    from experiments.interception.record_file import load_record
    from experiments.interception.scenario_file import load_scenario
    from experiments.pareto.figures import draw_trajectories
    from experiments.pursuit.figures import draw_distance

_NAMES = {
    "common.input_file": ("load_problem",),
    "interception.scenario_file": ("load_scenario",),
    "interception.record_file": ("load_record",),
    "interception.python_interface": ("find_worst", "fly_one", "lower_bound", "save", "simulate"),
    "interception.figures.commands": ("plot",),
    "interception.figures.bound": ("draw_bound",),
    "interception.figures.process": ("draw_process",),
    "interception.figures.sets": ("draw_sets",),
    "pareto.figures": ("draw_trajectories",),
    "pursuit.figures": ("draw_distance",),
}
"""Public names by module."""

__all__ = [
    "draw_bound",
    "draw_distance",
    "draw_process",
    "draw_sets",
    "draw_trajectories",
    "find_worst",
    "fly_one",
    "load_problem",
    "load_record",
    "load_scenario",
    "lower_bound",
    "plot",
    "save",
    "simulate",
]


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> object:
    """Load a public name when it is first used."""
    for module, names in _NAMES.items():
        if name in names:
            return getattr(import_module(f"experiments.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
