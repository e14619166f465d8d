"""A path under a point's gravity as shooting finds it: quick, and as much as the choice of times needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rendezvous.multipoint._shooting import Shot
from rendezvous.multipoint.segments import Nodes, Path
from rendezvous.two_body import coast

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ShotPath:
    """Trajectories that were shot, one after another, and the stays between them.

    Parameters
    ----------
    nodes : Nodes
    shots : tuple of Shot
        One a block of visits.
    settle : callable
        Makes a path of this.
    """

    nodes: Nodes
    shots: tuple[Shot, ...]
    settle: Callable[[ShotPath], Path]

    @property
    def cost(self) -> float:
        """I = 1/2 int |u|^2 dt, m^2/s^3."""
        return sum(energy for *_, energy in self._ends)

    @property
    def time_gradient(self) -> Floats:
        """Slopes dI / dt_i, shape (N,).

        Notes
        -----
        D'(V_i - V) at a flyby; at a rendezvous H - lambda' x_i' is the power 1/2 |u|^2, after less before.
        """
        states, before, starting = (np.concatenate(each) for each in list(zip(*self._ends, strict=True))[:3])
        after = np.concatenate([starting[1:], np.zeros((1, 6))])
        met = self.nodes.rendezvous
        gradient = ((before - after)[:, :3] * (self.nodes.arrive[:, 3:] - states[:, 3:])).sum(axis=1)
        power = 0.5 * (after[:, 3:] ** 2).sum(axis=1) - 0.5 * (before[:, 3:] ** 2).sum(axis=1)
        return np.asarray(np.where(met, power, gradient))

    def settled(self) -> Path:
        """Return the path that re-linearising about this one gives."""
        return self.settle(self)

    def states(self, time_s: Floats) -> Floats:
        """Return states at times of shape (k,), shape (k, 6); those of the target during a stay."""
        found = np.empty((len(time_s), 6))
        which = np.searchsorted(np.array([each.block.start_s for each in self.shots]), time_s, side="right") - 1
        for place, shot in enumerate(self.shots):
            mine, end = np.flatnonzero(which == place), float(shot.block.time_s[-1])
            mine = mine[np.argsort(time_s[mine], kind="stable")]
            found[mine] = shot.along(np.minimum(time_s[mine], end))[0]
            stays = mine[time_s[mine] > end]
            at = np.broadcast_to(shot.block.goal[-1], (len(stays), 6))
            found[stays] = coast(at, time_s[stays] - end, shot.gravitational_parameter_m3_s2)
        return found

    @cached_property
    def _ends(self) -> list[tuple[Floats, Floats, Floats, float]]:
        return [each.ends() for each in self.shots]
