"""Evenly distributed points of a cube."""

from __future__ import annotations

from infoset.rendezvous._arrays import Floats


def halton(dimension: int, count: int) -> Floats:
    """Return the points 1 to `count` of the Halton sequence in (0, 1), shape (count, dimension).

    Point 0, which is the origin, is left out.
    """
    from scipy.stats import qmc  # takes 0.4 s to load

    points: Floats = qmc.Halton(dimension, scramble=False).random(count + 1)[1:]
    return points
