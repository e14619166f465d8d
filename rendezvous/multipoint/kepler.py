"""Visits under the gravity of one point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rendezvous._arrays import Floats, Integers
from rendezvous.multipoint._shooting import ShotPath, blocks_of, shoot
from rendezvous.multipoint.segments import NotSettledError, Path, check_times
from rendezvous.multipoint.tour import MovingTargets, Target, Visits, nodes_of
from rendezvous.two_body import coast

MAX_KNOWN = 64


@dataclass(frozen=True, eq=False)
class KeplerTargets(MovingTargets):
    """Targets on ellipses.

    `initial`, shape (n, 6), are their inertial states, m and m/s, at their epochs, `epoch_s`, shape (n,).
    """

    targets: tuple[Target, ...]
    initial: Floats
    epoch_s: Floats
    gravitational_parameter_m3_s2: float

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""
        return coast(self.initial[which], time_s - self.epoch_s[which], self.gravitational_parameter_m3_s2)


@dataclass(frozen=True, eq=False)
class KeplerTour(Visits):
    """A chaser and the targets it visits, all under the gravity of one point.

    `start_state`, shape (6,), is the chaser's inertial state at t = 0, on an ellipse, m and m/s; epochs of the targets
    refer to the same time.

    Raises
    ------
    ValueError
        If the start is not on an ellipse.

    Notes
    -----
    Newton's method solves the conditions of the maximum principle, with targets that move away from the chaser's
    coasting orbit in steps to their true positions, or from a known path near by. Mironov and Mironov (2007) linearise
    the motion about the last trajectory instead, which does not converge far from the coasting orbit.
    """

    targets: KeplerTargets
    start_state: Floats

    ruggedness = 3.0
    """Large: revolutions and the geometry of encounters cause many local minima."""

    def __post_init__(self) -> None:
        coast(self.start_state, 0.0, self.targets.gravitational_parameter_m3_s2)

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Return a path that satisfies the conditions of minimum energy; errors are those of `flyer`."""
        return self.flyer(order)(np.asarray(time_s, dtype=np.float64))

    def flyer(self, order: Sequence[int]) -> Callable[[Floats], Path]:
        """Return a function of N times that shoots paths of one `order`, each from the nearest one before.

        Raises
        ------
        NotSettledError
            By the function, if the targets cannot be followed from the coasting orbit; a ValueError if times do not
            increase.
        """
        mu = self.targets.gravitational_parameter_m3_s2
        known: list[tuple[Floats, list[Floats]]] = []

        def fly(time_s: Floats) -> ShotPath:
            nodes = nodes_of(self.targets, order, time_s)
            check_times(self.start_s, nodes.arrive_s, nodes.leave_s)
            blocks = blocks_of(self.start_s, self.start_state, nodes, mu)
            initials: Sequence[Floats | None] = [None] * len(blocks)
            if known:
                initials = min(known, key=lambda path: float(np.abs(path[0] - time_s).max()))[1]
            pairs = zip(blocks, initials, strict=True)
            shots = tuple(shot for block, initial in pairs if (shot := shoot(block, initial)) is not None)
            if len(shots) < len(blocks):
                raise NotSettledError(
                    "no trajectory was found: the targets were followed from the chaser's coasting orbit, but not all "
                    "the way; give visits more time, visit nearer targets first, or check units"
                )
            known.append((nodes.arrive_s, [shot.unknowns for shot in shots]))
            del known[:-MAX_KNOWN]
            return ShotPath.of(nodes, shots)

        return fly
