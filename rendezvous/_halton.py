"""Evenly distributed points of a cube."""

from __future__ import annotations

import itertools

import numpy as np

from rendezvous._arrays import Floats


def halton(dimension: int, count: int) -> Floats:
    """Return the points 1 to `count` of the Halton sequence, in (0, 1), shape (count, dimension).

    A coordinate of point k is the number k in a prime base with its digits mirrored at the point. `scipy.stats` has the
    same sequence, and takes 0.4 s to load.
    """
    primes = (base for base in itertools.count(2) if all(base % factor for factor in range(2, base)))
    points = np.zeros((count, dimension))
    for column, base in enumerate(itertools.islice(primes, dimension)):
        digits, weight = np.arange(1, count + 1), 1.0 / base
        while digits.any():
            points[:, column] += digits % base * weight
            digits, weight = digits // base, weight / base
    return points
