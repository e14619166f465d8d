"""Gravity of a planet, and its derivatives along a costate: compiled, for the kernels that propagate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rendezvous._compile import allocation_free

Floats = NDArray[np.float64]


@allocation_free
def acceleration(r: Floats, mu: float, oblateness: float, g: Floats) -> None:
    """Put the acceleration at `r` into `g`; `oblateness` is mu J2 R^2 / 2, the axis z.

    Notes
    -----
    The potential is mu/r + oblateness (1/r^3 - 3 z^2/r^5).
    """
    q = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    cube = 1.0 / (q * np.sqrt(q))
    radial = -mu * cube
    axial = 0.0
    if oblateness != 0.0:
        fifth = cube / q
        radial += oblateness * fifth * (-3.0 + 15.0 * r[2] * r[2] / q)
        axial = -6.0 * oblateness * fifth * r[2]
    g[0] = radial * r[0]
    g[1] = radial * r[1]
    g[2] = radial * r[2] + axial


@allocation_free
def derivatives(
    r: Floats, p: Floats, mu: float, oblateness: float, g: Floats, first: Floats, second: Floats, with_second: bool
) -> None:
    """Put the acceleration, its gradient (3, 3) and, if wanted, the gradient of gradient times `p` (3, 3) into arrays.

    Notes
    -----
    For a function f of q = r . r: the gradient is 2 f' r, its gradient 4 f'' r r^T + 2 f' I, and along p
    8 f''' s r r^T + 4 f'' (r p^T + p r^T + s I) with s = r . p. The oblate part is a power of q, less z^2 times one.
    """
    q = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    s = r[0] * p[0] + r[1] * p[1] + r[2] * p[2]
    inverse = 1.0 / q
    f = mu * np.sqrt(inverse)
    f1 = -0.5 * f * inverse
    f2 = -1.5 * f1 * inverse
    f4 = -2.5 * f2 * inverse
    if oblateness != 0.0:
        f3 = oblateness * inverse * np.sqrt(inverse)
        f1 -= 1.5 * f3 * inverse
        f2 += 3.75 * f3 * inverse * inverse
        f4 -= 13.125 * f3 * inverse * inverse * inverse
    for i in range(3):
        g[i] = 2.0 * f1 * r[i]
        for j in range(3):
            first[i, j] = 4.0 * f2 * r[i] * r[j]
        first[i, i] += 2.0 * f1
    if with_second:
        for i in range(3):
            for j in range(3):
                second[i, j] = 8.0 * f4 * s * r[i] * r[j] + 4.0 * f2 * (r[i] * p[j] + p[i] * r[j])
            second[i, i] += 4.0 * f2 * s
    if oblateness != 0.0:
        _subtract_axial(r, p, s, q, oblateness, g, first, second)


@allocation_free
def _subtract_axial(
    r: Floats, p: Floats, s: float, q: float, oblateness: float, g: Floats, first: Floats, second: Floats
) -> None:
    """Subtract the derivatives of z^2 f, f = 3 oblateness q^(-5/2)."""
    z, square = r[2], r[2] * r[2]
    f = 3.0 * oblateness / (q * q * np.sqrt(q))
    f1, f2, f4 = -2.5 * f / q, 8.75 * f / (q * q), -39.375 * f / (q * q * q)
    along = 2.0 * f1 * s
    for i in range(3):
        g[i] -= square * 2.0 * f1 * r[i]
        for j in range(3):
            plain = 4.0 * f2 * r[i] * r[j]
            turned = 8.0 * f4 * s * r[i] * r[j] + 4.0 * f2 * (r[i] * p[j] + p[i] * r[j])
            if i == j:
                plain += 2.0 * f1
                turned += 4.0 * f2 * s
            first[i, j] -= square * plain
            second[i, j] -= square * turned + 2.0 * z * p[2] * plain
    g[2] -= 2.0 * z * f
    first[2, 2] -= 2.0 * f
    second[2, 2] -= 2.0 * along
    for i in range(3):
        toward = 2.0 * f1 * r[i]
        turned = 4.0 * f2 * s * r[i] + 2.0 * f1 * p[i]
        first[2, i] -= 2.0 * z * toward
        first[i, 2] -= 2.0 * z * toward
        second[2, i] -= 2.0 * z * turned + 2.0 * p[2] * toward
        second[i, 2] -= 2.0 * z * turned + 2.0 * p[2] * toward
