"""A lower bound of the miss that a strategy can guarantee, from motions with equal measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from infoset.arrays import Floats
from infoset.sim.bound.pair_of_motions import UNLIMITED, PairApproach, TruthPair
from infoset.sim.scenario import Scenario, need_scenario

LABELS_A_PERIOD = 8
"""Number of labels in a period of the bound, which oscillates with the label; the period is the
distance travelled between two measurements. Chosen: the time is in proportion to it, and the bound
of dart-2022 is the same from 2 to 32 (measured); of asteroid-1997-single it is 0.02 % smaller with
2 and 0.005 % greater with 32."""
PERIODS_LOOKED_AT = 7
"""Maximum number of examined periods. Chosen: the bounds of dart-2022 and asteroid-1997-single are
the same from 2 to 28 (measured)."""
REFINEMENTS = 5
"""Number of times that the distance between labels is halved around the best one: to 1/32. Chosen:
the bound of asteroid-1997-single is 0.1 % smaller without, and 0.005 % greater with ten (measured).
"""
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
        Best pair or single motion of each examined label and velocity along x, in ascending order
        of the velocity, then of the label.
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
        labels_m = np.array([pair.label_m for pair in pairs])
        return labels_m, np.array([pair.bound_m for pair in pairs])


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
        If `scenario` is not a `Scenario`.

    Notes
    -----
    Any pair of admissible motions gives a bound; the search looks for a good one. The bound depends
    on the label mostly through the range of the last measurement before x = 0, and repeats with the
    distance between measurements. Therefore the search covers whole periods of labels in some parts
    of the range interval, for both ends of the interval of V_x and for the nominal closing speed,
    and refines the best labels. For each label, one pass over the steps gives the farthest motions
    for every last common step (Theorem 5a of docs/guarantee-bound.md).

    Equal measurements up to step s give equal impulses up to step s. Later impulses change the
    distance of the two across x at x = 0 by at most their common limit, and one of the two has at
    least half of the rest; for one motion alone all impulses count. docs/guarantee-bound.md has the
    proof, with the reserves for gravity and for the slope of the line of sight.

    In space, each axis has its own sets of differences, and the impulses limit the modulus. The two
    motions of a pair differ along both axes, each by as much as possible, so the bound is not below
    the bound of one axis.

    If q images may be wrong (`wrong_images` of the set), the two need not agree at the last 2q
    images: q of them are wrong in one motion, and q in the other.
    """
    need_scenario(scenario)
    speeds = _examined_speeds(scenario)
    grids = [label_grid(scenario, speed) for speed in speeds]
    total = sum(len(grid) + _refinements(grid) for grid in grids)
    done = 0
    by_label: dict[tuple[float, float], TruthPair] = {}
    best: list[TruthPair] = []
    for speed, grid in zip(speeds, grids, strict=True):
        tried: list[TruthPair] = []
        width = float(np.diff(grid).min(initial=np.inf))
        for index in range(len(grid) + _refinements(grid)):
            if index < len(grid):
                label_m = float(grid[index])
            else:
                # Half a width to each side of the best label, then half of that, and so on.
                is_first_side = (index - len(grid)) % 2 == 0
                width *= 0.5 if is_first_side else 1.0
                side = -1.0 if is_first_side else 1.0
                label_m = max(tried, key=_BOUND).label_m + side * width
                lower, upper = scenario.set_model.bounds.x_m
                label_m = min(max(label_m, lower), upper)
            tried.append(_best_at(scenario, label_m, speed))
            by_label[speed, label_m] = tried[-1]
            done += 1
            if progress is not None:
                progress(done / total)
        best.append(max(tried, key=_BOUND))

    best.sort(key=_BOUND, reverse=True)
    in_order = sorted(by_label.items(), key=lambda item: item[0])
    return LowerBound(tuple(best), tuple(pair for _, pair in in_order))


def _examined_speeds(scenario: Scenario) -> list[float]:
    """Return both ends of the interval of V_x and the nominal one, in ascending order, m/s."""
    model = scenario.set_model
    slow = max(model.bounds.vx_m_s)
    fast = min(model.bounds.vx_m_s)
    nominal = min(max(-model.closing_speed_m_s, fast), slow)
    return sorted({fast, nominal, slow})


def _refinements(grid: Floats) -> int:
    """Return the number of labels beside those of a grid: none if the range is exactly known."""
    return 2 * REFINEMENTS if len(grid) > 1 else 0


def _best_at(scenario: Scenario, label_m: float, vx_m_s: float) -> TruthPair:
    """Return the best pair or single motion of a label."""
    approach = PairApproach(scenario, label_m, vx_m_s)
    return max(approach.best_pair(), approach.single(), key=UNLIMITED)


def label_grid(scenario: Scenario, vx_m_s: float) -> Floats:
    """Return the labels to examine, m, in ascending order.

    They are evenly spaced in whole periods of the bound, ends included.
    """
    model = scenario.set_model
    lower, upper = model.bounds.x_m
    period = -vx_m_s * model.step_s * model.steps_in(model.angle_sensor.period_s)
    whole = max(1, int(np.ceil((upper - lower) / period)))
    if whole <= PERIODS_LOOKED_AT:
        return np.unique(np.linspace(lower, upper, whole * LABELS_A_PERIOD + 1))

    starts = np.linspace(lower, upper - period, PERIODS_LOOKED_AT)
    places = starts[:, None] + np.linspace(0.0, period, LABELS_A_PERIOD + 1)[None, :]
    return np.unique(np.minimum(places, upper))


def pair_at(
    scenario: Scenario, label_m: float, vx_m_s: float, *, last_common_step: int | None = None
) -> TruthPair:
    """Find the motions with the maximum bound for x = label and V_x = vx at t = 0.

    `last_common_step` is the last step of a pair with the same measurements; None searches for the
    best one and considers single motions.
    """
    if last_common_step is None:
        return _best_at(scenario, label_m, vx_m_s)
    return PairApproach(scenario, label_m, vx_m_s).pair(last_common_step)
