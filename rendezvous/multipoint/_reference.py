"""The trajectory that a nonlinear motion is linearised about: polynomials on panels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rendezvous._arrays import Floats
from rendezvous.multipoint.segments import Nodes, Path
from rendezvous.relative_motion import TimeVaryingMotion
from rendezvous.two_body import coast

NODES = 12
PANEL_RAD = 0.6
MOST_PANELS = 2000
MOST_MIXED = 6
_SAMPLES = 64


_POINTS = 0.5 - 0.5 * np.cos(np.pi * np.arange(NODES) / (NODES - 1))
_WEIGHTS = np.array([0.5, *[-1.0, 1.0] * (NODES // 2 - 1), -0.5])
"""Increasing Chebyshev points on [0, 1], and their barycentric weights."""


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
    def least_radius(self) -> float:
        """The least distance from the centre at its points, m."""
        return float(np.linalg.norm(self.values[..., :3], axis=-1).min())

    @property
    def greatest_speed(self) -> float:
        """The greatest speed at its points, m/s."""
        return float(np.linalg.norm(self.values[..., 3:], axis=-1).max())

    def change_from(self, other: Reference) -> float:
        """Return the greatest difference from `other` at this one's points, relative, of positions and velocities."""
        apart = self.values - other(_points(self.breaks_s)).reshape(self.values.shape)
        distance, speed = np.abs(apart[..., :3]).max(), np.abs(apart[..., 3:]).max()
        return float(max(distance / self.least_radius, speed / self.greatest_speed))

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

    @classmethod
    def of_path(cls, path: Path, before: Reference, *, keep: bool = False) -> Reference:
        """Represent the trajectory of a path whose motion is linear about `before`, as `panels_of` does."""
        panels = panels_of(path, before, keep=keep)
        return cls(panels.breaks_s, panels.values[..., :6], before.gravitational_parameter_m3_s2)


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
        scale = np.array([1.0] * 3 + [g.least_radius / g.greatest_speed] * 3)
        self._values.append(g.values)
        self._residuals.append(((g.values - x.values) * scale).ravel())
        del self._values[:-MOST_MIXED], self._residuals[:-MOST_MIXED]
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
    if not np.isfinite(count) or count > MOST_PANELS:
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
