"""Visits under the gravity of one point: the combined method, linear problems about the last trajectory."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.multipoint._hamiltonian import LEAST_RADIUS
from rendezvous.multipoint._reference import Mixture, Reference, TracedPath, panels_of
from rendezvous.multipoint._shooting import ROUNDING, ShotPath, blocks_of, shoot, unknowns_of
from rendezvous.multipoint.segments import Flown, Nodes, NotSettledError, Path, check_times, solve_segments
from rendezvous.multipoint.targets import Integers, MovingTargets, Target
from rendezvous.multipoint.tour import Visits, nodes_of
from rendezvous.relative_motion import TimeVaryingMotion
from rendezvous.two_body import coast, coasting_rates, gravity_gradient

Floats = NDArray[np.float64]

SETTLED = 1e-11
MOST_ROUNDS = 30
FEW_ROUNDS = 8
MOST_KNOWN = 64
REMEDY = "give visits more time, visit nearer targets first, or check units"
GREATEST_CHANGE = 2.0


@dataclass(frozen=True, eq=False)
class KeplerTargets(MovingTargets):
    """Targets on ellipses.

    Parameters
    ----------
    targets : tuple of Target
        At least one.
    initial : ndarray, shape (n, 6)
        Inertial states of the targets at their epochs, m and m/s.
    epoch_s : ndarray, shape (n,)
        Epochs of the targets.
    gravitational_parameter_m3_s2 : float
        mu.

    Raises
    ------
    ValueError
        If there is no target, two have one name, or a number is not finite.
    """

    targets: tuple[Target, ...]
    initial: Floats
    epoch_s: Floats
    gravitational_parameter_m3_s2: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.shape(self.epoch_s) != (len(self.targets),) or not np.isfinite(self.epoch_s).all():
            raise ValueError("each target needs a finite epoch")

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""
        return coast(self.initial[which], time_s - self.epoch_s[which], self.gravitational_parameter_m3_s2)

    def rates(self, time_s: Floats, states: Floats) -> Floats:
        """Time derivatives of `states` of targets at k times, shape (k, 6)."""
        return coasting_rates(states, self.gravitational_parameter_m3_s2)


@dataclass(frozen=True, eq=False)
class KeplerTour(Visits):
    """A chaser and the targets it visits, all under the gravity of one point.

    Parameters
    ----------
    targets : KeplerTargets
        Targets; their epochs refer to the start of the chaser.
    start_state : ndarray, shape (6,)
        Inertial state of the chaser at t = 0, on an ellipse, m and m/s.

    Raises
    ------
    ValueError
        If the gravitational parameter is not positive, or the start is not finite or not on an ellipse.

    Notes
    -----
    The combined method of Mironov and Mironov (2007): x' = A(t) x + w(t) + B u with A and w from the last trajectory is
    a linear problem; its solution is the next trajectory. Where they agree, the solution satisfies the maximum
    principle of the nonlinear problem. Far from the coasting orbit the rounds do not converge: there the first
    trajectory is computed by shooting, with targets that move away from the coasting orbit, and rounds are mixed after
    Anderson (1965).
    """

    targets: KeplerTargets
    start_state: Floats

    ruggedness = 3.0
    """Large: revolutions and the geometry of encounters cause many local minima."""

    def __post_init__(self) -> None:
        mu = self.targets.gravitational_parameter_m3_s2
        if not (np.isfinite(mu) and mu > 0.0):
            raise ValueError(f"the gravitational parameter must be positive and finite, found {mu!r} m^3/s^2")
        super().__post_init__()
        coast(self.start_state, 0.0, mu)

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Return a path that satisfies the conditions of least energy; its motion is linear about its trajectory.

        Raises
        ------
        NotSettledError
            If re-linearising fails from the chaser's coasting orbit, and from a trajectory computed by shooting in
            `order`.
        """
        nodes = nodes_of(self.targets, order, time_s)
        check_times(self.start_s, nodes.arrive_s, nodes.leave_s)
        with contextlib.suppress(NotSettledError):
            return self._relinearise(nodes, self._coasting(nodes), rounds=FEW_ROUNDS)
        return self.flyer(order)(nodes.arrive_s).settled()

    def flyer(self, order: Sequence[int], near: Path | None = None) -> Callable[[Floats], Flown]:
        """Return a function of N times that shoots paths of one `order`, from the nearest known one, at first `near`.

        Raises
        ------
        NotSettledError
            By the function, if the targets cannot be followed from the coasting orbit; a ValueError if times do not
            increase.
        """
        mu = self.targets.gravitational_parameter_m3_s2
        known: list[tuple[Floats, list[Floats]]] = []
        if near is not None:
            known.append((near.nodes.arrive_s, unknowns_of(near, mu)))

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
                    f"the way; {REMEDY}"
                )
            known.append((nodes.arrive_s, [shot.unknowns for shot in shots]))
            del known[:-MOST_KNOWN]
            return ShotPath(nodes, shots, self._settled)

        return fly

    def _relinearise(self, nodes: Nodes, reference: Reference, *, rounds: int = MOST_ROUNDS) -> Path:
        """Solve linear problems about one trajectory after another until they agree."""
        change = np.inf
        nearest = LEAST_RADIUS * float(np.linalg.norm(np.vstack([self.start_state, nodes.arrive])[:, :3], axis=1).min())
        mixture = Mixture()
        for index in range(rounds):
            try:
                path = solve_segments(self._motion_about(reference), self.start_s, self.start_state, nodes)
            except ValueError as error:
                raise NotSettledError(f"re-linearising leads to no trajectory: {error}; {REMEDY}") from None
            flown = Reference.of_path(path, reference, keep=index > 1)
            before, change = change, flown.change_from(reference)
            hopeless = rounds == FEW_ROUNDS and change > 0.5 * before
            if hopeless or not change <= GREATEST_CHANGE or flown.least_radius < nearest:
                break
            if change <= SETTLED or (change <= ROUNDING and change > 0.3 * before):
                path = solve_segments(self._motion_about(flown), self.start_s, self.start_state, nodes)
                return TracedPath(**vars(path), trace=panels_of(path, flown, keep=True))
            reference = mixture.mix(reference, flown) if index > 1 else flown
        raise NotSettledError(
            f"re-linearising does not settle: trajectories still differ by {change:.2g} of the distance from the "
            f"centre from round to round; {REMEDY}"
        )

    def _settled(self, shot: ShotPath) -> Path:
        return self._relinearise(shot.nodes, self._reference(shot.nodes, shot.states))

    def _coasting(self, nodes: Nodes) -> Reference:
        start, mu = self.start_state, self.targets.gravitational_parameter_m3_s2
        return self._reference(nodes, lambda times: coast(np.broadcast_to(start, (len(times), 6)), times, mu))

    def _reference(self, nodes: Nodes, states: Callable[[Floats], Floats]) -> Reference:
        starts = np.concatenate([[self.start_s], nodes.leave_s[:-1]])
        return Reference.of_states(states, starts, nodes, self.targets.gravitational_parameter_m3_s2)

    def _motion_about(self, reference: Reference) -> TimeVaryingMotion:
        mu = self.targets.gravitational_parameter_m3_s2

        def drift(times: Floats) -> Floats:
            states = reference(times)
            pull = coasting_rates(states, mu)
            # f - A x: the velocity cancels; gravity minus its gradient along r is three times gravity.
            pull[..., :3] = 0.0
            return np.asarray(3.0 * pull)

        return TimeVaryingMotion(lambda times: gravity_gradient(reference(times)[..., :3], mu), drift_at=drift)
