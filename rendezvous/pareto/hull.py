"""The nearest point of a convex hull, exactly: Wolfe's minimum-norm-point method."""

from __future__ import annotations

import numpy as np

from rendezvous._arrays import Floats

_RELATIVE = 1e-13
_MOST_ROUNDS = 1000


def nearest_in_hull(points: Floats, target: Floats) -> Floats:
    """Return the weights of `points`, shape (n, f), that give the point of their convex hull nearest to a `target`.

    The weights, shape (n,), are not negative and of sum one; distances are Euclidean.

    Notes
    -----
    Wolfe (1976): a set of affinely independent points (corral) is extended by the point that is farthest in the
    direction of the target, and points with negative weights in the nearest point of its affine hull are removed. The
    method is finite; in practice it solves a few small least-squares problems.
    """
    offsets = points - target
    size = float((offsets**2).sum(axis=1).max())
    if size == 0.0:
        return np.asarray(np.eye(len(points))[0])
    corral = [int((offsets**2).sum(axis=1).argmin())]
    weights = np.ones(1)
    for _ in range(_MOST_ROUNDS):
        nearest = weights @ offsets[corral]
        ahead = int((offsets @ nearest).argmin())
        if ahead in corral or nearest @ (nearest - offsets[ahead]) <= _RELATIVE * size:
            break
        corral.append(ahead)
        weights = np.append(weights, 0.0)
        while True:
            affine = _affine_nearest(offsets[corral])
            if (affine > 0.0).all():
                weights = affine
                break
            behind = affine <= 0.0
            # A weight that stays zero is removed at once.
            step = float(np.min(weights[behind] / np.maximum(weights[behind] - affine[behind], np.finfo(float).tiny)))
            weights = weights + min(step, 1.0) * (affine - weights)
            leaving = int(np.where(behind, weights, np.inf).argmin())
            del corral[leaving]
            weights = np.delete(weights, leaving)
            weights /= weights.sum()
    all_weights = np.zeros(len(points))
    all_weights[corral] = weights
    return all_weights


def _affine_nearest(offsets: Floats) -> Floats:
    """Weights of sum one of the point of least norm in an affine hull."""
    edges = (offsets[1:] - offsets[0]).T
    rest = np.linalg.lstsq(edges, -offsets[0], rcond=None)[0]
    return np.concatenate([[1.0 - rest.sum()], rest])
