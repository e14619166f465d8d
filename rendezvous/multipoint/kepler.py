"""Visits under the gravity of one point: the combined method, linear problems about the last trajectory."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.multipoint._reference import Mixture, Reference
from rendezvous.multipoint._shooting import Shot, blocks_of, shoot, unknowns_of
from rendezvous.multipoint.segments import Nodes, Path, check_times, solve_segments
from rendezvous.multipoint.targets import Integers, Target, check_names
from rendezvous.multipoint.tour import nodes_of
from rendezvous.relative_motion import TimeVaryingMotion
from rendezvous.two_body import coast, coasting_rates, gravity_gradient

Floats = NDArray[np.float64]

SETTLED = 1e-11
ROUNDING = 1e-8
MOST_ROUNDS = 30
FEW_ROUNDS = 8
GREATEST_CHANGE = 2.0
LEAST_RADIUS = 0.02


class NotSettledError(ValueError):
    """Re-linearising leads to no trajectory."""


@dataclass(frozen=True, eq=False)
class KeplerTargets:
    """Targets on ellipses.

    Parameters
    ----------
    targets : tuple of Target
    initial : ndarray, shape (n, 6)
        Their inertial states, each at its epoch, m and m/s.
    epoch_s : ndarray, shape (n,)
    gravitational_parameter_m3_s2 : float

    Raises
    ------
    ValueError
        If there is none, two have one name, or a number is not finite.
    """

    targets: tuple[Target, ...]
    initial: Floats
    epoch_s: Floats
    gravitational_parameter_m3_s2: float

    def __post_init__(self) -> None:
        check_names(self.targets)
        if np.shape(self.initial) != (len(self.targets), 6) or not np.isfinite(self.initial).all():
            raise ValueError("each target needs a state of six finite numbers")
        if np.shape(self.epoch_s) != (len(self.targets),) or not np.isfinite(self.epoch_s).all():
            raise ValueError("each target needs a finite epoch")

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States of targets, one a time, shape (k, 6)."""
        return coast(self.initial[which], time_s - self.epoch_s[which], self.gravitational_parameter_m3_s2)

    def rates(self, time_s: Floats, states: Floats) -> Floats:
        """Time derivatives of such states, at any times, shape (k, 6)."""
        return coasting_rates(states, self.gravitational_parameter_m3_s2)


