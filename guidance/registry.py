"""Strategies by name, as scenario files and commands select them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType

from infoset.guidance.kalman import Kalman
from infoset.guidance.least_effort import LeastEffort
from infoset.guidance.patient import Patient
from infoset.guidance.predictive import Predictive
from infoset.guidance.proportional_navigation import ProportionalNavigation
from infoset.guidance.strategy import Strategy
from infoset.guidance.symmetric_miss import SymmetricMiss
from infoset.guidance.zero_effort import ZeroEffortMiss

_STRATEGIES: Mapping[str, Callable[[], Strategy]] = MappingProxyType(
    {kind.name: kind for kind in (SymmetricMiss, LeastEffort, Patient, ZeroEffortMiss, Kalman)}
    | {
        "pn-kalman": ProportionalNavigation,
        "apn-kalman": partial(ProportionalNavigation, is_augmented=True),
        "predictive-kalman": Predictive,
    }
)


def strategy_names() -> list[str]:
    """Return the names of the registered strategies: first on the set, then the baselines."""
    return list(_STRATEGIES)


def make_strategy(name: str) -> Strategy:
    """Return a registered strategy with its default settings.

    Raises
    ------
    ValueError
        If the name is not registered.
    """
    if name not in _STRATEGIES:
        raise ValueError(
            f"no strategy is called '{name}'; there are: {', '.join(strategy_names())}"
        )
    return _STRATEGIES[name]()
