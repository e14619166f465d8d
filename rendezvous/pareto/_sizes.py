"""Integrals of the magnitude and direction of a vector over time, to a tolerance, also where it passes near zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from rendezvous.piecewise import NODES, chebyshev_fit, chebyshev_points

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]

_PLACES, _WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(NODES))
_AT_PLACES = chebyshev.chebvander(_PLACES, NODES - 1)
_HALVES = [
    chebyshev_fit(NODES) @ chebyshev.chebvander(0.5 * chebyshev_points(NODES) + middle, NODES - 1)
    for middle in (-0.5, 0.5)
]
_LEAST_SHARE = 1e-3
_OUTSIDE = float(1.0 - _PLACES[-1])
_MOST_HALVINGS = 45


@dataclass(frozen=True, eq=False)
class SizeIntegral:
    """The integral of |w| over panels.

    Parameters
    ----------
    value, error : float
        The integral, and a bound on its error.
    panel : ndarray of int, shape (n,)
        Panels of the nodes.
    place, weight : ndarray, shape (n,)
        Position in the panel, -1 to 1, and weight, s, of the nodes.
    vector : ndarray, shape (n, 3)
        w at the nodes.
    direction_error : float
        A bound on the error of the integral of w / |w| at these nodes, s.
    """

    value: float
    error: float
    panel: Integers
    place: Floats
    weight: Floats
    vector: Floats
    direction_error: float


def integrate_size(coefficients: Floats, half_s: Floats, tolerance: float, direction: float = np.inf) -> SizeIntegral:
    """Integrate the magnitude of a vector that is a polynomial of degree 11 on each panel.

    Parameters
    ----------
    coefficients : ndarray, shape (P, 12, 3)
        Of Chebyshev polynomials.
    half_s : ndarray, shape (P,)
        Half the lengths of the panels, s.
    tolerance : float
        Relative, of the integral of |w|.
    direction : float
        Of the integral of w / |w|, relative to the time.

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
        vectors = _AT_PLACES @ coefficients
        sizes, units = _polar(vectors)
        whole, turned = length * (sizes @ _WEIGHTS), length[:, None] * np.einsum("k,nki->ni", _WEIGHTS, units)
        if scale is None:
            scale = float(whole.sum())
            if scale == 0.0:
                return SizeIntegral(0.0, 0.0, panel[:0], middle[:0], middle[:0], np.zeros((0, 3)), 0.0)
        halves = [half @ coefficients for half in _HALVES]
        halved = np.stack([_AT_PLACES @ half for half in halves], axis=1)
        sizes, units = _polar(halved)
        parts = 0.5 * length * np.einsum("k,nhk->n", _WEIGHTS, sizes)
        apart = np.abs(parts - whole)
        turn = 0.5 * length[:, None] * np.einsum("k,nhki->ni", _WEIGHTS, units) - turned
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
        offsets = np.concatenate([0.5 * (_PLACES - 1.0), 0.5 * (_PLACES + 1.0)])
        places = middle[done, None] + size[done, None] * offsets
        weights = 0.5 * length[done, None] * np.tile(_WEIGHTS, 2)
        accepted.append(
            (np.repeat(panel[done], 2 * NODES), places.ravel(), weights.ravel(), halved[done].reshape(-1, 3))
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
