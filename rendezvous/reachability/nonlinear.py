"""The true motion of a craft beside one on an elliptic orbit, without linearisation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from rendezvous.relative_motion import EllipticOrbit

Floats = NDArray[np.float64]

_RELATIVE = 1e-12
_ABSOLUTE = 1e-9


@dataclass(frozen=True)
class NonlinearMotion:
    """Relative motion in a central field, in the orbital frame: x against the motion, y outward, z completes.

    Parameters
    ----------
    orbit : EllipticOrbit
        Of the passive craft.
    semi_major_axis_m : float
        Of the same.

    Notes
    -----
    Equations (1) of Shorikov and Goranov (2021), with w^2 r^4 / p = mu; DOP853 to 1e-12.
    """

    orbit: EllipticOrbit
    semi_major_axis_m: float

    def paths(self, start_s: float, states: ArrayLike, accelerations: ArrayLike, times_s: ArrayLike) -> Floats:
        """Return where states lead under constant accelerations.

        Parameters
        ----------
        start_s : float
        states : array_like, shape (k, 6)
            m and m/s.
        accelerations : array_like, shape (k, 3)
            Constant in the rotating axes, m/s^2.
        times_s : array_like, shape (s,)
            Rising, none before the start.

        Returns
        -------
        ndarray, shape (k, s, 6)

        Raises
        ------
        ArithmeticError
            If a path cannot be integrated, as one that comes too near the centre.
        """
        given, push = np.atleast_2d(np.asarray(states, float)), np.atleast_2d(np.asarray(accelerations, float))
        times = np.asarray(times_s, dtype=float)
        count = len(given)
        e, k2 = self.orbit.eccentricity, self.orbit.semi_latus_rate_rad_s
        parameter = self.semi_major_axis_m * (1.0 - e * e)
        gravity = k2 * k2 * parameter**3

        def slope(_time: float, flat: Floats) -> Floats:
            anomaly, state = flat[0], flat[1:].reshape(6, count)
            rho = 1.0 + e * np.cos(anomaly)
            r, w = parameter / rho, k2 * rho * rho
            w_dot = -2.0 * k2 * k2 * e * np.sin(anomaly) * rho**3
            x, y, z, vx, vy, vz = state
            pull = gravity / (x * x + (r + y) ** 2 + z * z) ** 1.5
            result = np.empty(1 + 6 * count)
            result[0] = w
            rates = result[1:].reshape(6, count)
            rates[:3] = vx, vy, vz
            rates[3] = 2.0 * w * vy + w * w * x + w_dot * y - pull * x + push[:, 0]
            rates[4] = -2.0 * w * vx + w * w * y - w_dot * x + gravity / r**2 - pull * (r + y) + push[:, 1]
            rates[5] = -pull * z + push[:, 2]
            return result

        begin = np.concatenate([[float(self.orbit.true_anomaly(start_s))], given.T.ravel()])
        if times[-1] == start_s:
            return np.repeat(given[:, None, :], len(times), axis=1)
        found = solve_ivp(
            slope, (start_s, times[-1]), begin, method="DOP853", t_eval=times, rtol=_RELATIVE, atol=_ABSOLUTE
        )
        if not found.success:
            raise ArithmeticError(f"the motion could not be integrated: {found.message}")
        return np.asarray(found.y[1:].reshape(6, count, len(times)).transpose(1, 2, 0))

    def fly(self, start: ArrayLike, accelerations: ArrayLike, period_s: float, points: int = 1) -> Floats:
        """Return the states of craft that hold an acceleration each period.

        Parameters
        ----------
        start : array_like, shape (6,)
            At t = 0.
        accelerations : array_like, shape (k, T, 3)
            m/s^2.
        period_s : float
        points : int
            How many instants a period to return.

        Returns
        -------
        ndarray, shape (k, T points + 1, 6)

        Raises
        ------
        ArithmeticError
            If a path cannot be integrated.
        """
        push = np.asarray(accelerations, dtype=float)
        state = np.broadcast_to(np.asarray(start, dtype=float), (len(push), 6))
        path = [state[:, None, :]]
        for t in range(push.shape[1]):
            times = period_s * (t + np.arange(1, points + 1) / points)
            found = self.paths(period_s * t, state, push[:, t], times)
            path.append(found)
            state = found[:, -1]
        return np.concatenate(path, axis=1)
