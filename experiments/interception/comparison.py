"""Comparison of strategies: random noise, and game noise with every tie rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from guidance import NoiseKind, Strategy, TieRule
from sim import Results, Scenario, quantiles

Floats = NDArray[np.float64]

QUANTILES: Mapping[str, float] = {"p10": 0.1, "p50": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}


@dataclass(frozen=True)
class Comparison:
    """One strategy with one kind of noise; all strategies have the same runs.

    Parameters
    ----------
    results : mapping of TieRule or None to Results
        By tie rule of the game noise; the one key of random noise is None.
    """

    strategy: str
    noise: NoiseKind
    results: Mapping[TieRule | None, Results]

    @property
    def miss_m(self) -> Floats:
        """Greatest miss of each run over the tie rules, m, shape (N,)."""
        return np.asarray(np.max([each.miss_m for each in self.results.values()], axis=0), dtype=np.float64)

    @property
    def impulse_m_s(self) -> Floats:
        """Greatest impulse spent of each run over the tie rules, m/s, shape (N,)."""
        return np.asarray(np.max([each.impulse_m_s for each in self.results.values()], axis=0), dtype=np.float64)

    @property
    def truth_kept(self) -> NDArray[np.bool_]:
        """Whether the true state stayed in its section with every tie rule, shape (N,)."""
        return np.asarray(np.all([each.truth_kept for each in self.results.values()], axis=0), dtype=np.bool_)

    @property
    def phi_held(self) -> np.ma.MaskedArray[tuple[int], np.dtype[np.bool_]]:
        """Whether the miss was within the guaranteed miss with every tie rule, shape (N,).

        Masked without a guarantee, as always in the model `paper`.
        """
        held = np.ma.stack([each.phi_held for each in self.results.values()])
        return np.ma.MaskedArray(held.filled(True).all(axis=0), mask=np.ma.getmaskarray(held).all(axis=0))


def flights(
    scenario: Scenario, strategies: Mapping[str, Strategy | None]
) -> list[tuple[str, TieRule | None, Scenario]]:
    """Return the simulations of a comparison: strategy, tie rule (None is random noise) and scenario."""
    return [
        (
            name,
            tie,
            replace(flown, noise=NoiseKind.RANDOM) if tie is None else replace(flown, noise=NoiseKind.GAME, tie=tie),
        )
        for name, own in strategies.items()
        for flown in (scenario if own is not None else replace(scenario, strategy=name),)
        for tie in (None, *TieRule)
    ]


def gather(flown: Sequence[tuple[str, TieRule | None, Results]]) -> list[Comparison]:
    """Return results by strategy and noise, in the order of the strategies, random noise first."""
    names = list(dict.fromkeys(name for name, _, _ in flown))
    return [
        Comparison(
            name,
            noise,
            {
                tie: results
                for each, tie, results in flown
                if each == name and (tie is None) == (noise is NoiseKind.RANDOM)
            },
        )
        for name in names
        for noise in (NoiseKind.RANDOM, NoiseKind.GAME)
    ]


def summary(sample: Floats) -> dict[str, float]:
    """Return the quantiles of a sample: p10, p50, p90, p99 and max."""
    values = quantiles(sample, list(QUANTILES.values()))
    return {name: float(value) for name, value in zip(QUANTILES, values, strict=True)}
