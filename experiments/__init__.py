"""What people run: the command line, scenarios, figures and files."""

from __future__ import annotations

TYPE_CHECKING = False  # `typing` takes longer to import than all else before an interrupt can be caught
if TYPE_CHECKING:
    from experiments.interception.scenario_file import load_scenario

__all__ = ["load_scenario"]


def __getattr__(name: str) -> object:
    """Load what is exported when it is first asked for: the command line must start without it."""
    if name == "load_scenario":
        from experiments.interception.scenario_file import load_scenario

        return load_scenario
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
