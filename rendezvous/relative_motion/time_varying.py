"""Motion with any A(t), by collocation of the adjoint variational equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.relative_motion.linear_motion import HeldMotion, HeldSegment, state_scales

OfTime = Callable[[Floats], Floats]
"""Matrices A(t), shape (..., 6, 6), of times, s, of the shape (...)."""

NODES = 8
"""Gauss points of a panel: collocation of order 16, exact to rounding on panels of a radian."""
AGREEMENT = 2e-13
"""Relative difference of two solutions at which the finer one is exact to rounding."""
ROUNDING_BELOW = 1e-8
"""Relative difference up to which a difference that no longer decreases is rounding, as with A(t)
of large elements, and not slow convergence."""
_NOT_DECREASING = 0.1
"""Ratio of two differences above which they no longer decrease: doubled panels reduce the error by
2^16, and the ratio is then 1.5e-5."""
MAX_PANELS = 4096
"""Maximum number of panels of an interval, and of all intervals of a coarse solution together.

They are 48 x 48 systems of 80 MB in all; the finer solution takes twice as much.
"""
MAX_BREAKS = 200_000
"""Maximum number of panels between breaks, as `linear_motion.MAX_PANELS`."""


@dataclass(frozen=True, eq=False)
class TimeVaryingMotion(HeldMotion):
    """x' = A(t) x + B u; `matrix_at` returns A of times of shape (k,), s: shape (k, 6, 6).

    The adjoint Psi' = -A' Psi, Psi(end) = 1, is collocated backwards at 8 Gauss points a panel
    (order 16). Phi(end, t) = Psi(t)' at the nodes gives the Gramian and the effect of a held
    control as sums with positive weights. Panels are doubled until two solutions agree to 2e-13, or
    differ by rounding only. A panel is a 48 x 48 system.
    """

    matrix_at: OfTime

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""
        times = np.asarray(time_s, dtype=np.float64)
        matrices = np.asarray(self.matrix_at(times.ravel()), dtype=np.float64)
        return matrices.reshape(*times.shape, 6, 6)

    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> HeldSegment:
        """Transition, Gramian and the effect of a held control together.

        The transition is also valid if the end is before the start.

        Raises
        ------
        ValueError
            If two solutions do not agree.
        """
        starts, ends = np.broadcast_arrays(
            np.asarray(start_s, dtype=np.float64), np.asarray(end_s, dtype=np.float64)
        )
        solution = _refined(self.dynamics, starts.ravel(), ends.ravel())
        return HeldSegment(
            solution.transition.reshape(*starts.shape, 6, 6),
            solution.gramian.reshape(*starts.shape, 6, 6),
            solution.held.reshape(*starts.shape, 6, 3),
        )

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, inclusive; between two the motion turns by a radian at most.

        Panels are halved if A at one of their Gauss points turns by more than a radian over the
        panel.

        Raises
        ------
        ValueError
            If A(t) is not finite, or there are more than 200 000 panels.
        """
        starts = np.array([start_s])
        ends = np.array([end_s])
        nodes = _gauss_collocation()[0]
        settled = [np.array([start_s, end_s])]
        while len(starts):
            if len(starts) > MAX_BREAKS:
                raise ValueError(
                    f"A(t) turns too often from {start_s:g} s to {end_s:g} s; check the units"
                )
            times = starts[:, None] + (ends - starts)[:, None] * nodes
            radians = _rates(self.dynamics(times)).max(axis=1) * (ends - starts)
            long = (radians > 1.0) & (ends > starts)

            settled.append(ends[~long])
            middles = 0.5 * (starts[long] + ends[long])
            starts = np.concatenate([starts[long], middles])
            ends = np.concatenate([middles, ends[long]])
        return np.unique(np.concatenate(settled))


def _refined(dynamics: OfTime, starts: Floats, ends: Floats) -> HeldSegment:
    """Double the panels until two solutions agree, or differ by rounding only.

    Intervals that together have more than `MAX_PANELS` panels are solved in two parts, to bound the
    memory.
    """
    panels = _first_panels(dynamics, starts, ends)
    if len(starts) > 1 and panels * len(starts) > MAX_PANELS:
        return _in_two_parts(dynamics, starts, ends)

    coarse = _collocated(dynamics, starts, ends, panels)
    apart = np.inf
    while 2 * panels <= MAX_PANELS:
        if len(starts) > 1 and panels * len(starts) > MAX_PANELS:
            return _in_two_parts(dynamics, starts, ends)
        panels *= 2
        fine = _collocated(dynamics, starts, ends, panels)
        before = apart
        apart = _difference(coarse, fine, ends - starts)
        is_rounding = apart <= ROUNDING_BELOW and apart > _NOT_DECREASING * before
        if apart <= AGREEMENT or is_rounding:
            return fine
        coarse = fine
    raise ValueError(
        f"A(t) changes too fast: {MAX_PANELS} panels an interval do not agree to {AGREEMENT:g}"
    )


def _in_two_parts(dynamics: OfTime, starts: Floats, ends: Floats) -> HeldSegment:
    """Return the solutions of two or more intervals, solved in two halves."""
    half = len(starts) // 2
    first = _refined(dynamics, starts[:half], ends[:half])
    second = _refined(dynamics, starts[half:], ends[half:])
    return HeldSegment(
        np.concatenate([first.transition, second.transition]),
        np.concatenate([first.gramian, second.gramian]),
        np.concatenate([first.held, second.held]),
    )


