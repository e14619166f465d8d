"""The strategies that can be named in a scenario."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from guidance.kalman import Kalman
from guidance.least_squares import LeastSquares
from guidance.patient import Patient
from guidance.strategy import Strategy
from guidance.symmetric_miss import SymmetricMiss
from guidance.zero_effort import ZeroEffortMiss

_STRATEGIES: Mapping[str, Callable[[], Strategy]] = MappingProxyType(
    {each.name: each for each in (SymmetricMiss, Patient, ZeroEffortMiss, Kalman, LeastSquares)}
)


def strategy_names() -> list[str]:
    """Names of the strategies that `make_strategy` knows."""
    return sorted(_STRATEGIES)


def make_strategy(name: str) -> Strategy:
    """The strategy of a name.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    if name not in _STRATEGIES:
        raise ValueError(f"no strategy is called '{name}'; there are: {', '.join(strategy_names())}")
    return _STRATEGIES[name]()
