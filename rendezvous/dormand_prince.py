"""Compiled steps of Dormand and Prince's method of order 8, for any right-hand side.

The coefficients are from SciPy's DOP853.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import allocation_free

STAGES = 12
"""Evaluations of the right-hand side in a step of the method."""
_NODES = np.ascontiguousarray(DOP853.C[:STAGES])
"""Times of the stages, as parts of the step."""
_WEIGHTS = np.vstack([DOP853.A[:STAGES, :STAGES], DOP853.B])
"""Coefficients of the stages, one row per stage, and of the step."""
_THIRD = np.ascontiguousarray(DOP853.E3[:STAGES])
_FIFTH = np.ascontiguousarray(DOP853.E5[:STAGES])
"""Coefficients of the embedded error estimates of orders 3 and 5."""
_THIRD_ORDER_SHARE = 0.01
"""Weight of the estimate of order 3 relative to the estimate of order 5, as in DOP853."""


def step_of(
    rates: Callable[[float, Floats, Floats, Any, Floats, Floats], None],
) -> Callable[..., None]:
    """Compile a step for the right-hand side `rates(t, y, z, parameters, dy, dz)`.

    `rates` is compiled, and fills dy and dz. The state has two parts: y, shape (n,), whose error
    `error_of_step` estimates, and z, shape (rows, columns).

    The result is a compiled `step(t, h, first, y, z, parameters, ky, kz, y_next, z_next)`. It fills
    the slopes of the stages from `first` on, ky, shape (12, n), and kz, shape (12, rows, columns),
    and the state at t + h in y_next and z_next, which share no memory with y and z. `first` is 1 if
    ky[0] and kz[0] are known, from a call with the same t, y and z.

    The state is y + h (b_1 k_1 + b_2 k_2 + ...) and z + (h b_1) k_1 + (h b_2) k_2 + ...
    """

    @allocation_free
    def step(  # noqa: PLR0913 - state, slopes and result in two parts each
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
        # After the last stage, the last row of weights gives the state at t + h.
        for stage in range(first, STAGES + 1):
            for i in range(len(y)):
                y_next[i] = 0.0
            add_slopes(_WEIGHTS[stage], 1.0, ky, stage, y_next)
            for i in range(len(y)):
                y_next[i] = y[i] + h * y_next[i]

            for i in range(len(flat)):
                flat_next[i] = flat[i]
            add_slopes(_WEIGHTS[stage], h, flat_slopes, stage, flat_next)

            # The only call of the right-hand side: each call is compiled separately.
            if stage < STAGES:
                rates(t + _NODES[stage] * h, y_next, z_next, parameters, ky[stage], kz[stage])

    return step


@allocation_free
def add_slopes(weights: Floats, factor: float, slopes: Floats, count: int, total: Floats) -> None:
    """Add the first `count` slopes to a total, shape (n,), each times its weight and a factor."""
    for k in range(count):
        weight = factor * weights[k]
        if weight != 0.0:
            for i in range(len(total)):
                total[i] += weight * slopes[k, i]


@allocation_free
def error_of_step(y: Floats, y_next: Floats, ky: Floats, tolerance: float, h: float) -> float:
    """Return the error of a step in y, divided by the tolerance, which is relative and absolute.

    A step is good enough below 1. `h` is the length of the step, positive also backward in time.
    Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.10.
    """
    third = fifth = 0.0
    for i in range(len(y)):
        scale = tolerance * (1.0 + max(abs(y[i]), abs(y_next[i])))
        third_error = fifth_error = 0.0
        for k in range(STAGES):
            third_error += _THIRD[k] * ky[k, i]
            fifth_error += _FIFTH[k] * ky[k, i]
        third += (third_error / scale) ** 2
        fifth += (fifth_error / scale) ** 2

    if third == 0.0 and fifth == 0.0:
        return 0.0
    return float(h * fifth / np.sqrt((fifth + _THIRD_ORDER_SHARE * third) * len(y)))