def _first_panels(dynamics: OfTime, starts: Floats, ends: Floats) -> int:
    """One panel for each radian of the fastest motion at the ends and the middle.

    At most a quarter of `MAX_PANELS`, so that the panels can be doubled twice.
    """
    if not len(starts):
        return 1

    durations = (ends - starts)[:, None]
    places = ends[:, None] - durations * np.array([0.0, 0.5, 1.0])
    radians = float((_rates(dynamics(places)) * np.abs(durations)).max())
    return int(np.clip(np.ceil(radians), 1, MAX_PANELS // 4))


def _rates(matrices: Floats) -> Floats:
    """Rates, rad/s, shape (...), at which motions of matrices A, shape (..., 6, 6), turn."""
    if not np.isfinite(matrices).all():
        raise ValueError("A(t) is not finite")
    # Norms of the blocks of r' = V v and v' = G r + W v: r'' = V G r turns at sqrt(|V| |G|), and
    # v' = W v at |W|.
    velocity = np.abs(matrices[..., :3, 3:]).sum(axis=-1).max(axis=-1)
    gravity = np.sqrt(velocity * np.abs(matrices[..., 3:, :3]).sum(axis=-1).max(axis=-1))
    turning = np.abs(matrices[..., 3:, 3:]).sum(axis=-1).max(axis=-1)
    return np.asarray(np.maximum(gravity, turning))


@lru_cache(maxsize=1)
def _gauss_collocation() -> tuple[Floats, Floats, Floats]:
    """Nodes and weights on [0, 1], shape (8,), and integrals, shape (8, 8).

    Integral [j, k] is that of the Lagrange polynomial of node k from 0 to node j. The arrays are
    cached: do not write to them.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)

    values = np.polynomial.legendre.legvander(nodes, NODES - 1)
    integrals = np.polynomial.legendre.legval(
        nodes, np.polynomial.legendre.legint(np.eye(NODES), lbnd=-1.0)
    ).T
    return 0.5 * (nodes + 1.0), 0.5 * weights, 0.5 * integrals @ np.linalg.inv(values)


def _collocated(dynamics: OfTime, starts: Floats, ends: Floats, panels: int) -> HeldSegment:
    """Solve on equal panels from the end to the start, in states divided by (T, T, T, 1, 1, 1)."""
    nodes, weights, integrals = _gauss_collocation()
    durations = ends - starts
    # Parts of the duration before the end: panels are counted from the end backward.
    positions = (np.arange(panels)[:, None] + nodes) / panels
    places = ends[:, None, None] - durations[:, None, None] * positions
    steps = durations[:, None, None] * np.ones_like(positions) / panels
    spans = weights * steps

    scale = state_scales(durations)
    ratio = (scale[:, None, :] / scale[:, :, None])[:, None, None]
    adjoint = np.swapaxes(dynamics(places) * ratio, -1, -2) * steps[..., None, None]

    # (1 - h a_jk A_k') Psi_k = 1, for the 8 nodes of each panel at once.
    system = -np.einsum("jk,npkab->npjakb", integrals, adjoint).reshape(
        len(durations), panels, 6 * NODES, 6 * NODES
    )
    system[..., np.arange(6 * NODES), np.arange(6 * NODES)] += 1.0
    right = np.broadcast_to(np.tile(np.eye(6), (NODES, 1)), (len(durations), panels, 6 * NODES, 6))
    psi = np.linalg.solve(system, right).reshape(len(durations), panels, NODES, 6, 6)
    last = np.eye(6) + np.einsum("k,npkab->npab", weights, adjoint @ psi)

    # Sums over the panels; `power` is the transition from the end of a panel to the end.
    effect = np.swapaxes(psi[..., 3:, :], -1, -2)  # Phi B; velocities are not scaled
    power = np.broadcast_to(np.eye(6), (len(durations), 6, 6))
    gramian = np.zeros((len(durations), 6, 6))
    held = np.zeros((len(durations), 6, 3))
    for panel in range(panels):
        turned = power[:, None] @ effect[:, panel]
        gramian = gramian + np.einsum("nk,nkai,nkbi->nab", spans[:, panel], turned, turned)
        held = held + np.einsum("nk,nkai->nai", spans[:, panel], turned)
        power = power @ np.swapaxes(last[:, panel], -1, -2)

    outer = scale[:, :, None] * scale[:, None, :]
    return HeldSegment(
        power * (scale[:, :, None] / scale[:, None, :]),
        gramian * outer,
        held * scale[:, :, None],
    )


def _difference(first: HeldSegment, second: HeldSegment, durations: Floats) -> float:
    """Maximum difference of two solutions, relative to each of their matrices.

    States are divided by (T, T, T, 1, 1, 1).
    """
    if not len(durations):
        return 0.0
    scale = state_scales(durations)
    worst = 0.0
    for one, other, weight in (
        (first.transition, second.transition, scale[:, None, :] / scale[:, :, None]),
        (first.gramian, second.gramian, 1.0 / (scale[:, :, None] * scale[:, None, :])),
        (first.held, second.held, 1.0 / scale[:, :, None]),
    ):
        axes = tuple(range(1, one.ndim))
        size = np.abs(other * weight).max(axis=axes)
        apart = np.abs((one - other) * weight).max(axis=axes)
        worst = max(worst, float((apart / np.where(size > 0.0, size, 1.0)).max()))
    return worst
