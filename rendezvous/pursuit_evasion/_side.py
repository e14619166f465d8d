"""One side of a game at a time: its end state and the derivatives by its direction. Nondimensional."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rendezvous._arrays import Floats
from rendezvous.pursuit_evasion._extremal import acceleration, eliminate, rate, shoot_back, shoot_state_back

_IDENTITY = np.eye(6)


@dataclass(frozen=True)
class Response:
    """Linear dependence of an end state at a guess of it: rho + by_nu dnu + by_time dT leads to the true one.

    `rho`, shape (6,), is Newton's correction of the guess; `by_nu`, shape (6, 2), and `by_time`, shape (6,), are the
    derivatives along two directions across nu and by the duration. `regular` says that there is no conjugate point: the
    map from end states near by to start states preserves orientation. `inverse`, shape (6, 6), is the inverse of the
    derivative of the start state by the end state, `costate`, shape (6,), p_r and p_v at the start, and `residual` the
    greatest component of the error of the start state.
    """

    rho: Floats
    by_nu: Floats
    by_time: Floats
    regular: bool
    inverse: Floats
    costate: Floats
    residual: float


class Side(Protocol):
    """One side of a game: a craft that chooses its thrust, or one on a known path."""

    def respond(
        self, end_state: Floats, nu: Floats, plane: Floats, duration: float, tolerance: float
    ) -> Response | None:
        """Linearise at a guess of the end state; None if it cannot be propagated."""

    def correct(
        self, response: Response, end_state: Floats, nu: Floats, duration: float, tolerance: float
    ) -> Floats | None:
        """Newton's correction of another guess, with the derivatives of an earlier one near by; shape (6,)."""

    def ballistic(self, duration: float, nu: Floats) -> Floats:
        """A guess of the end state after a short time, shape (6,)."""


@dataclass(frozen=True)
class Craft:
    """A side that chooses its direction of thrust; all nondimensional, `start` of shape (6,)."""

    start: Floats
    thrust: float
    mass: float
    flow: float
    mu: float
    oblateness: float

    def kernel_craft(self, duration: float) -> Floats:
        """Return the parameters of `flow_back` for a game of a duration."""
        return np.array([self.mu, self.oblateness, self.thrust, self.mass - self.flow * duration, self.flow])

    def respond(
        self, end_state: Floats, nu: Floats, plane: Floats, duration: float, tolerance: float
    ) -> Response | None:
        """Shoot back from the guess and linearise there."""
        shot = shoot_back(end_state, nu, plane, self.kernel_craft(duration), duration, tolerance)
        if shot is None:
            return None
        y, z = shot
        right = np.empty((6, 10))
        right[:, :6] = _IDENTITY
        right[:, 6] = self.start - y[:6]
        right[:, 7:9] = -z[:6, 6:8]
        # A longer game starts further back, and ends with less mass.
        right[:, 9] = rate(y, self.mu, self.oblateness, self.thrust / self.mass) + self.flow * z[:6, 8]
        residual = float(np.abs(right[:, 6]).max())
        determinant = eliminate(z[:6, :6].copy(), right)
        if determinant == 0.0:
            return None
        return Response(
            rho=right[:, 6],
            by_nu=right[:, 7:9],
            by_time=right[:, 9],
            regular=determinant > 0.0,
            inverse=right[:, :6],
            costate=y[6:],
            residual=residual,
        )

    def correct(
        self, response: Response, end_state: Floats, nu: Floats, duration: float, tolerance: float
    ) -> Floats | None:
        """Shoot back from the guess without its variations."""
        start = shoot_state_back(end_state, nu, self.kernel_craft(duration), duration, tolerance)
        return None if start is None else response.inverse @ (self.start - start[:6])

    def ballistic(self, duration: float, nu: Floats) -> Floats:
        """Hold gravity and thrust as they are at the start."""
        gravity = np.empty(3)
        acceleration(self.start[:3], self.mu, self.oblateness, gravity)
        rate = gravity + self.thrust / self.mass * nu
        velocity = self.start[3:] + duration * rate
        return np.concatenate([self.start[:3] + 0.5 * duration * (self.start[3:] + velocity), velocity])


@dataclass(frozen=True)
class KnownPath:
    """A side on a known path: `state_at` gives state, shape (6,), and acceleration, shape (3,), at a time."""

    state_at: Callable[[float], tuple[Floats, Floats]]

    def respond(
        self, end_state: Floats, nu: Floats, plane: Floats, duration: float, tolerance: float
    ) -> Response | None:
        """Return the state on the path, whatever nu is."""
        state, acceleration_there = self.state_at(duration)
        by_time = np.concatenate([state[3:], acceleration_there])
        rho = state - end_state
        residual = float(np.abs(rho).max())
        return Response(rho, np.zeros((6, 2)), by_time, True, np.eye(6), np.zeros(6), residual)

    def correct(
        self, response: Response, end_state: Floats, nu: Floats, duration: float, tolerance: float
    ) -> Floats | None:
        """Return the difference to the state on the path."""
        return self.state_at(duration)[0] - end_state

    def ballistic(self, duration: float, nu: Floats) -> Floats:
        """Return the state on the path."""
        return self.state_at(duration)[0]


def across(nu: Floats) -> Floats:
    """Return two unit vectors across a unit vector and each other, shape (2, 3)."""
    x, y, z = nu
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]])
