"""Public interface of the package `infoset.experiments`: files and figures.

Every name is loaded when it is first used, so that the command line starts without heavy libraries.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from infoset.experiments.common.errors import InputError
    from infoset.experiments.common.input_file import load_problem
    from infoset.experiments.interception.figures.bound import draw_bound
    from infoset.experiments.interception.figures.commands import plot
    from infoset.experiments.interception.figures.process import draw_process
    from infoset.experiments.interception.figures.sets import draw_sets
    from infoset.experiments.interception.record_file import load_record
    from infoset.experiments.interception.result_files import load_results, save
    from infoset.experiments.interception.scenario_file import load_scenario
    from infoset.experiments.pareto.figures import draw_trajectories
    from infoset.experiments.pursuit.figures import draw_distance

_NAMES = {
    "common.errors": ("InputError",),
    "common.input_file": ("load_problem",),
    "interception.scenario_file": ("load_scenario",),
    "interception.record_file": ("load_record",),
    "interception.result_files": ("load_results", "save"),
    "interception.figures.commands": ("plot",),
    "interception.figures.bound": ("draw_bound",),
    "interception.figures.process": ("draw_process",),
    "interception.figures.sets": ("draw_sets",),
    "pareto.figures": ("draw_trajectories",),
    "pursuit.figures": ("draw_distance",),
}
"""Public names by module."""

__all__ = [
    "InputError",
    "draw_bound",
    "draw_distance",
    "draw_process",
    "draw_sets",
    "draw_trajectories",
    "load_problem",
    "load_record",
    "load_results",
    "load_scenario",
    "plot",
    "save",
]


def __dir__() -> list[str]:
    return __all__


if not TYPE_CHECKING:  # so that type checkers report a name that does not exist

    def __getattr__(name: str) -> object:
        """Load a public name when it is first used."""
        for module, names in _NAMES.items():
            if name in names:
                return getattr(import_module(f"infoset.experiments.{module}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
