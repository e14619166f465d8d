"""Integrals of the magnitude and direction of a vector over time to a tolerance, also for one that passes near zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from rendezvous.piecewise import NODES, chebyshev_halves

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]

POINTS, WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(NODES))
AT_POINTS = chebyshev.chebvander(POINTS, NODES - 1)
_HALVES = chebyshev_halves(NODES)
_LEAST_SHARE = 1e-3
_OUTSIDE = float(1.0 - POINTS[-1])
_MOST_HALVINGS = 45


@dataclass(frozen=True, eq=False)
class SizeIntegral:
    """The integral of |w| over panels, with a bound on its error, and its nodes.

    A node has a panel, a position in it (-1 to 1), a weight (s) and a vector w. `direction_error` (s) is a bound on the
    error of the integral of w / |w| at these nodes.
    """

    value: float
    error: float
    panel: Integers
    position: Floats
    weight: Floats
    vector: Floats
    direction_error: float


def integrate_size(coefficients: Floats, half_s: Floats, tolerance: float, direction: float = np.inf) -> SizeIntegral:
    """Integrate the magnitude of a vector w that is a polynomial of degree 11 on each panel.

    `coefficients`, shape (P, 12, 3), are those of Chebyshev polynomials, `half_s`, shape (P,), half the lengths of
    panels. Tolerances are relative: `tolerance` of the integral of |w|, `direction` of the integral of w / |w|, to the
    time.

    Notes
    -----
    Gauss and Legendre's rule of 12 nodes on an interval and on its two halves; if they differ by more than the
    interval's share of the tolerance the halves are treated in the same way. |w| has a corner and w / |w| a jump where
    w passes through zero: intervals become short only there.
    """
    total_s = 2.0 * float(half_s.sum())
    panel = np.arange(len(half_s))
    middle, size = np.zeros(len(half_s)), np.ones(len(half_s))
    scale: float | None = None
    value = error = direction_error = 0.0
    accepted: list[tuple[Integers, Floats, Floats, Floats]] = []
    for level in range(_MOST_HALVINGS + 1):
        length = half_s[panel] * size
        vectors = AT_POINTS @ coefficients
        sizes, units = _polar(vectors)
        whole, turned = length * (sizes @ WEIGHTS), length[:, None] * np.einsum("k,nki->ni", WEIGHTS, units)
        if scale is None:
            scale = float(whole.sum())
            if scale == 0.0:
                return SizeIntegral(0.0, 0.0, panel[:0], middle[:0], middle[:0], np.zeros((0, 3)), 0.0)
        halves = [half @ coefficients for half in _HALVES]
        halved = np.stack([AT_POINTS @ half for half in halves], axis=1)
        sizes, units = _polar(halved)
        parts = 0.5 * length * np.einsum("k,nhk->n", WEIGHTS, sizes)
        apart = np.abs(parts - whole)
        turn = 0.5 * length[:, None] * np.einsum("k,nhki->ni", WEIGHTS, units) - turned
        bent = np.linalg.norm(turn, axis=1)
        share = np.maximum(2.0 * length / total_s, _LEAST_SHARE)
        # The rules miss a turn between the last node and the end: its effect is bounded and added to the error.
        unseen = 0.5 * length[:, None] * _turned_at_ends(halves, sizes, units)
        apart, bent = apart + unseen[:, 0], bent + unseen[:, 1]
        done = (apart <= tolerance * scale * share) & (bent <= direction * total_s * share)
        if level == _MOST_HALVINGS:
            done[:] = True
        value += float(parts[done].sum())
        error += float(apart[done].sum())
        direction_error += float(bent[done].sum())
        offsets = np.concatenate([0.5 * (POINTS - 1.0), 0.5 * (POINTS + 1.0)])
        positions = middle[done, None] + size[done, None] * offsets
        weights = 0.5 * length[done, None] * np.tile(WEIGHTS, 2)
        accepted.append(
            (np.repeat(panel[done], 2 * NODES), positions.ravel(), weights.ravel(), halved[done].reshape(-1, 3))
        )
        if done.all():
            break
        left = ~done
        coefficients = np.concatenate([half[left] for half in halves])
        middle = np.concatenate([middle[left] - 0.5 * size[left], middle[left] + 0.5 * size[left]])
        panel, size = np.tile(panel[left], 2), np.tile(0.5 * size[left], 2)
    nodes = [np.concatenate(part) for part in zip(*accepted, strict=True)]
    return SizeIntegral(value, error, nodes[0], nodes[1], nodes[2], nodes[3], direction_error)


def _turned_at_ends(halves: list[Floats], sizes: Floats, units: Floats) -> Floats:
    """Bound the changes of |w| and w / |w| between the last nodes and the ends of halves of length 2, shape (n, 2)."""
    bounds = np.zeros((len(sizes), 2))
    for index, half in enumerate(halves):
        for sign, node in ((-1.0, 0), (1.0, -1)):
            size, unit = _polar(sign ** np.arange(NODES) @ half)
            turned = (unit * units[:, index, node]).sum(axis=1) < 0.5
            bounds[:, 0] += np.where(turned, 2.0 * _OUTSIDE * np.maximum(size, sizes[:, index, node]), 0.0)
            bounds[:, 1] += np.where(turned, 2.0 * _OUTSIDE, 0.0)
    return bounds


def _polar(vectors: Floats) -> tuple[Floats, Floats]:
    """Magnitudes and directions; the direction of zero is zero."""
    sizes = np.sqrt((vectors**2).sum(axis=-1))
    return sizes, vectors / np.where(sizes > 0.0, sizes, 1.0)[..., None]
