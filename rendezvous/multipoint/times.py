"""The best times of visits in a given order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._halton import halton
from infoset.rendezvous.multipoint.segments import NotSettledError, Path

FlyAt = Callable[[Floats], Path]

MIN_SHARE = 1e-6
"""Smallest minimum gap, as a share of the available time; without a latest time, of the duration of
the longest guess. A gap of zero has no path.
"""
_POLISH_ROUNDS = 8
"""Largest number of rounds of Newton's method, which starts near a minimum."""
_DIFFERENCE = 1e-5
"""Step of the central differences of the gradient, as a share of the smallest gap: near the cube
root of the rounding of doubles, where rounding and truncation are similar."""
_HELD = 1e-3
"""Excess of a gap over the minimum, as a share of it, up to which the gap is held at the
minimum.
"""
_WALL = 20.0
"""Logarithm of the objective at times without a path, above its value at the start of the descent:
a wall for the line search. Chosen."""
_MAX_WALLS = 6
"""Largest number of points without a path in a descent, which stops at one more; chosen: its line
search is lost."""
_MAX_RESTARTS = 4
"""Largest number of descents from the end of the last one; chosen: later ones change little."""
_SETTLED = 1e-3
"""Residual of a minimum above which the times are refused: another gap would save this share of the
objective (`_unsettled`). Chosen."""
_WELL_SETTLED = 1e-6
"""Residual of a minimum down to which the descent is repeated; chosen."""
_OBJECTIVE_ROUNDING = 1e-26
"""Square of 1e-13, a relative error of states by some 450 roundings: a cost that such an error
causes counts as zero."""
_MIN = float(np.finfo(float).tiny)
"""Smallest divisor."""
_CLOCK = 1e-9
"""Travel times below this share of the times are rounding errors, and leave no gaps."""


class Effort(Enum):
    """Effort of a search for best times.

    Starts besides the guesses, starts that are followed, relative tolerance, and whether the end is
    polished to the last digits.
    """

    BOUND = (1, 1, 1e-5, False)
    """A bound of a partial order, from good times."""
    VALLEY = (0, 1, 1e-5, False)
    """The minimum near given times, to compare minima."""
    RUGGED = (14, 5, 1e-5, False)
    """Comparison of orders whose cost has many local minima."""
    FINAL = (48, 6, 1e-9, True)
    """The final answer, without good times to start from."""
    LAST = (1, 6, 1e-9, True)
    """The final answer, from the best minima known."""

    def __init__(self, starts: int, followed: int, tolerance: float, polished: bool) -> None:
        self.starts = starts
        self.followed = followed
        self.tolerance = tolerance
        self.polished = polished


@dataclass(frozen=True)
class TimeLimits:
    """Limits of the times.

    Parameters
    ----------
    latest_s : float or None
        Latest arrival at the last target, whose stay is not counted; None is no limit.
    min_gap_s : float
        Minimum time between a departure and the next arrival.
    price_per_s : float
        kappa, m^2/s^4, not negative; kappa times the duration, from the start to the last arrival,
        is added to the energy.

    Raises
    ------
    ValueError
        If nothing limits the last time: the energy then has no minimum, because it decreases to
        zero as time increases.
    """

    latest_s: float | None = None
    min_gap_s: float = 0.0
    price_per_s: float = 0.0

    def __post_init__(self) -> None:
        if self.latest_s is None and self.price_per_s == 0.0:
            raise ValueError(
                "with the last time free the energy falls to zero as it grows, so there is no "
                "best time: give a latest time, or a price of time"
            )


class Grid(NamedTuple):
    """Equally spaced times of a visit; for later visits they begin later by gaps and stays."""

    times: int
    """Number of times of a visit."""
    until_s: float
    """Latest time of the arrival at the last target."""


class TimeSearch(NamedTuple):
    """Extent of a search for best times."""

    starts: int
    """Starting points, the guesses included, whose cost was computed."""
    followed: int
    """Starting points that were followed to a local minimum, the cheapest of which is the
    result.
    """
    grid: Grid | None = None
    """The grid of times from which the starting points are; None if they are from no grid."""


