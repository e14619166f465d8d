"""Visits under the gravity of one point: the combined method, linear problems about the last trajectory."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rendezvous._arrays import Floats, Integers
from rendezvous.multipoint._shooting import MIN_RADIUS, ROUNDING, Flown, ShotPath, blocks_of, shoot
from rendezvous.multipoint.segments import Nodes, NotSettledError, Path, check_times, solve_segments
from rendezvous.multipoint.tour import MovingTargets, Target, Visits, nodes_of
from rendezvous.relative_motion import TimeVaryingMotion
from rendezvous.two_body import coast, coasting_rates, gravity_gradient

NODES = 12
PANEL_RAD = 0.6
MAX_PANELS = 2000
MAX_MIXED = 6
_SAMPLES = 64
_POINTS = 0.5 - 0.5 * np.cos(np.pi * np.arange(NODES) / (NODES - 1))
_WEIGHTS = np.array([0.5, *[-1.0, 1.0] * (NODES // 2 - 1), -0.5])
"""Increasing Chebyshev points on [0, 1], and their barycentric weights."""
SETTLED = 1e-11
MAX_ROUNDS = 30
FEW_ROUNDS = 8
MAX_KNOWN = 64
REMEDY = "give visits more time, visit nearer targets first, or check units"
MAX_CHANGE = 2.0


@dataclass(frozen=True, eq=False)
class Panels:
    """A function of time, by polynomials on P panels: `values`, shape (P, 12, m), at the Chebyshev points."""

    breaks_s: Floats
    values: Floats

    def __call__(self, time_s: Floats) -> Floats:
        """Return values, shape (k, m), at k times; at a break those of the panel that begins there."""
        inside = np.clip(time_s, self.breaks_s[0], self.breaks_s[-1])
        panel = np.clip(np.searchsorted(self.breaks_s, inside, side="right") - 1, 0, len(self.values) - 1)
        width = self.breaks_s[panel + 1] - self.breaks_s[panel]
        apart = (inside - self.breaks_s[panel])[:, None] / width[:, None] - _POINTS
        exact = apart == 0.0
        shares = _WEIGHTS / np.where(exact, 1.0, apart)
        hit = exact.any(axis=1)
        shares[hit] = exact[hit]
        return np.asarray(np.einsum("kj,kja->ka", shares / shares.sum(axis=1, keepdims=True), self.values[panel]))


@dataclass(frozen=True, eq=False)
class Reference(Panels):
    """States as functions of time; coasting after the last panel."""

    gravitational_parameter_m3_s2: float

    def __call__(self, time_s: Floats) -> Floats:
        """Return states, shape (k, 6), at k times."""
        states = super().__call__(time_s)
        after = time_s > self.breaks_s[-1]
        if after.any():
            last = np.broadcast_to(self.values[-1, -1], (int(after.sum()), 6))
            states[after] = coast(last, time_s[after] - self.breaks_s[-1], self.gravitational_parameter_m3_s2)
        return states

    @property
    def min_radius(self) -> float:
        """The minimum distance from the centre at its points, m."""
        return float(np.linalg.norm(self.values[..., :3], axis=-1).min())

    @property
    def max_speed(self) -> float:
        """The maximum speed at its points, m/s."""
        return float(np.linalg.norm(self.values[..., 3:], axis=-1).max())

    def change_from(self, other: Reference) -> float:
        """Return the maximum difference from `other` at this one's points, relative, of positions and velocities."""
        apart = self.values - other(_points(self.breaks_s)).reshape(self.values.shape)
        distance, speed = np.abs(apart[..., :3]).max(), np.abs(apart[..., 3:]).max()
        return float(max(distance / self.min_radius, speed / self.max_speed))

    @classmethod
    def of_states(
        cls, states: Callable[[Floats], Floats], starts_s: Floats, nodes: Nodes, gravitational_parameter_m3_s2: float
    ) -> Reference:
        """Represent known `states` over the segments, which start at `starts_s`, and the stays between them."""
        mu = gravitational_parameter_m3_s2
        pieces = list(zip(starts_s, nodes.arrive_s, strict=True))
        pieces += [(start, end) for start, end in zip(nodes.arrive_s, nodes.leave_s, strict=True) if end > start]
        breaks = np.unique(np.concatenate([_breaks(states, start, end, mu) for start, end in pieces]))
        return cls(breaks, states(_points(breaks)).reshape(len(breaks) - 1, NODES, 6), mu)


