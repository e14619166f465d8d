"""The trajectory that a nonlinear motion is linearised about: polynomials on panels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.multipoint.segments import Nodes, Path
from rendezvous.relative_motion import TimeVaryingMotion
from rendezvous.two_body import coast

Floats = NDArray[np.float64]

NODES = 12
PANEL_RAD = 0.6
MOST_PANELS = 2000
MOST_MIXED = 6
_SAMPLES = 64


@dataclass(frozen=True, eq=False)
class Panels:
    """A function of time, by polynomials.

    Parameters
    ----------
    breaks_s : ndarray, shape (P + 1,)
        Ends of the panels.
    values : ndarray, shape (P, 12, m)
        At the Chebyshev points of each panel, both ends among them.
    """

    breaks_s: Floats
    values: Floats

    def __call__(self, time_s: Floats) -> Floats:
        """Return values at times of shape (k,), shape (k, m); at a break those of the panel that begins there."""
        inside = np.clip(time_s, self.breaks_s[0], self.breaks_s[-1])
        panel = np.clip(np.searchsorted(self.breaks_s, inside, side="right") - 1, 0, len(self.values) - 1)
        width = self.breaks_s[panel + 1] - self.breaks_s[panel]
        places, weights = _chebyshev()
        apart = (inside - self.breaks_s[panel])[:, None] / width[:, None] - places
        exact = apart == 0.0
        shares = weights / np.where(exact, 1.0, apart)
        hit = exact.any(axis=1)
        shares[hit] = exact[hit]
        return np.asarray(np.einsum("kj,kja->ka", shares / shares.sum(axis=1, keepdims=True), self.values[panel]))


@dataclass(frozen=True, eq=False)
class Reference:
    """States as functions of time.

    Parameters
    ----------
    breaks_s : ndarray, shape (P + 1,)
        Ends of the panels.
    values : ndarray, shape (P, 12, 6)
        States at the Chebyshev points of each panel, both ends among them.
    gravitational_parameter_m3_s2 : float
        For times after the last panel, where it coasts.
    """

    breaks_s: Floats
    values: Floats
    gravitational_parameter_m3_s2: float

    def __call__(self, time_s: Floats) -> Floats:
        """States at times of shape (k,), shape (k, 6)."""
        states = Panels(self.breaks_s, self.values)(time_s)
        after = time_s > self.breaks_s[-1]
        if after.any():
            last = np.broadcast_to(self.values[-1, -1], (int(after.sum()), 6))
            states[after] = coast(last, time_s[after] - self.breaks_s[-1], self.gravitational_parameter_m3_s2)
        return states

    def edges(self, start_s: float, end_s: float) -> Floats:
        """Ends of the panels from one break to another."""
        return self.breaks_s[(self.breaks_s >= start_s) & (self.breaks_s <= end_s)]

    @property
    def least_radius(self) -> float:
        """The least distance from the centre at its points, m."""
        return float(np.linalg.norm(self.values[..., :3], axis=-1).min())

    def change_from(self, other: Reference) -> float:
        """Return the greatest difference from another one at this one's points, of distance and of speed."""
        places = _chebyshev()[0]
        times = self.breaks_s[:-1, None] + np.diff(self.breaks_s)[:, None] * places
        apart = self.values - other(times.ravel()).reshape(self.values.shape)
        distance = np.linalg.norm(self.values[..., :3], axis=-1).min()
        speed = np.linalg.norm(self.values[..., 3:], axis=-1).max()
        return float(max(np.abs(apart[..., :3]).max() / distance, np.abs(apart[..., 3:]).max() / speed))

    @classmethod
    def of_states(
        cls, states: Callable[[Floats], Floats], starts_s: Floats, nodes: Nodes, gravitational_parameter_m3_s2: float
    ) -> Reference:
        """Represent states that are known at all times, over the segments and the stays between them."""
        pieces = [(start, end) for start, end in zip(starts_s, nodes.arrive_s, strict=True)]
        pieces += [(start, end) for start, end in zip(nodes.arrive_s, nodes.leave_s, strict=True) if end > start]
        breaks = np.concatenate(
            [
                np.linspace(start, end, _panels(states, start, end, gravitational_parameter_m3_s2) + 1)
                for start, end in pieces
            ]
        )
        breaks = np.unique(breaks)
        times = breaks[:-1, None] + np.diff(breaks)[:, None] * _chebyshev()[0]
        values = states(times.ravel()).reshape(len(breaks) - 1, NODES, 6)
        return cls(breaks, values, gravitational_parameter_m3_s2)

    @classmethod
    def of_path(
        cls, path: Path, gravitational_parameter_m3_s2: float, before: Reference, *, keep: bool = False
    ) -> Reference:
        """Represent the trajectory of a path whose motion is linear about another one, on its panels or on new ones."""
        mu = gravitational_parameter_m3_s2
        found = panels_of(path, mu, before, keep=keep)
        return cls(found.breaks_s, found.values[..., :6], mu)