@dataclass(frozen=True, eq=False)
class KeplerTour:
    """A chaser and the targets it visits, all under the gravity of one point.

    Parameters
    ----------
    targets : KeplerTargets
    start_state : ndarray, shape (6,)
        The chaser's, inertial, on an ellipse, m and m/s.
    start_s : float

    Raises
    ------
    ValueError
        If the gravitational parameter is not positive, or the start is not finite or on no ellipse.

    Notes
    -----
    The combined method of Mironov and Mironov (2007): x' = A(t) x + w(t) + B u with A and w from the last trajectory is
    a linear problem; its answer is the next trajectory. Where they agree, the answer satisfies the maximum principle of
    the nonlinear problem. Far from the coasting orbit the rounds do not settle by themselves: there a first trajectory
    is shot, the targets moving away from the coasting orbit, and rounds are mixed after Anderson (1965).
    """

    targets: KeplerTargets
    start_state: Floats
    start_s: float = 0.0

    def __post_init__(self) -> None:
        mu = self.targets.gravitational_parameter_m3_s2
        if not (np.isfinite(mu) and mu > 0.0):
            raise ValueError(f"the gravitational parameter must be positive and finite, found {mu!r} m^3/s^2")
        if np.shape(self.start_state) != (6,) or not np.isfinite(self.start_state).all():
            raise ValueError("the chaser's state must be six finite numbers")
        if not np.isfinite(self.start_s):
            raise ValueError("the start is not finite")
        coast(self.start_state, 0.0, mu)

    @property
    def dwell_s(self) -> Floats:
        """How long the chaser stays with each target, shape (n,)."""
        return np.array([each.dwell_s for each in self.targets.targets])

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Find a path that satisfies the conditions of least energy, near the chaser's coasting orbit.

        Parameters
        ----------
        order : sequence of int
            Which targets, first to last; some or all, each once.
        time_s : array_like, shape (N,)
            When each is reached, in that order.

        Returns
        -------
        Path
            Its motion is linear about its own trajectory.

        Raises
        ------
        NotSettledError
            If re-linearising leads to no trajectory, not even where the targets are followed from the coasting orbit.
        """
        return self.flyer(order)(np.asarray(time_s, dtype=np.float64))

    def flyer(self, order: Sequence[int], near: Path | None = None) -> Callable[[Floats], Path]:
        """Return what finds paths of one order for times asked in turn, each from the last one's costates.

        Parameters
        ----------
        order : sequence of int
        near : Path or None
            A path of that order, to begin from; None begins from the coasting orbit.

        Returns
        -------
        callable
            The path of times of shape (N,).
        """
        mu = self.targets.gravitational_parameter_m3_s2
        last: list[Floats] = [] if near is None else unknowns_of(near, mu)

        def fly(time_s: Floats) -> Path:
            nodes = nodes_of(self.targets, order, time_s)
            check_times(self.start_s, nodes.arrive_s, nodes.leave_s)
            reference = None
            if not last:
                with contextlib.suppress(NotSettledError):
                    return self._relinearise(nodes, self._coasting(nodes), rounds=FEW_ROUNDS)
            shots = []
            for place, block in enumerate(blocks_of(self.start_s, self.start_state, nodes)):
                shot = shoot(block, mu, last[place] if last else None)
                if shot is None:
                    raise NotSettledError(
                        "no trajectory was found: the targets were followed from the chaser's coasting orbit, but not "
                        "all the way; give visits more time, or nearer targets first"
                    )
                shots.append(shot)
            last[:] = [each.unknowns for each in shots]
            reference = self._reference_of(nodes, shots)
            return self._relinearise(nodes, reference)

        return fly

    def rounds(self, order: Sequence[int], time_s: ArrayLike) -> list[float]:
        """Return the energy after each round of the combined method, m^2/s^3.

        Parameters
        ----------
        order : sequence of int
        time_s : array_like, shape (N,)

        Returns
        -------
        list of float
        """
        nodes = nodes_of(self.targets, order, time_s)
        costs: list[float] = []
        self._relinearise(nodes, self._coasting(nodes), costs=costs)
        return costs

    def _relinearise(
        self, nodes: Nodes, reference: Reference, *, rounds: int = MOST_ROUNDS, costs: list[float] | None = None
    ) -> Path:
        """Solve linear problems about one trajectory after another until they agree."""
        mu = self.targets.gravitational_parameter_m3_s2
        change = np.inf
        nearest = LEAST_RADIUS * float(np.linalg.norm(np.vstack([self.start_state, nodes.arrive])[:, :3], axis=1).min())
        mixture = Mixture()
        for each in range(rounds):
            path = solve_segments(self._motion_about(reference), self.start_s, self.start_state, nodes)
            if costs is not None:
                costs.append(path.cost)
            found = Reference.of_path(path, mu, reference, keep=each > 1)
            before, change = change, found.change_from(reference)
            hopeless = rounds == FEW_ROUNDS and change > 0.5 * before
            if hopeless or not change <= GREATEST_CHANGE or found.least_radius < nearest:
                break
            if change <= SETTLED or (change <= ROUNDING and change > 0.3 * before):
                return solve_segments(self._motion_about(found), self.start_s, self.start_state, nodes)
            reference = mixture.mix(reference, found) if each > 1 else found
        raise NotSettledError(
            f"re-linearising does not settle: trajectories still differ by {change:.2g} of the distance from the "
            "centre from round to round; give visits more time, or nearer targets first"
        )

    def _reference_of(self, nodes: Nodes, shots: Sequence[Shot]) -> Reference:
        """Represent trajectories that were shot, and the stays between them."""
        mu = self.targets.gravitational_parameter_m3_s2
        ends = np.array([float(each.block.time_s[-1]) for each in shots])

        def states(times: Floats) -> Floats:
            found = np.empty((len(times), 6))
            which = np.searchsorted(np.array([each.block.start_s for each in shots]), times, side="right") - 1
            for place, shot in enumerate(shots):
                mine = np.flatnonzero(which == place)
                mine = mine[np.argsort(times[mine], kind="stable")]
                found[mine] = shot.states(np.minimum(times[mine], ends[place]))
                stays = mine[times[mine] > ends[place]]
                at = np.broadcast_to(shot.block.goal[-1], (len(stays), 6))
                found[stays] = coast(at, times[stays] - ends[place], mu)
            return found

        starts = np.concatenate([[self.start_s], nodes.leave_s[:-1]])
        return Reference.of_states(states, starts, nodes, mu)

    def _coasting(self, nodes: Nodes) -> Reference:
        mu = self.targets.gravitational_parameter_m3_s2
        starts = np.concatenate([[self.start_s], nodes.leave_s[:-1]])
        return Reference.of_states(
            lambda times: coast(np.broadcast_to(self.start_state, (len(times), 6)), times - self.start_s, mu),
            starts,
            nodes,
            mu,
        )

    def _motion_about(self, reference: Reference) -> TimeVaryingMotion:
        mu = self.targets.gravitational_parameter_m3_s2

        def drift(times: Floats) -> Floats:
            states = reference(times)
            pull = coasting_rates(states, mu)
            # f - A x: the velocity cancels, and gravity and its gradient along r leave three times gravity.
            pull[..., :3] = 0.0
            return np.asarray(3.0 * pull)

        return TimeVaryingMotion(lambda times: gravity_gradient(reference(times)[..., :3], mu), drift_at=drift)
