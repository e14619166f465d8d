"""Comparison of strategies: random noise, and game noise with every tie rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from experiments.interception.study import QUANTILES
from guidance import NoiseKind, Strategy, TieRule
from infoset.arrays import Flags, Floats
from sim import HitEstimate, Results, Scenario, estimate_hits
from sim.statistics import shown_quantiles

Flight = tuple[str, TieRule | None]


@dataclass(frozen=True)
class Comparison:
    """One strategy with one kind of noise: results by tie rule of the game noise, or one result with random noise.

    All strategies have the same runs.
    """

    strategy: str
    noise: NoiseKind
    results: Mapping[TieRule | None, Results]

    @property
    def miss_m(self) -> Floats:
        """Maximum miss of each run over the tie rules, m, shape (N,)."""
        return np.asarray(np.max([each.miss_m for each in self.results.values()], axis=0), dtype=np.float64)

    @property
    def impulse_m_s(self) -> Floats:
        """Maximum impulse spent of each run over the tie rules, m/s, shape (N,)."""
        return np.asarray(np.max([each.impulse_m_s for each in self.results.values()], axis=0), dtype=np.float64)

    @property
    def truth_kept(self) -> Flags:
        """Whether the true state stayed in its section with every tie rule, shape (N,)."""
        return np.asarray(np.all([each.truth_kept for each in self.results.values()], axis=0), dtype=np.bool_)

    @property
    def set_emptied(self) -> Flags:
        """Whether the set became empty with a tie rule, shape (N,)."""
        return np.asarray(np.any([each.set_emptied for each in self.results.values()], axis=0), dtype=np.bool_)

    @property
    def hits(self) -> HitEstimate | None:
        """Runs that hit with every tie rule; None if the body has no size."""
        hit = [results.hit for results in self.results.values()]
        every = np.all([flags.data for flags in hit], axis=0)
        return estimate_hits(int(every.sum()), len(every)) if hit[0].count() else None

    @property
    def phi_held(self) -> np.ma.MaskedArray[tuple[int], np.dtype[np.bool_]]:
        """Whether the miss was within the guaranteed miss with every tie rule, shape (N,).

        Masked without a guarantee, as always in the model `paper`.
        """
        held = np.ma.stack([each.phi_held for each in self.results.values()])
        return np.ma.MaskedArray(held.filled(True).all(axis=0), mask=np.ma.getmaskarray(held).all(axis=0))


def flights(scenario: Scenario, strategies: Mapping[str, Strategy | None]) -> dict[Flight, Scenario]:
    """Return the scenarios of a comparison by strategy and tie rule; None is random noise."""
    flown: dict[Flight, Scenario] = {}
    for name, own in strategies.items():
        guided = scenario if own is not None else replace(scenario, strategy=name)
        flown[name, None] = replace(guided, noise=NoiseKind.RANDOM)
        flown |= {(name, tie): replace(guided, noise=NoiseKind.GAME, tie=tie) for tie in TieRule}
    return flown


def gather(flown: Mapping[Flight, Results]) -> list[Comparison]:
    """Return results by strategy and noise, in the order of the strategies, random noise first."""
    compared = []
    for name in dict.fromkeys(name for name, _ in flown):
        games: dict[TieRule | None, Results] = {tie: flown[name, tie] for tie in TieRule}
        compared.append(Comparison(name, NoiseKind.RANDOM, {None: flown[name, None]}))
        compared.append(Comparison(name, NoiseKind.GAME, games))
    return compared


def summary(sample: Floats) -> dict[str, float | None]:
    """Return the quantiles of a sample: p10, p50, p90, p99 and max; None if the sample is too small to show one."""
    return dict(zip(QUANTILES, shown_quantiles(sample, [*QUANTILES.values()]), strict=True))
