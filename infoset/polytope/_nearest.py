"""The shortest difference between two convex hulls."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats

_MOST_STEPS = 1000
_PRECISION = 1e-14


def nearest_difference(one: Floats, two: Floats) -> Floats:
    """Return the shortest vector p - q, with p and q in the convex hulls of points of shapes (k, n) and (m, n).

    References
    ----------
    P. Wolfe, Finding the nearest point in a polytope, Mathematical Programming 11 (1976).
    """
    size = max(float(np.abs(one - two[0]).max()), float(np.abs(two - two[0]).max()), 1e-300)
    corral = (one[:1] - two[:1]) / size
    shares = np.ones(1)
    for _ in range(_MOST_STEPS):
        x = shares @ corral
        p = one[int((one @ x).argmin())]
        q = two[int((two @ x).argmax())]
        point = (p - q) / size
        if x @ x - x @ point <= _PRECISION * max(float(x @ x), _PRECISION) or (corral == point).all(axis=1).any():
            break
        corral, shares = np.vstack([corral, point]), np.append(shares, 0.0)
        while True:
            target = _affine_minimizer(corral)
            if (target > 0.0).all():
                shares = target
                break
            # Go toward the minimizer until a share is zero; drop that point.
            below = target <= 0.0
            part = float(np.min(shares[below] / np.maximum(shares[below] - target[below], 1e-300)))
            shares = shares + min(1.0, part) * (target - shares)
            shares[below & (shares <= shares[below].min())] = 0.0
            kept = shares > 0.0
            corral, shares = corral[kept], shares[kept] / shares[kept].sum()
    return np.asarray(size * (shares @ corral))


def _affine_minimizer(corral: Floats) -> Floats:
    """Return the coefficients of the shortest point of the affine hull of points."""
    edges = corral[1:] - corral[0]
    weights = np.linalg.lstsq(edges.T, -corral[0], rcond=None)[0] if len(edges) else np.zeros(0)
    return np.append(1.0 - weights.sum(), weights)