@dataclass(frozen=True, eq=False)
class BestTimes:
    """Visits at the best times that were found, which are a local minimum.

    `objective` is the energy plus the price of the time, m^2/s^3; `evaluations` is the number of
    paths computed.
    """

    path: Path
    objective: float
    evaluations: int
    search: TimeSearch

    @property
    def time_s(self) -> Floats:
        """Times of arrival, shape (N,)."""
        return self.path.nodes.arrive_s


@dataclass(frozen=True, eq=False)
class _Trial:
    """Gaps, the path at their times, and its objective with its slope along the gaps."""

    gaps: Floats
    path: Path
    objective: float
    slope: Floats


class NoRoomError(ValueError):
    """The visits do not fit before the latest time."""


class _StoppedError(Exception):
    """A descent found no paths in its neighbourhood, or its objective is low enough."""


@dataclass
class _Trials:
    """The objective as a function of gaps, with their limits and a count of evaluations.

    A gap is the time from a departure, or the start, to the next arrival.
    """

    fly: FlyAt
    shifts_s: Floats
    """Times of the arrivals if all gaps were zero, s; the first one is the start."""
    price_per_s: float
    minimum: float
    """The minimum gap, s."""
    total: float
    """The available travel time, s; infinite without a latest time."""
    scale: float
    """A typical travel time, s."""
    evaluations: int = 0

    def __call__(self, gaps: Floats) -> _Trial:
        times = self.shifts_s + np.cumsum(gaps)
        self.evaluations += 1
        path = self.fly(times)

        # A gap moves all later times.
        gradient = path.time_gradient.copy()
        gradient[-1] += self.price_per_s
        slope = np.cumsum(gradient[::-1])[::-1]
        price = self.price_per_s * float(times[-1] - self.shifts_s[0])
        return _Trial(gaps, path, path.cost + price, slope)

    def attempt(self, gaps: Floats) -> _Trial | None:
        """Return the trial of gaps, or None if `fly` raises a ValueError: no path at such times."""
        try:
            return self(gaps)
        except ValueError:
            return None

    def within(self, gaps: Floats) -> Floats:
        """Return gaps within the limits, to undo the rounding of a descent."""
        gaps = np.maximum(gaps, self.minimum)
        excess = gaps - self.minimum
        over = gaps.sum() - self.total
        if over > 0.0 and excess.sum() > 0.0:
            gaps = gaps - over * excess / excess.sum()
        return np.asarray(gaps)