@dataclass(frozen=True, eq=False)
class TracedPath(Path):
    """A path whose states and costates are known at all times.

    Parameters
    ----------
    trace : Panels
        States and costates.
    """

    trace: Panels

    def breaks(self) -> Floats:
        """Return the ends of its panels, s."""
        return self.trace.breaks_s

    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates at times.

        Parameters
        ----------
        time_s : ndarray, shape (k,)
            From the start to the last node.

        Returns
        -------
        tuple of ndarray, each of shape (k, 6)
        """
        found = self.trace(np.asarray(time_s, dtype=np.float64))
        return found[:, :6], found[:, 6:]


def panels_of(path: Path, gravitational_parameter_m3_s2: float, before: Reference, *, keep: bool = False) -> Panels:
    """Represent states and costates of a path whose motion is linear about a reference.

    Parameters
    ----------
    path : Path
    gravitational_parameter_m3_s2 : float
    before : Reference
    keep : bool
        Whether its panels are the reference's.

    Returns
    -------
    Panels
    """
    assert isinstance(path.motion, TimeVaryingMotion)
    mu, places = gravitational_parameter_m3_s2, _chebyshev()[0]
    breaks: list[Floats] = []
    values: list[Floats] = []
    for segment, (start, end) in enumerate(zip(path.starts_s, path.nodes.arrive_s, strict=True)):
        edges = before.edges(start, end) if keep else np.linspace(start, end, _panels(before, start, end, mu) + 1)
        breaks.append(edges[:-1])
        values.append(_segment_values(path.motion, edges, path.start_states[segment], path.costate_before[segment]))
        leave = path.nodes.leave_s[segment]
        if leave > end:
            stay = path.nodes.arrive[segment]

            def staying(times: Floats, state: Floats = stay, since: float = end) -> Floats:
                return coast(np.broadcast_to(state, (len(times), 6)), times - since, mu)

            fresh = np.linspace(end, leave, _panels(staying, end, leave, mu) + 1)
            edges = before.edges(end, leave) if keep else fresh
            times = edges[:-1, None] + np.diff(edges)[:, None] * places
            breaks.append(edges[:-1])
            states = staying(times.ravel()).reshape(len(edges) - 1, NODES, 6)
            values.append(np.concatenate([states, np.zeros_like(states)], axis=2))
    last = max(float(path.nodes.leave_s[-1]), float(path.nodes.arrive_s[-1]))
    return Panels(np.append(np.concatenate(breaks), last), np.concatenate(values))


class Mixture:
    """Mixes the last few rounds of an iteration x -> g(x) of references on the same panels.

    Notes
    -----
    Anderson (1965): the combination of the g(x_j), of sum one, whose residuals g(x_j) - x_j cancel best.
    """

    def __init__(self) -> None:
        self._values: list[Floats] = []
        self._residuals: list[Floats] = []

    def mix(self, tried: Reference, found: Reference) -> Reference:
        """Take a round in, and return what to try next."""
        scale = np.array([1.0] * 3 + [found.least_radius / np.linalg.norm(found.values[..., 3:], axis=-1).max()] * 3)
        self._values.append(found.values)
        self._residuals.append(((found.values - tried.values) * scale).ravel())
        del self._values[:-MOST_MIXED], self._residuals[:-MOST_MIXED]
        last = self._residuals[-1]
        if len(self._residuals) == 1:
            return found
        steps = np.stack([each - last for each in self._residuals[:-1]], axis=1)
        shares = np.linalg.lstsq(steps, -last, rcond=1e-10)[0]
        values = found.values + sum(
            share * (each - found.values) for share, each in zip(shares, self._values[:-1], strict=True)
        )
        return Reference(found.breaks_s, np.asarray(values), found.gravitational_parameter_m3_s2)


def _panels(states: Callable[[Floats], Floats], start_s: float, end_s: float, mu: float) -> int:
    """How many panels of at most 0.6 radians a stretch takes."""
    radii = np.linalg.norm(states(np.linspace(start_s, end_s, _SAMPLES))[:, :3], axis=1)
    radians = float(np.sqrt(mu / radii.min() ** 3)) * (end_s - start_s)
    even = float(np.sqrt(mu / radii**3).mean()) * (end_s - start_s)
    # Where the orbit is far from round, panels are as narrow as its nearest point needs.
    count = np.ceil((radians if radians < 3.0 * even else 3.0 * even) / PANEL_RAD)
    if not np.isfinite(count) or count > MOST_PANELS:
        raise ValueError(f"a trajectory of {radians:.3g} radians between two visits is too long to follow; check units")
    return max(1, int(count))


def _chebyshev() -> tuple[Floats, Floats]:
    """Chebyshev points on [0, 1], rising, and their barycentric weights."""
    index = np.arange(NODES)
    weights = np.where(index % 2 == 0, 1.0, -1.0)
    weights[[0, -1]] *= 0.5
    return 0.5 - 0.5 * np.cos(np.pi * index / (NODES - 1)), weights


def _segment_values(motion: TimeVaryingMotion, edges: Floats, start: Floats, costate_end: Floats) -> Floats:
    """States and costates at the points of a segment's panels, shape (P, 12, 12)."""
    count, places = len(edges) - 1, _chebyshev()[0][1:]
    begins = np.repeat(edges[:-1], NODES - 1)
    ends = (edges[:-1, None] + np.diff(edges)[:, None] * places).ravel()
    found = motion.short_segment(begins, ends)
    transition = found.transition.reshape(count, NODES - 1, 6, 6)
    gramian = found.gramian.reshape(count, NODES - 1, 6, 6)
    drift = found.drift.reshape(count, NODES - 1, 6)
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
