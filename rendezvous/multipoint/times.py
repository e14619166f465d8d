"""The best times of visits in a given order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.stats import qmc

from rendezvous.multipoint.segments import Flown, NotSettledError, Path

Floats = NDArray[np.float64]
FlyAt = Callable[[Floats], Flown]

LEAST_SHARE = 1e-6
"""The least gap, as a share of the time there is, where none is given: a visit takes time."""
_POLISH_ROUNDS = 8
_DIFFERENCE = 1e-5
_WALL = 20.0
_MOST_WALLS = 6
_MOST_RESTARTS = 4
_SETTLED = 1e-3
_ROUNDING = 1e-26
_CLOCK = 1e-9
"""Time for travelling, as a share of the times themselves, that is none: rounding of times leaves no gaps in it."""


class Effort(Enum):
    """How hard the best times are looked for: (starts of its own, how many are followed, relative tolerance)."""

    BOUND = (1, 1, 1e-5)
    """For a bound on a beginning of an order, from times known to be good."""
    ORDER = (6, 2, 1e-7)
    """For comparing orders."""
    RUGGED = (14, 5, 1e-5)
    """For comparing orders whose cost has many local minima."""
    FINAL = (48, 6, 1e-9)
    """For the answer, to the last digits."""

    @property
    def spread(self) -> int:
        """How many starts are made up, beside those given."""
        return int(self.value[0])

    @property
    def followed(self) -> int:
        """How many starts, the best ones, are followed downhill."""
        return int(self.value[1])

    @property
    def tolerance(self) -> float:
        """Relative change of the cost at which a descent ends."""
        return float(self.value[2])


@dataclass(frozen=True)
class TimeLimits:
    """What holds the times.

    Parameters
    ----------
    latest_s : float or None
        When the last visit must be over at the latest.
    least_gap_s : float
        Between a departure and the next arrival.
    price_per_s : float
        kappa: what a second from the start to the last visit costs, added to the energy, m^2/s^4; not negative.

    Raises
    ------
    ValueError
        If nothing holds the last time: the energy falls to zero as it grows, and there is no best.
    """

    latest_s: float | None = None
    least_gap_s: float = 0.0
    price_per_s: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("least gap", self.least_gap_s), ("price of a second", self.price_per_s)):
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"the {name} must be finite and not negative, found {value!r}")
        if self.latest_s is not None and not np.isfinite(self.latest_s):
            raise ValueError("the latest time is not finite")
        if self.latest_s is None and self.price_per_s == 0.0:
            raise ValueError(
                "with the last time free the energy falls to zero as it grows, so there is no best: "
                "bound it by a latest time, or give a second a price"
            )


@dataclass(frozen=True, eq=False)
class BestTimes:
    """Visits at their best times.

    Parameters
    ----------
    flown : Flown
    objective : float
        Energy, and the price of the time, m^2/s^3.
    evaluations : int
        How many paths were computed.
    """

    flown: Flown
    objective: float
    evaluations: int

    @cached_property
    def path(self) -> Path:
        """The path, settled at the first call."""
        return self.flown.settled()

    @property
    def time_s(self) -> Floats:
        """When the targets are reached, shape (N,)."""
        return self.flown.nodes.arrive_s


@dataclass(frozen=True, eq=False)
class _Trial:
    """Gaps, the path they give, what it costs and the slope of that along the gaps."""

    gaps: Floats
    flown: Flown
    objective: float
    slope: Floats


class NoRoomError(ValueError):
    """The visits do not fit before the latest time."""


class _StoppedError(Exception):
    """A descent that finds no paths around it, or is low enough."""


@dataclass
class _Trials:
    """Paths of gaps, counted."""

    fly: FlyAt
    shifts_s: Floats
    price_per_s: float
    flown: int = 0

    def __call__(self, gaps: Floats) -> _Trial:
        times = self.shifts_s + np.cumsum(gaps)
        self.flown += 1
        found = self.fly(times)
        gradient = found.time_gradient.copy()
        gradient[-1] += self.price_per_s
        slope = np.cumsum(gradient[::-1])[::-1]
        return _Trial(gaps, found, found.cost + self.price_per_s * float(times[-1] - self.shifts_s[0]), slope)

    def attempt(self, gaps: Floats) -> _Trial | None:
        """Fly, or return None where there is no path of such times."""
        try:
            return self(gaps)
        except ValueError:
            return None


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
    """Find the times of least energy, or energy and price, of visits in one order.

    Parameters
    ----------
    fly : callable
        The path of given times.
    start_s : float
    dwell_s : ndarray, shape (N,)
        How long the chaser stays with each target.
    limits : TimeLimits
    guesses : sequence of ndarray, shape (N,)
        Times to start from, beside those of its own; unsound ones are left out.
    effort : Effort
    enough : float
        An objective, in its own units, below which nobody asks how low it gets: the descent stops there.
    progress : callable or None
        Told the share of starts that are followed.

    Returns
    -------
    BestTimes
        A local minimum, the best of those found.

    Raises
    ------
    NoRoomError
        If the visits do not fit before the latest time.
    NotSettledError
        If the conditions of a minimum are not met by what is found; with the final effort alone.

    Notes
    -----
    The problem is not convex: of many starts those are followed first that cost no more than their neighbours, and no
    lower minimum elsewhere is ruled out. Sequential quadratic programming in the gaps, on the logarithm of the cost,
    with the exact gradient dI/dt; then Newton's method with differences of it on the gaps that no limit holds. Each
    step is one path.
    """
    count = len(dwell_s)
    shifts = start_s + np.concatenate([[0.0], np.cumsum(dwell_s[:-1])])
    total = room_s(start_s, dwell_s, limits)
    scale = total if np.isfinite(total) else _longest(guesses, start_s, count)
    least = max(limits.least_gap_s, LEAST_SHARE * scale)
    trials = _Trials(fly, shifts, limits.price_per_s)
    candidates = [np.diff(np.concatenate([[0.0], np.asarray(each) - shifts])) for each in guesses]
    candidates += _spread(count, scale, least, bounded=np.isfinite(total), most=effort.spread)
    sound = [each for each in candidates if (each >= least * (1 - 1e-9)).all() and each.sum() <= total * (1 + 1e-12)]
    begun = [each for each in map(trials.attempt, sound) if each is not None]
    if not begun:
        trials(sound[0])  # says why
    followed = _valleys(begun, effort.followed)
    ended = []
    for index, each in enumerate(followed):
        ended.append(_descend(trials, each, least, total, scale, effort.tolerance, enough))
        if progress is not None:
            progress((index + 1) / len(followed))
        if ended[-1].objective < enough:
            break
    best = min(ended, key=lambda each: each.objective)
    if effort is Effort.FINAL:
        best = _polish(trials, best, least, total, scale)
        for _ in range(_MOST_RESTARTS):
            if _unsettled(best, least, total) <= _SETTLED:
                break
            again = _descend(trials, best, least, total, best.gaps, effort.tolerance, enough)
            best = _polish(trials, again, least, total, scale)
        if not _unsettled(best, least, total) <= _SETTLED:
            raise NotSettledError(
                f"the best times that were found cost {best.objective:.6g} m^2/s^3 and are no minimum: a change of a "
                "gap would still lower that; start from other times, or give visits more time"
            )
    return BestTimes(best.flown, best.objective, trials.flown)


def _unsettled(best: _Trial, least: float, total: float) -> float:
    """By how much the conditions of a minimum are missed, relative to the objective.

    To first order, by what share of the objective a change of one gap by its own length, or down to the least one,
    would lower it, or as far as the limits let it change; where the latest time holds, at the cost of the others.
    """
    gaps, excess = best.gaps, np.maximum(best.gaps - least, 0.0)
    slope = best.slope
    full = bool(np.isfinite(total)) and total - gaps.sum() <= 1e-9 * total
    if full and excess.sum() > 0.0:
        slope = slope + max(0.0, -float(excess @ slope) / float(excess.sum()))
    farthest = max(total - gaps.sum(), 0.0) + excess.sum()
    gain = np.maximum(-slope * np.minimum(gaps, farthest), slope * excess)
    # A path that costs nothing is one up to the rounding of states.
    states = best.flown.nodes.arrive
    size = (states[:, :3] ** 2).sum(axis=1) / gaps**3 + (states[:, 3:] ** 2).sum(axis=1) / gaps
    return float(gain.max() / (best.objective + _ROUNDING * size.sum()))


def room_s(start_s: float, dwell_s: Floats, limits: TimeLimits) -> float:
    """Return the time there is for travelling, s; infinite without a latest time.

    Parameters
    ----------
    start_s : float
    dwell_s : ndarray, shape (N,)
    limits : TimeLimits

    Returns
    -------
    float

    Raises
    ------
    NoRoomError
        If the visits do not fit before the latest time.
    """
    if limits.latest_s is None:
        return float(np.inf)
    stays = float(dwell_s[:-1].sum())
    total = limits.latest_s - start_s - stays
    need = len(dwell_s) * limits.least_gap_s
    clock = max(abs(limits.latest_s), abs(start_s))
    if not total > _CLOCK * clock or total < need - 1e-14 * clock:
        raise NoRoomError(
            f"{len(dwell_s)} visits do not fit before the latest time, {limits.latest_s:g} s: with gaps of at least "
            f"{limits.least_gap_s:g} s and the dwells the last one is after {start_s + stays + need:g} s at the "
            "earliest"
        )
    return max(total, need)


def _longest(guesses: Sequence[Floats], start_s: float, count: int) -> float:
    """A length of time to start from, where nothing bounds it: that of the guesses."""
    ends = [float(each[-1]) - start_s for each in guesses if len(each) == count]
    if not ends or max(ends) <= 0.0:
        raise ValueError("with the last time free, times to start from are needed")
    return max(ends)


def _spread(count: int, scale: float, least: float, bounded: bool, most: int) -> list[Floats]:
    """Gaps to start from: even, rising and falling, over all the time and over half of it, and a Halton sequence."""
    rising = np.arange(1.0, count + 1.0)
    lengths = (1.0, 0.5) if bounded else (0.5, 1.0, 2.0, 4.0, 8.0)
    extra = max(scale - count * least, 0.0) if bounded else scale
    shares = [length * each / each.sum() for each in (np.ones(count), rising, rising[::-1]) for length in lengths]
    for each in qmc.Halton(count + 1, scramble=False).random(most + 1)[1:]:
        weights = 0.2 - np.log(each)
        if bounded:  # the last weight is that of the time that is left at the end
            shares.append((weights / weights.sum())[:count])
        else:
            shares.append(0.5 * 16.0 ** each[count] * weights[:count] / weights[:count].sum())
    return [least + extra * each for each in shares[:most]]


def _valleys(begun: Sequence[_Trial], most: int) -> list[_Trial]:
    """Starts that cost no more than those nearest to them, the cheapest first: one start in each valley.

    References
    ----------
    Toern and Viitanen, "Topographical global optimization using pre-sampled points", J. Global Optim. 5 (1994) 267-276.
    """
    ranked = sorted(begun, key=lambda each: each.objective)
    places = np.stack([each.gaps for each in ranked])
    nearest = cKDTree(places).query(places, k=min(len(ranked), places.shape[1] + 2))[1].reshape(len(ranked), -1)
    lowest = (nearest >= np.arange(len(ranked))[:, None]).all(axis=1)
    return [ranked[at] for at in np.argsort(~lowest, kind="stable")[:most]]


def _descend(
    trials: _Trials,
    begin: _Trial,
    least: float,
    total: float,
    scale: float | Floats,
    tolerance: float,
    enough: float,
) -> _Trial:
    """Follow one start downhill; where there are no paths all around, only so far, and no farther than enough."""
    if begin.objective < enough:
        return begin
    floor = 1e-30 * max(begin.objective, 1e-270)
    shares = np.broadcast_to(scale, begin.gaps.shape) / total
    walls, lowest = 0, begin

    def value(x: Floats) -> tuple[float, Floats]:
        nonlocal walls, lowest
        gaps = np.maximum(x * scale, 0.5 * least)
        found = trials.attempt(gaps)
        if found is None:
            walls += 1
            if walls > _MOST_WALLS:
                raise _StoppedError
            return float(np.log(begin.objective)) + _WALL, np.zeros_like(x)
        if found.objective < lowest.objective and (gaps == _within(gaps, least, total)).all():
            lowest = found
            if lowest.objective < enough:
                raise _StoppedError
        size = max(found.objective, floor)
        return float(np.log(size)), found.slope * (scale / size)

    constraints = (
        {"type": "ineq", "fun": lambda x: 1.0 - (x * scale).sum() / total, "jac": lambda _: -shares}
        if np.isfinite(total)
        else ()
    )
    try:
        found = minimize(
            value,
            begin.gaps / scale,
            jac=True,
            bounds=[(float(each), None) for each in np.broadcast_to(least / scale, begin.gaps.shape)],
            constraints=constraints,
            method="SLSQP",
            options={"ftol": tolerance, "maxiter": 100},
        )
    except _StoppedError:
        return lowest
    ended = trials.attempt(_within(np.asarray(found.x) * scale, least, total))
    return ended if ended is not None and ended.objective <= lowest.objective else lowest


def _within(gaps: Floats, least: float, total: float) -> Floats:
    """Take back what rounding put outside."""
    gaps = np.maximum(gaps, least)
    excess = gaps - least
    over = gaps.sum() - total
    if over > 0.0 and excess.sum() > 0.0:
        gaps = gaps - over * excess / excess.sum()
    return np.asarray(gaps)


def _polish(trials: _Trials, best: _Trial, least: float, total: float, scale: float) -> _Trial:
    """Newton's method on the gaps that no limit holds, with the sum held where the latest time does."""
    near = 1e-5 * scale
    gaps = best.gaps
    full = total - gaps.sum() <= near
    held = gaps - least <= near
    if held.all():
        return best
    if full:  # exactly at the latest time, whatever else moves
        gaps = gaps.copy()
        gaps[gaps.argmax()] += total - gaps.sum()
    directions = np.eye(len(gaps))[:, ~held]
    if full:
        directions = directions @ np.linalg.svd(np.ones((1, directions.shape[1])))[2][1:].T
    here = trials(gaps)
    step = _DIFFERENCE * float(gaps.min())
    for _ in range(_POLISH_ROUNDS if directions.shape[1] else 0):
        slopes = [trials(here.gaps + step * way).slope - trials(here.gaps - step * way).slope for way in directions.T]
        bend = directions.T @ np.stack(slopes, axis=1) / (2.0 * step)
        bend = 0.5 * (bend + bend.T)
        if not np.isfinite(bend).all() or np.linalg.eigvalsh(bend)[0] <= 0.0:
            break
        move = -directions @ np.linalg.solve(bend, directions.T @ here.slope)
        there = here.gaps + move
        outside = bool((there < least * (1.0 - 1e-12)).any() or there.sum() > total * (1.0 + 1e-12))
        if outside or np.abs(move).max() > 0.1 * float(here.gaps.min()):
            break
        found = trials(there)
        if found.objective > here.objective * (1.0 + 1e-12):
            break
        here = found
        if np.abs(move).max() <= 1e-11 * scale:
            break
    return here if here.objective <= best.objective * (1.0 + 1e-12) else best