def optimise_times(
    fly: FlyAt,
    start_s: float,
    dwell_s: Floats,
    limits: TimeLimits,
    guesses: Sequence[Floats] = (),
    *,
    effort: Effort = Effort.FINAL,
    enough: float = -np.inf,
    progress: Callable[[float], None] | None = None,
) -> BestTimes:
    """Minimise the energy, or energy and price, over the times of N visits in one order.

    Parameters
    ----------
    fly : callable
        Function that returns the path for N times.
    start_s : float
        Start of the first segment.
    dwell_s : ndarray, shape (N,)
        Duration of the stay with each target.
    guesses : sequence of ndarray, shape (N,)
        Additional initial times, s; those outside the limits are ignored. The longest one is the
        scale of the others if there is no latest time.
    enough : float
        Objective, m^2/s^3, below which a descent stops, and no other start is followed.
    progress : callable or None
        Called with the share of starts that are followed.

    Raises
    ------
    NoRoomError
        If the visits do not fit before the latest time.
    ValueError
        If there is no latest time and no guess.
    NotSettledError
        If the conditions of a minimum are not satisfied, where the end is polished, or `fly` raises
        it and no start has a path.

    Notes
    -----
    The problem is not convex. Many starts are evaluated, and the search begins with those that cost
    no more than their neighbours; a lower minimum elsewhere is not excluded. The descent is
    sequential quadratic programming in the gaps, on the logarithm of the objective, with the exact
    gradient dI/dt; then Newton's method, with differences of the gradient, on the gaps that are not
    at a limit. Each point of a descent is one path, each step of Newton's method two for each free
    gap and one.
    """
    count = len(dwell_s)
    shifts = start_s + np.concatenate([[0.0], np.cumsum(dwell_s[:-1])])
    total = room_s(start_s, dwell_s, limits)
    scale = total
    if np.isinf(total):
        lengths = [float(guess[-1]) - start_s for guess in guesses if len(guess) == count]
        scale = max(lengths, default=0.0)
        if scale <= 0.0:
            raise ValueError("with the last time free, times to start from are needed")
    minimum = max(limits.min_gap_s, MIN_SHARE * scale)
    trials = _Trials(fly, shifts, limits.price_per_s, minimum, total, scale)

    candidates = [np.diff(np.concatenate([[0.0], np.asarray(guess) - shifts])) for guess in guesses]
    candidates += _spread(count, scale, minimum, bounded=np.isfinite(total), most=effort.starts)
    # Differences of times outside the limits by rounding, which is relative to the clock, are moved
    # into them.
    sound = [
        trials.within(gaps)
        for gaps in candidates
        if (gaps >= minimum * (1.0 - _CLOCK)).all() and gaps.sum() <= total * (1.0 + _CLOCK)
    ]
    starts = [trial for trial in map(trials.attempt, sound) if trial is not None]
    if not starts:
        trials(sound[0])  # raises the reason

    followed = _valleys(starts, effort.followed)
    ends = []
    for index, start in enumerate(followed):
        ends.append(_descend(trials, start, scale, effort.tolerance, enough))
        if progress is not None:
            progress((index + 1) / len(followed))
        if ends[-1].objective < enough:
            break

    best = min(ends, key=lambda trial: trial.objective)
    if effort.polished:
        best = _polished(trials, best, effort.tolerance, enough)
    search = TimeSearch(len(starts), len(ends))
    return BestTimes(best.path, best.objective, trials.evaluations, search)


def _polished(trials: _Trials, best: _Trial, tolerance: float, enough: float) -> _Trial:
    """Return a minimum to the last digits, descending again while it is not settled."""
    best = _polish(trials, best)
    for _ in range(_MAX_RESTARTS):
        if _unsettled(trials, best) <= _WELL_SETTLED:
            break
        again = _polish(trials, _descend(trials, best, best.gaps, tolerance, enough))
        if not again.objective < best.objective:
            break
        best = again
    if not _unsettled(trials, best) <= _SETTLED:
        raise NotSettledError(
            f"the best times found cost {best.objective:.6g} m^2/s^3 and are no minimum: "
            "another gap lowers the cost; start from other times, or give visits more time"
        )
    return best


def _unsettled(trials: _Trials, best: _Trial) -> float:
    """Return the residual of the conditions of a minimum, relative to the objective.

    It is the greatest share of the objective, to first order, that the change of one gap saves:
    lengthening it by its own length or as far as the limits allow, or shortening it to the minimum
    gap. `slope` is the derivative of the objective by the gaps. If no time is left (`full`), a
    longer gap takes its time from the others, in proportion to their excess over the minimum gap.
    """
    gaps = best.gaps
    excess = np.maximum(best.gaps - trials.minimum, 0.0)
    slope = best.slope
    full = bool(np.isfinite(trials.total)) and trials.total - gaps.sum() <= _CLOCK * trials.total
    if full and excess.sum() > 0.0:
        slope = slope + max(0.0, -float(excess @ slope) / float(excess.sum()))
    farthest = max(trials.total - gaps.sum(), 0.0) + excess.sum()
    gain = np.maximum(-slope * np.minimum(gaps, farthest), slope * excess)
    # The objective of a path that costs nothing is the rounding of states: `size` is about the
    # cost of a leg whose control changes the whole state.
    states = best.path.nodes.arrive
    size = (states[:, :3] ** 2).sum(axis=1) / gaps**3 + (states[:, 3:] ** 2).sum(axis=1) / gaps
    return float(gain.max() / max(best.objective + _OBJECTIVE_ROUNDING * size.sum(), _MIN))


