"""A path that visits targets, and its cost against each of the times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from experiments.common.display_units import Unit, time_unit
from experiments.multipoint.file import Axes
from infoset.arrays import Floats
from rendezvous.multipoint import Path, Visits

_POINTS = 1601
_CURVE_POINTS = 41
_NEAREST = 0.12
_JUMP = 0.3
_MOST_CURVES = 9


@dataclass(frozen=True, eq=False)
class Scene:
    """A path with the targets.

    Parameters
    ----------
    axes : Axes
        Axes of the positions.
    order : tuple of int
        Indices of the targets in the order of the visits.
    """

    axes: Axes
    tour: Visits
    order: tuple[int, ...]
    path: Path

    @property
    def names(self) -> list[str]:
        """Return the names of the targets in the order of the visits."""
        return [self.tour.targets.targets[target].name for target in self.order]

    @property
    def end_s(self) -> float:
        """Return the time of the last visit."""
        return float(self.path.nodes.arrive_s[-1])

    @property
    def time_unit(self) -> Unit:
        """Return the unit in which times are shown."""
        return time_unit(self.end_s - self.tour.start_s)

    @cached_property
    def times(self) -> Floats:
        """Return equally spaced times, and the times on both sides of each visit."""
        nodes = self.path.nodes
        even = np.linspace(self.tour.start_s, self.end_s, _POINTS)
        before = np.nextafter(nodes.arrive_s, -np.inf)
        return np.unique(np.concatenate([even, nodes.arrive_s, before, nodes.leave_s[:-1]]))

    def target_path(self, visit: int, times_s: Floats) -> Floats:
        """Return the positions of the target of a visit, shape (n, 3)."""
        targets = np.full(len(times_s), self.order[visit])
        return np.asarray(self.tour.targets.states(targets, times_s)[:, :3])


@dataclass(frozen=True)
class CostCurve:
    """Cost against the time of one visit, the other times fixed; both arrays have shape (k,)."""

    time_s: Floats
    cost: Floats


def cost_curves(scene: Scene, progress: Callable[[float], None] = lambda _done: None) -> list[CostCurve]:
    """Compute the cost against the time of each of the first nine visits, between its neighbours.

    A curve ends where no path exists, or where the path jumps to another local minimum.
    """
    count = min(len(scene.order), _MOST_CURVES)
    curves = []
    for visit in range(count):
        curves.append(_cost_curve(scene, visit))
        progress((visit + 1) / count)
    return curves


def _cost_curve(scene: Scene, visit: int) -> CostCurve:
    path, nodes = scene.path, scene.path.nodes
    low = scene.tour.start_s if visit == 0 else float(nodes.leave_s[visit - 1])
    dwell_s, now = float(nodes.leave_s[visit] - nodes.arrive_s[visit]), float(nodes.arrive_s[visit])
    last = visit == len(scene.order) - 1
    high = now + 0.5 * (now - low) if last else float(nodes.arrive_s[visit + 1]) - dwell_s
    width = high - low
    times = np.linspace(low + _NEAREST * width, high if last else high - _NEAREST * width, _CURVE_POINTS)
    times = np.unique(np.append(times, now))
    # From the present time outwards, so that each path starts from a near one.
    costs = {now: path.cost}
    for side in (times[times > now], times[times < now][::-1]):
        fly = scene.tour.flyer(scene.order, path)
        reached, cost, slope = now, path.cost, float(path.time_gradient[visit])
        for time in side:
            varied = nodes.arrive_s.copy()
            varied[visit] = time
            try:
                flown = fly(varied)
            except ValueError:
                break
            expected = cost + 0.5 * (time - reached) * (slope + float(flown.time_gradient[visit]))
            if abs(flown.cost - expected) > _JUMP * max(flown.cost, cost):
                break
            reached, cost, slope = float(time), flown.cost, float(flown.time_gradient[visit])
            costs[reached] = cost
    known = np.array(sorted(costs))
    return CostCurve(known, np.array([costs[time] for time in known]))
