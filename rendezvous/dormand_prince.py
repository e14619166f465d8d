"""Steps of Dormand and Prince's method of order 8 for any right-hand side: compiled, with SciPy's
coefficients.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import allocation_free

STAGES = 12
_NODES = np.ascontiguousarray(DOP853.C[:STAGES])
_WEIGHTS = np.vstack([DOP853.A[:STAGES, :STAGES], DOP853.B])
"""Coefficients of the stages, one row per stage, and of the step."""
_THIRD = np.ascontiguousarray(DOP853.E3[:STAGES])
_FIFTH = np.ascontiguousarray(DOP853.E5[:STAGES])


def step_of(
    rates: Callable[[float, Floats, Floats, Any, Floats, Floats], None],
) -> Callable[..., None]:
    """Compile one step for a compiled right-hand side `rates(t, y, z, parameters, dy, dz)` that
    fills dy and dz.

    The result is a compiled `step(t, h, first, y, z, parameters, ky, kz, y_next, z_next)`. It fills
    the stages from `first` on, ky (12, n) and kz (12, rows, columns), and the state at t + h, which
    shares no memory with y, (n,), and z, (rows, columns). `first` is 1 where t and y are those of
    the call before. The state is y + h sum_k b_k k_k, whose error `error_of_step` estimates, and z
    + (h b_1) k_1 + (h b_2) k_2 ...
    """

    @allocation_free
    def step(
        t: float,
        h: float,
        first: int,
        y: Floats,
        z: Floats,
        parameters: Any,
        ky: Floats,
        kz: Floats,
        y_next: Floats,
        z_next: Floats,
    ) -> None:
        flat = z.reshape(-1)
        flat_next = z_next.reshape(-1)
        flat_slopes = kz.reshape(STAGES, -1)
        for stage in range(first, STAGES + 1):
            for i in range(len(y)):
                y_next[i] = 0.0
            for k in range(stage):
                weight = _WEIGHTS[stage, k]
                if weight != 0.0:
                    for i in range(len(y)):
                        y_next[i] += weight * ky[k, i]
            for i in range(len(y)):
                y_next[i] = y[i] + h * y_next[i]
            for i in range(len(flat)):
                flat_next[i] = flat[i]
            for k in range(stage):
                weight = h * _WEIGHTS[stage, k]
                if weight != 0.0:
                    for i in range(len(flat)):
                        flat_next[i] += weight * flat_slopes[k, i]
            # The only call of the right-hand side: each call is compiled separately.
            if stage < STAGES:
                rates(t + _NODES[stage] * h, y_next, z_next, parameters, ky[stage], kz[stage])

    return step


@allocation_free
def error_of_step(y: Floats, y_next: Floats, ky: Floats, tolerance: float, h: float) -> float:
    """Return the error of a step in y over the tolerance, relative and absolute (Hairer, Norsett
    and Wanner, II.10).
    """
    third = fifth = 0.0
    for i in range(len(y)):
        scale = tolerance * (1.0 + max(abs(y[i]), abs(y_next[i])))
        e3 = e5 = 0.0
        for k in range(STAGES):
            e3 += _THIRD[k] * ky[k, i]
            e5 += _FIFTH[k] * ky[k, i]
        third += (e3 / scale) ** 2
        fifth += (e5 / scale) ** 2
    if third == 0.0 and fifth == 0.0:
        return 0.0
    return float(h * fifth / np.sqrt((fifth + 0.01 * third) * len(y)))