def room_s(start_s: float, dwell_s: Floats, limits: TimeLimits) -> float:
    """Return the time for travel, s; infinite without a latest time.

    The stay with the last target is not counted: it is after the latest time. Raise `NoRoomError`
    if the visits do not fit.
    """
    if limits.latest_s is None:
        return float(np.inf)
    stays = float(dwell_s[:-1].sum())
    total = limits.latest_s - start_s - stays
    need = len(dwell_s) * limits.min_gap_s
    clock = max(abs(limits.latest_s), abs(start_s))
    # The minimum gaps may fill all the time: 1e-14 of a time is more than the rounding of the sums.
    if not total > _CLOCK * clock or total < need - 1e-14 * clock:
        raise NoRoomError(
            f"{len(dwell_s)} visits do not fit before the latest time, {limits.latest_s:g} s: with "
            f"gaps of at least {limits.min_gap_s:g} s and the dwells the last one is after "
            f"{start_s + stays + need:g} s at the earliest"
        )
    return max(total, need)


def _spread(count: int, scale: float, minimum: float, bounded: bool, most: int) -> list[Floats]:
    """Return the first `most` initial gaps: even, rising and falling ones, then a Halton sequence.

    The three shapes are stretched over all the time and half of it or, if the time is not
    `bounded`, over 0.5 to 8 times the `scale`.
    """
    rising = np.arange(1.0, count + 1.0)
    lengths = (1.0, 0.5) if bounded else (0.5, 1.0, 2.0, 4.0, 8.0)
    extra = max(scale - count * minimum, 0.0) if bounded else scale
    shapes = (np.ones(count), rising, rising[::-1])
    shares = [length * shape / shape.sum() for shape in shapes for length in lengths]
    for point in halton(count + 1, most):
        # Shares of -log(point) would be uniform over all shares; 0.2, chosen, avoids tiny gaps.
        weights = 0.2 - np.log(point)
        if bounded:  # the last weight is that of the time that is left at the end
            shares.append((weights / weights.sum())[:count])
        else:
            # Lengths from 0.5 to 8, as in `lengths`, with uniform logarithms.
            shares.append(0.5 * 16.0 ** point[count] * weights[:count] / weights[:count].sum())
    return [minimum + extra * share for share in shares[:most]]


def _valleys(starts: Sequence[_Trial], most: int) -> list[_Trial]:
    """Return at most `most` starts: one of each valley, the cheapest first, then the others.

    A start of a valley costs no more than its nearest neighbours. The others too are in ascending
    order of cost. Toern and Viitanen, "Topographical global optimization using pre-sampled points",
    J. Global Optim. 5 (1994) 267-276.
    """
    ranked = sorted(starts, key=lambda trial: trial.objective)
    gaps = np.stack([trial.gaps for trial in ranked])
    # With itself, so that a start of n gaps is compared with n + 1 others; chosen.
    neighbours = min(len(ranked), gaps.shape[1] + 2)
    nearest = cKDTree(gaps).query(gaps, k=neighbours)[1].reshape(len(ranked), -1)
    # The starts are in ascending order of cost: an index that is not less costs no less.
    lowest = (nearest >= np.arange(len(ranked))[:, None]).all(axis=1)
    return [ranked[index] for index in np.argsort(~lowest, kind="stable")[:most]]


