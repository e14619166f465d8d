"""Visits under the gravity of one point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from infoset.rendezvous._arrays import Floats, Integers
from infoset.rendezvous.multipoint._shooting import ShotPath, blocks_of, shoot
from infoset.rendezvous.multipoint.segments import NotSettledError, Path, check_times
from infoset.rendezvous.multipoint.tour import TourTarget, Visits
from infoset.rendezvous.two_body import coast

MAX_KNOWN = 64
"""Largest number of paths that a flyer stores; chosen: descents need the last few."""


@dataclass(frozen=True, eq=False)
class KeplerTour(Visits):
    """A chaser and the targets it visits, all under the gravity of one point.

    `initial`, shape (n, 6), are the inertial states of the targets, m and m/s, at their epochs,
    `epoch_s`, shape (n,). `start_state`, shape (6,), is the chaser's at t = 0; epochs refer to the
    same time. All may be on any conic.

    Raises
    ------
    ValueError
        If the start is at the attracting point or not finite, or two targets have the same name.

    Notes
    -----
    Newton's method solves the conditions of the maximum principle, with targets that move away from
    the chaser's coasting orbit in steps to their true positions, or from a known path near by.
    Mironov and Mironov (2007) linearise the motion about the last trajectory instead, which does
    not converge far from the coasting orbit.
    """

    targets: tuple[TourTarget, ...]
    initial: Floats
    epoch_s: Floats
    gravitational_parameter_m3_s2: float
    start_state: Floats

    ruggedness = 3.0
    """Large: revolutions and the geometry of encounters cause many local minima."""

    def __post_init__(self) -> None:
        super().__post_init__()
        # Raises ValueError if the start is at the attracting point or not finite.
        coast(self.start_state, 0.0, self.gravitational_parameter_m3_s2)

    def target_states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""
        return coast(
            self.initial[which], time_s - self.epoch_s[which], self.gravitational_parameter_m3_s2
        )

    def flyer(self, order: Sequence[int]) -> Callable[[Floats], Path]:
        """Return a function of N times that shoots a path of one `order` from the nearest path.

        Raises
        ------
        NotSettledError
            By the function, if the targets cannot be followed from the coasting orbit; a ValueError
            if times do not increase.
        """
        known: list[tuple[Floats, list[Floats]]] = []

        def fly(time_s: Floats) -> ShotPath:
            # The search begins at the known path whose times are nearest; only the last few are
            # kept.
            nodes = self.nodes(order, time_s)
            check_times(self.start_s, nodes.arrive_s, nodes.leave_s)
            blocks = blocks_of(
                self.start_s, self.start_state, nodes, self.gravitational_parameter_m3_s2
            )
            initials: Sequence[Floats | None] = [None] * len(blocks)
            if known:
                initials = min(known, key=lambda path: float(np.abs(path[0] - time_s).max()))[1]
            pairs = zip(blocks, initials, strict=True)
            shots = tuple(
                shot for block, initial in pairs if (shot := shoot(block, initial)) is not None
            )
            if len(shots) < len(blocks):
                raise NotSettledError(
                    "no trajectory was found: the targets were followed from the chaser's "
                    "coasting orbit, but not all the way; give visits more time, visit nearer "
                    "targets first, or check units"
                )
            known.append((nodes.arrive_s, [shot.unknowns for shot in shots]))
            del known[:-MAX_KNOWN]
            return ShotPath.of(nodes, shots)

        return fly