@dataclass(frozen=True, eq=False)
class TracedPath(Path):
    """A path with known states and costates at all times."""

    trace: Panels

    def breaks(self) -> Floats:
        """Return the ends of its panels, s."""
        return self.trace.breaks_s

    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates, shapes (k, 6), at k times from the start to the last node."""
        values = self.trace(np.asarray(time_s, dtype=np.float64))
        return values[:, :6], values[:, 6:]


def panels_of(path: Path, before: Reference, *, keep: bool = False) -> Panels:
    """Represent states and costates of a path whose motion is linear about `before`; `keep` reuses its panels."""
    assert isinstance(path.motion, TimeVaryingMotion)
    mu = before.gravitational_parameter_m3_s2

    def edges_of(states: Callable[[Floats], Floats], start_s: float, end_s: float) -> Floats:
        if keep:
            return before.breaks_s[(before.breaks_s >= start_s) & (before.breaks_s <= end_s)]
        return _breaks(states, start_s, end_s, mu)

    breaks: list[Floats] = []
    values: list[Floats] = []
    for segment, (start, end) in enumerate(zip(path.starts_s, path.nodes.arrive_s, strict=True)):
        edges = edges_of(before, start, end)
        breaks.append(edges[:-1])
        values.append(_segment_values(path.motion, edges, path.start_states[segment], path.costate_before[segment]))
        leave = path.nodes.leave_s[segment]
        if leave > end:

            def staying(times: Floats, state: Floats = path.nodes.arrive[segment], since: float = end) -> Floats:
                return coast(np.broadcast_to(state, (len(times), 6)), times - since, mu)

            edges = edges_of(staying, end, leave)
            breaks.append(edges[:-1])
            states = staying(_points(edges)).reshape(len(edges) - 1, NODES, 6)
            values.append(np.concatenate([states, np.zeros_like(states)], axis=2))
    last = max(float(path.nodes.leave_s[-1]), float(path.nodes.arrive_s[-1]))
    return Panels(np.append(np.concatenate(breaks), last), np.concatenate(values))


class Mixture:
    """Mixes the last rounds of an iteration x -> g(x) of references on the same panels.

    Anderson (1965): the combination of the g(x_j), of sum one, whose residuals g(x_j) - x_j cancel best.
    """

    def __init__(self) -> None:
        self._values: list[Floats] = []
        self._residuals: list[Floats] = []

    def mix(self, x: Reference, g: Reference) -> Reference:
        """Add a round, and return the next x."""
        scale = np.array([1.0] * 3 + [g.min_radius / g.max_speed] * 3)
        self._values.append(g.values)
        self._residuals.append(((g.values - x.values) * scale).ravel())
        del self._values[:-MAX_MIXED], self._residuals[:-MAX_MIXED]
        last = self._residuals[-1]
        if len(self._residuals) == 1:
            return g
        steps = np.stack([residual - last for residual in self._residuals[:-1]], axis=1)
        shares = np.linalg.lstsq(steps, -last, rcond=1e-10)[0]
        values = g.values + sum(
            share * (earlier - g.values) for share, earlier in zip(shares, self._values[:-1], strict=True)
        )
        return Reference(g.breaks_s, np.asarray(values), g.gravitational_parameter_m3_s2)


def _breaks(states: Callable[[Floats], Floats], start_s: float, end_s: float, mu: float) -> Floats:
    """Ends of equal panels of at most 0.6 radians of a trajectory."""
    radii = np.linalg.norm(states(np.linspace(start_s, end_s, _SAMPLES))[:, :3], axis=1)
    radians = float(np.sqrt(mu / radii.min() ** 3)) * (end_s - start_s)
    even = float(np.sqrt(mu / radii**3).mean()) * (end_s - start_s)
    # On an eccentric orbit, panels are as narrow as its nearest point needs.
    count = np.ceil((radians if radians < 3.0 * even else 3.0 * even) / PANEL_RAD)
    if not np.isfinite(count) or count > MAX_PANELS:
        raise ValueError(f"a trajectory of {radians:.3g} radians between two visits is too long to follow; check units")
    return np.linspace(start_s, end_s, max(1, int(count)) + 1)


def _points(breaks: Floats) -> Floats:
    """Times of the Chebyshev points of panels, shape (12 P,)."""
    return (breaks[:-1, None] + np.diff(breaks)[:, None] * _POINTS).ravel()


def _segment_values(motion: TimeVaryingMotion, edges: Floats, start: Floats, costate_end: Floats) -> Floats:
    """States and costates at the points of a segment's panels, shape (P, 12, 12)."""
    count, inner = len(edges) - 1, _POINTS[1:]
    begins = np.repeat(edges[:-1], NODES - 1)
    ends = (edges[:-1, None] + np.diff(edges)[:, None] * inner).ravel()
    short = motion.short_segment(begins, ends)
    transition = short.transition.reshape(count, NODES - 1, 6, 6)
    gramian = short.gramian.reshape(count, NODES - 1, 6, 6)
    drift = short.drift.reshape(count, NODES - 1, 6)
    values = np.empty((count, NODES, 12))
    costate = costate_end
    for panel in range(count - 1, -1, -1):
        costate = transition[panel, -1].T @ costate
        values[panel, 0, 6:] = costate
    # At the points, from the panel's start: lambda = Phi^-T lambda_start.
    inside = np.linalg.solve(np.swapaxes(transition, -1, -2), values[:, :1, 6:, None])[..., 0]
    values[:, 1:, 6:] = inside
    forced = drift + np.einsum("pjab,pjb->pja", gramian, inside)
    state = start
    for panel in range(count):
        values[panel, 0, :6] = state
        values[panel, 1:, :6] = transition[panel] @ state + forced[panel]
        state = values[panel, -1, :6]
    return values


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

    def rates(self, time_s: Floats, states: Floats) -> Floats:
        """Time derivatives of `states` of targets at k times, shape (k, 6)."""
        return coasting_rates(states, self.gravitational_parameter_m3_s2)


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
        coast(self.start_state, 0.0, self.targets.gravitational_parameter_m3_s2)

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Return a path that satisfies the conditions of minimum energy; its motion is linear about its trajectory.

        Raises
        ------
        NotSettledError
            If re-linearising fails from the chaser's coasting orbit, and from a trajectory computed by shooting in
            `order`.
        """
        nodes = nodes_of(self.targets, order, time_s)
        check_times(self.start_s, nodes.arrive_s, nodes.leave_s)
        with contextlib.suppress(NotSettledError):
            start, mu = self.start_state, self.targets.gravitational_parameter_m3_s2
            coasting = self._reference(nodes, lambda times: coast(np.broadcast_to(start, (len(times), 6)), times, mu))
            return self._relinearise(nodes, coasting, rounds=FEW_ROUNDS)
        return self.flyer(order)(nodes.arrive_s).settled()

    def flyer(self, order: Sequence[int]) -> Callable[[Floats], Flown]:
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
                    f"the way; {REMEDY}"
                )
            known.append((nodes.arrive_s, [shot.unknowns for shot in shots]))
            del known[:-MAX_KNOWN]
            return ShotPath(nodes, shots, self._settled)

        return fly

    def _relinearise(self, nodes: Nodes, reference: Reference, *, rounds: int = MAX_ROUNDS) -> Path:
        """Solve linear problems about one trajectory after another until they agree."""
        change = np.inf
        nearest = MIN_RADIUS * float(np.linalg.norm(np.vstack([self.start_state, nodes.arrive])[:, :3], axis=1).min())
        mixture = Mixture()
        for index in range(rounds):
            try:
                path = solve_segments(self._motion_about(reference), self.start_s, self.start_state, nodes)
            except ValueError as error:
                raise NotSettledError(f"re-linearising leads to no trajectory: {error}; {REMEDY}") from None
            panels = panels_of(path, reference, keep=index > 1)
            flown = Reference(panels.breaks_s, panels.values[..., :6], reference.gravitational_parameter_m3_s2)
            before, change = change, flown.change_from(reference)
            hopeless = rounds == FEW_ROUNDS and change > 0.5 * before
            if hopeless or not change <= MAX_CHANGE or flown.min_radius < nearest:
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
