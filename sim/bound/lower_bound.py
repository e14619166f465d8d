"""A lower bound of the miss that any strategy can guarantee, from two motions with the same
measurements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from infoset.arrays import Floats
from infoset.sim.bound.pair_of_motions import UNLIMITED, PairApproach, TruthPair
from infoset.sim.scenario import Scenario, need_scenario

LABELS_A_PERIOD, PERIODS_LOOKED_AT = 8, 7
"""The bound oscillates with the label; the period is the distance travelled between two
measurements.
"""
REFINEMENTS = 5
_BOUND = attrgetter("bound_m")


@dataclass(frozen=True)
class LowerBound:
    """A miss below which no strategy can guarantee to stay.

    Parameters
    ----------
    pairs : tuple of TruthPair
        Best pair at both ends of the interval of V_x and at the nominal closing speed, the best one
        first.
    by_label : tuple of TruthPair
        Best pairs of all examined labels, in ascending order, for each velocity along x.
    """

    pairs: tuple[TruthPair, ...]
    by_label: tuple[TruthPair, ...]

    def __repr__(self) -> str:
        return (
            f"<lower bound {self.bound_m:.4g} m from {len(self.by_label)} labels; best label "
            f"{self.pair.label_m:.6g} m>"
        )

    @property
    def bound_m(self) -> float:
        """The bound, m."""
        return self.pair.bound_m

    @property
    def pair(self) -> TruthPair:
        """The two motions with this bound."""
        return self.pairs[0]

    @property
    def speeds_m_s(self) -> tuple[float, ...]:
        """Examined velocities along x, in ascending order, m/s."""
        return tuple(sorted({pair.vx_m_s for pair in self.by_label}))

    def curve(self, vx_m_s: float) -> tuple[Floats, Floats]:
        """Return labels and bounds of one velocity along x, m."""
        pairs = [pair for pair in self.by_label if pair.vx_m_s == vx_m_s]
        return np.array([pair.label_m for pair in pairs]), np.array(
            [pair.bound_m for pair in pairs]
        )


def lower_bound(
    scenario: Scenario, *, progress: Callable[[float], None] | None = None
) -> LowerBound:
    """Find the maximum miss below which no strategy can guarantee to stay.

    Parameters
    ----------
    scenario : Scenario
        A range sensor has no effect unless it is very precise, because the two motions have the
        same range x.
    progress : callable or None
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    TypeError
        If `scenario` is no `Scenario`.

    Notes
    -----
    Any pair of admissible motions gives a bound; the search looks for a good one. The bound depends
    on the label mostly through the range of the last measurement before x = 0, and repeats with the
    distance between measurements. Therefore the search covers whole periods of labels in some parts
    of the range interval, for both ends of the interval of V_x and for the nominal closing speed,
    and refines the best labels. For each label, one pass over the steps gives the farthest motions
    for every last common step (Theorem 5a of docs/guarantee.md).

    Equal measurements up to step s give equal impulses up to step s. Later impulses change the
    distance of the two across x at x = 0 by at most their common limit, and one of the two has at
    least half of the rest; for one motion alone all impulses count. docs/guarantee.md has the
    proof, with the reserves for gravity and for the slope of the line of sight.

    In space, each axis has its own sets of differences, and the impulses limit the modulus. The two
    motions of a pair differ along both axes, each by as much as possible, so the bound is not below
    that of one axis.
    """
    need_scenario(scenario)
    model = scenario.set_model
    slow = max(model.bounds.vx_m_s)
    fast = min(model.bounds.vx_m_s)
    speeds = sorted({fast, min(max(-model.closing_speed_m_s, fast), slow), slow})
    grids = [label_grid(scenario, speed) for speed in speeds]
    refinements = [2 * REFINEMENTS if len(grid) > 1 else 0 for grid in grids]
    total = sum(len(grid) for grid in grids) + sum(refinements)
    done = 0
    by_label: dict[tuple[float, float], TruthPair] = {}
    best: list[TruthPair] = []
    for speed, grid, extra in zip(speeds, grids, refinements, strict=True):
        tried: list[TruthPair] = []
        width = float(np.diff(grid).min(initial=np.inf))
        labels = grid.tolist()
        for index in range(len(grid) + extra):
            if index >= len(grid):
                # Refine around the best label: half a width to each side, repeatedly.
                width *= 0.5 if (index - len(grid)) % 2 == 0 else 1.0
                side = 1.0 if (index - len(grid)) % 2 else -1.0
                label_m = max(tried, key=_BOUND).label_m + side * width
                labels.append(min(max(label_m, model.bounds.x_m[0]), model.bounds.x_m[1]))
            approach = PairApproach(scenario, labels[index], speed)
            tried.append(max(approach.best_pair(), approach.single(), key=UNLIMITED))
            by_label[speed, labels[index]] = tried[-1]
            done += 1
            if progress is not None:
                progress(done / total)
        best.append(max(tried, key=_BOUND))
    best.sort(key=_BOUND, reverse=True)
    return LowerBound(
        tuple(best),
        tuple(pair for _, pair in sorted(by_label.items(), key=lambda item: item[0])),
    )


def label_grid(scenario: Scenario, vx_m_s: float) -> Floats:
    """Return the labels to examine, m, in ascending order: whole periods of the bound, evenly
    spaced, ends included.
    """
    lower, upper = scenario.set_model.bounds.x_m
    period = (
        -vx_m_s
        * scenario.set_model.step_s
        * scenario.set_model.steps_in(scenario.set_model.angle_sensor.period_s)
    )
    whole = max(1, int(np.ceil((upper - lower) / period)))
    if whole <= PERIODS_LOOKED_AT:
        return np.unique(np.linspace(lower, upper, whole * LABELS_A_PERIOD + 1))
    starts = np.linspace(lower, upper - period, PERIODS_LOOKED_AT)
    places = starts[:, None] + np.linspace(0.0, period, LABELS_A_PERIOD + 1)[None, :]
    return np.unique(np.minimum(places, upper))


def pair_at(
    scenario: Scenario, label_m: float, vx_m_s: float, *, last_common_step: int | None = None
) -> TruthPair:
    """Find the pair of motions, or the single one, with the maximum bound for x = label and V_x =
    vx at t = 0.

    `last_common_step` is the last step of a pair with the same measurements; None searches for the
    best one and considers single motions.
    """
    approach = PairApproach(scenario, label_m, vx_m_s)
    if last_common_step is not None:
        return approach.pair(last_common_step)
    return max(approach.best_pair(), approach.single(), key=UNLIMITED)