def _descend(
    trials: _Trials, start: _Trial, scale: float | Floats, tolerance: float, enough: float
) -> _Trial:
    """Minimise from a start, in gaps over `scale`, and return the cheapest trial within the limits.

    It stops below `enough`, or after a few points without a path. The start itself counts.
    """
    if start.objective < enough:
        return start
    # Keeps the logarithm finite where a path costs nothing; not 0 even if the start costs nothing,
    # as 1e-300 is above the smallest double. Costs so far below the start's are rounding.
    floor = 1e-30 * max(start.objective, 1e-270)
    shares = np.broadcast_to(scale, start.gaps.shape) / trials.total
    walls = 0
    lowest = start

    def value(x: Floats) -> tuple[float, Floats]:
        nonlocal walls, lowest
        # Whatever point is tried, no gap is below half the minimum one; a gap of zero has no path.
        gaps = np.maximum(x * scale, 0.5 * trials.minimum)
        trial = trials.attempt(gaps)
        if trial is None:
            walls += 1
            if walls > _MAX_WALLS:
                raise _StoppedError
            return float(np.log(start.objective)) + _WALL, np.zeros_like(x)
        if trial.objective < lowest.objective and (gaps == trials.within(gaps)).all():
            lowest = trial
            if lowest.objective < enough:
                raise _StoppedError
        size = max(trial.objective, floor)
        return float(np.log(size)), trial.slope * (scale / size)

    within_total = {
        "type": "ineq",
        "fun": lambda x: 1.0 - (x * scale).sum() / trials.total,
        "jac": lambda _: -shares,
    }
    bounds = np.broadcast_to(trials.minimum / scale, start.gaps.shape)
    try:
        minimum = minimize(
            value,
            start.gaps / scale,
            jac=True,
            bounds=[(float(bound), None) for bound in bounds],
            constraints=within_total if np.isfinite(trials.total) else (),
            method="SLSQP",
            # The number of iterations only stops descents that do not converge; chosen.
            options={"ftol": tolerance, "maxiter": 100},
        )
    except _StoppedError:
        return lowest
    end = trials.attempt(trials.within(np.asarray(minimum.x) * scale))
    if end is None or not end.objective <= lowest.objective:
        return lowest
    return end


def _polish(trials: _Trials, best: _Trial) -> _Trial:
    """Newton's method on the gaps above the minimum gap; at the latest time their sum is fixed.

    The result is `best` if the method does not lower the objective, up to rounding.
    """
    minimum = trials.minimum
    total = trials.total
    # An end this near to the latest time is moved onto it; chosen.
    near = 1e-5 * trials.scale
    gaps = best.gaps
    full = total - gaps.sum() <= near
    held = gaps - minimum <= _HELD * minimum
    if held.all():
        return best
    if full:  # exactly at the latest time
        gaps = gaps.copy()
        gaps[gaps.argmax()] += total - gaps.sum()

    directions = np.eye(len(gaps))[:, ~held]
    if full:
        # An orthonormal basis of the changes whose sum is zero; none if only one gap is not held.
        directions = directions @ np.linalg.svd(np.ones((1, directions.shape[1])))[2][1:].T
    here = trials(gaps)
    step = _DIFFERENCE * float(gaps.min())
    # Without a direction there is nothing to polish.
    for _ in range(_POLISH_ROUNDS if directions.shape[1] else 0):
        slopes = [
            trials(here.gaps + step * way).slope - trials(here.gaps - step * way).slope
            for way in directions.T
        ]
        hessian = directions.T @ np.stack(slopes, axis=1) / (2.0 * step)
        hessian = 0.5 * (hessian + hessian.T)
        if not np.isfinite(hessian).all() or np.linalg.eigvalsh(hessian)[0] <= 0.0:
            break

        move = -directions @ np.linalg.solve(hessian, directions.T @ here.slope)
        moved = here.gaps + move
        outside = bool(
            (moved < minimum * (1.0 - 1e-12)).any() or moved.sum() > total * (1.0 + 1e-12)
        )
        # The factors 1 +- 1e-12, here and below, allow for rounding.
        # Newton's method is for the neighbourhood of a minimum: a tenth of a gap, chosen.
        if outside or np.abs(move).max() > 0.1 * float(here.gaps.min()):
            break

        trial = trials(moved)
        if trial.objective > here.objective * (1.0 + 1e-12):
            break
        here = trial
        # The next move would be some 1e-22 of the scale: below rounding.
        if np.abs(move).max() <= 1e-11 * trials.scale:
            break
    return here if here.objective <= best.objective * (1.0 + 1e-12) else best
