"""What visits to several targets cost against each of their times, the others as they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.multipoint import Path, Visits

Floats = NDArray[np.float64]
Progress = Callable[[float], None]

_CURVE_POINTS = 41
_NEAREST = 0.12
_JUMP = 0.3
_MOST_CURVES = 9


@dataclass(frozen=True)
class CostCurve:
    """The cost against one time, the others as they are.

    Parameters
    ----------
    time_s, cost : ndarray, shape (k,)
    """

    time_s: Floats
    cost: Floats


def cost_curves(
    tour: Visits, order: tuple[int, ...], path: Path, progress: Progress = lambda _done: None
) -> list[CostCurve]:
    """Compute the cost against each time between its neighbours.

    Parameters
    ----------
    tour : Visits
    order : tuple of int
        Which target first, second and so on.
    path : Path
    progress : callable
        Told the fraction done.

    Returns
    -------
    list of CostCurve
        One a visit, of the first nine; each ends where paths do, or where they jump to another local minimum.
    """
    nodes, curves = path.nodes, []
    count = min(len(order), _MOST_CURVES)
    for index in range(count):
        low = tour.start_s if index == 0 else float(nodes.leave_s[index - 1])
        stay = float(nodes.leave_s[index] - nodes.arrive_s[index])
        last = index == len(order) - 1
        now = float(nodes.arrive_s[index])
        high = now + 0.5 * (now - low) if last else float(nodes.arrive_s[index + 1]) - stay
        width = high - low
        times = np.linspace(low + _NEAREST * width, high if last else high - _NEAREST * width, _CURVE_POINTS)
        times = np.unique(np.append(times, now))
        # From the time as it is outward, so that each path begins from a near one.
        found = {now: path.cost}
        for side in (times[times > now], times[times < now][::-1]):
            fly = tour.flyer(order, path)
            reached, cost, slope = now, path.cost, float(path.time_gradient[index])
            for time in side:
                varied = nodes.arrive_s.copy()
                varied[index] = time
                try:
                    flown = fly(varied)
                except ValueError:
                    break
                expected = cost + 0.5 * (time - reached) * (slope + float(flown.time_gradient[index]))
                if abs(flown.cost - expected) > _JUMP * max(flown.cost, cost):
                    break
                reached, cost, slope = float(time), flown.cost, float(flown.time_gradient[index])
                found[reached] = cost
        known = np.array(sorted(found))
        curves.append(CostCurve(known, np.array([found[time] for time in known])))
        progress((index + 1) / count)
    return curves
