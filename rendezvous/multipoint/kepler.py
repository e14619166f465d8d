"""Visits under the gravity of one point: the combined method, linear problems about the last trajectory."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.multipoint._hamiltonian import LEAST_RADIUS
from rendezvous.multipoint._reference import Mixture, Reference, TracedPath, panels_of
from rendezvous.multipoint._shooting import ROUNDING, blocks_of, shoot, unknowns_of
from rendezvous.multipoint._shot_path import ShotPath
from rendezvous.multipoint.segments import Flown, Nodes, NotSettledError, Path, check_times, solve_segments
from rendezvous.multipoint.targets import Integers, Target, check_targets, dwells
from rendezvous.multipoint.tour import check_start, nodes_of
from rendezvous.relative_motion import TimeVaryingMotion
from rendezvous.two_body import coast, coasting_rates, gravity_gradient

Floats = NDArray[np.float64]

SETTLED = 1e-11
MOST_ROUNDS = 30
FEW_ROUNDS = 8
MOST_KNOWN = 64
RUGGED = 3.0
REMEDY = "give visits more time, visit nearer targets first, or check units"
GREATEST_CHANGE = 2.0


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
        check_targets(self.targets, self.initial)
        if np.shape(self.epoch_s) != (len(self.targets),) or not np.isfinite(self.epoch_s).all():
            raise ValueError("each target needs a finite epoch")

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the targets `which` at times `time_s`, one a time, shape (k, 6)."""
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
        The chaser's at t = 0, inertial, on an ellipse, m and m/s.

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

    def __post_init__(self) -> None:
        mu = self.targets.gravitational_parameter_m3_s2
        if not (np.isfinite(mu) and mu > 0.0):
            raise ValueError(f"the gravitational parameter must be positive and finite, found {mu!r} m^3/s^2")
        check_start(self.start_state, self.start_s)
        coast(self.start_state, 0.0, mu)

    @property
    def start_s(self) -> float:
        """When the chaser starts: at zero, to which the targets' epochs refer."""
        return 0.0

    @property
    def dwell_s(self) -> Floats:
        """How long the chaser stays with each target, shape (n,)."""
        return dwells(self.targets.targets)

    @property
    def ruggedness(self) -> float:
        """Much: revolutions and encounters' geometry make many local minima."""
        return RUGGED

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
        nodes = nodes_of(self.targets, order, time_s)
        check_times(self.start_s, nodes.arrive_s, nodes.leave_s)
        with contextlib.suppress(NotSettledError):
            return self._relinearise(nodes, self._coasting(nodes), rounds=FEW_ROUNDS)
        return self.flyer(order)(nodes.arrive_s).settled()

    def flyer(self, order: Sequence[int], near: Path | None = None) -> Callable[[Floats], Flown]:
        """Return what finds paths of one order for times asked in turn, each from the nearest one known.

        Parameters
        ----------
        order : sequence of int
        near : Path or None
            A path of that order, to begin from; None begins from the coasting orbit.

        Returns
        -------
        callable
            The path of times of shape (N,), shot; it is re-linearised about when it settles.

        Raises
        ------
        NotSettledError
            By what is returned, where the targets cannot be followed from the coasting orbit; a ValueError for times
            that do not increase.
        """
        mu = self.targets.gravitational_parameter_m3_s2
        known: list[tuple[Floats, list[Floats]]] = []
        if near is not None:
            known.append((near.nodes.arrive_s, unknowns_of(near, mu)))

        def fly(time_s: Floats) -> ShotPath:
            nodes = nodes_of(self.targets, order, time_s)
            check_times(self.start_s, nodes.arrive_s, nodes.leave_s)
            pieces = blocks_of(self.start_s, self.start_state, nodes)
            begin: Sequence[Floats | None] = [None] * len(pieces)
            if known:
                begin = min(known, key=lambda each: float(np.abs(each[0] - time_s).max()))[1]
            tried = [shoot(block, mu, one) for block, one in zip(pieces, begin, strict=True)]
            shots = tuple(each for each in tried if each is not None)
            if len(shots) < len(tried):
                raise NotSettledError(
                    "no trajectory was found: the targets were followed from the chaser's coasting orbit, but not all "
                    f"the way; {REMEDY}"
                )
            known.append((nodes.arrive_s, [each.unknowns for each in shots]))
            del known[:-MOST_KNOWN]
            return ShotPath(nodes, shots, self._settled)

        return fly

    def _relinearise(self, nodes: Nodes, reference: Reference, *, rounds: int = MOST_ROUNDS) -> Path:
        """Solve linear problems about one trajectory after another until they agree."""
        mu = self.targets.gravitational_parameter_m3_s2
        change = np.inf
        nearest = LEAST_RADIUS * float(np.linalg.norm(np.vstack([self.start_state, nodes.arrive])[:, :3], axis=1).min())
        mixture = Mixture()
        for each in range(rounds):
            try:
                path = solve_segments(self._motion_about(reference), self.start_s, self.start_state, nodes)
            except ValueError as error:
                raise NotSettledError(f"re-linearising leads to no trajectory: {error}; {REMEDY}") from None
            found = Reference.of_path(path, mu, reference, keep=each > 1)
            before, change = change, found.change_from(reference)
            hopeless = rounds == FEW_ROUNDS and change > 0.5 * before
            if hopeless or not change <= GREATEST_CHANGE or found.least_radius < nearest:
                break
            if change <= SETTLED or (change <= ROUNDING and change > 0.3 * before):
                path = solve_segments(self._motion_about(found), self.start_s, self.start_state, nodes)
                own = {each.name: getattr(path, each.name) for each in fields(path)}
                return TracedPath(**own, trace=panels_of(path, mu, found, keep=True))
            reference = mixture.mix(reference, found) if each > 1 else found
        raise NotSettledError(
            f"re-linearising does not settle: trajectories still differ by {change:.2g} of the distance from the "
            f"centre from round to round; {REMEDY}"
        )

    def _settled(self, shot: ShotPath) -> Path:
        return self._relinearise(shot.nodes, self._reference(shot.nodes, shot.states))

    def _coasting(self, nodes: Nodes) -> Reference:
        mu = self.targets.gravitational_parameter_m3_s2
        begin = self.start_state
        return self._reference(nodes, lambda times: coast(np.broadcast_to(begin, (len(times), 6)), times, mu))

    def _reference(self, nodes: Nodes, states: Callable[[Floats], Floats]) -> Reference:
        starts = np.concatenate([[self.start_s], nodes.leave_s[:-1]])
        return Reference.of_states(states, starts, nodes, self.targets.gravitational_parameter_m3_s2)

    def _motion_about(self, reference: Reference) -> TimeVaryingMotion:
        mu = self.targets.gravitational_parameter_m3_s2

        def drift(times: Floats) -> Floats:
            states = reference(times)
            pull = coasting_rates(states, mu)
            # f - A x: the velocity cancels, and gravity and its gradient along r leave three times gravity.
            pull[..., :3] = 0.0
            return np.asarray(3.0 * pull)

        return TimeVaryingMotion(lambda times: gravity_gradient(reference(times)[..., :3], mu), drift_at=drift)
