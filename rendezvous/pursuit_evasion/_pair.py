"""Extremals of one side, and of both sides by Newton's method at a duration T or a distance l.

At each duration T both sides reach the maximum distance along nu, and r_E - r_P = l nu. At l = 0
these are the terminal conditions of Wang's slides ("Optimal control"): r_P = r_E, lambda_rP +
lambda_rE = 0, lambda_v = 0. The last condition there, lambda_rP . (v_P - v_E) = 1, only determines
the scale of the costates: here |nu| = 1, and the closing speed must be positive. All values are
nondimensional.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._coupling import Coupling, Step, across, couple, newton_step
from infoset.rendezvous.pursuit_evasion._extremal import (
    NO_VARIATIONS,
    Response,
    end_of,
    flow_back,
    rate,
    respond,
)

# Where a value is chosen, the capture times of `leo-pursuit`, `geo-pursuit` and variants are the
# same to 1e-6 s from a quarter to four times of it, of `_MAX_ITERATIONS` from 6 to 24 (measured).
FINE = 1e-13
"""Tolerance of the propagation of results: some 100 steps keep the residual below 1e-11 (a
test).
"""
COARSE = 1e-9
"""Tolerance of the propagation of intermediate iterations, and of derivatives: a hundredth of
`CLOSE`, so that Newton's method still converges to it."""
MAX_RESIDUAL = 1e-9
"""Maximum error of a result in the necessary conditions: start states, and r_E - r_P = l nu. A
hundred times the residual that `FINE` leaves."""
CLOSE = 1e-7
"""Maximum last correction of Newton's method, of results: its square is below `FINE`."""
ROUGH = 1e-4
"""Maximum last correction of Newton's method, of intermediate extremals; chosen."""
_MAX_ITERATIONS = 12
"""Three times the iterations of a guess with an error of 0.1 whose digits double in each: with the
same derivatives they double more slowly. Chosen."""
_FIRST_DURATION = 0.01
"""Radians: gravity and thrust hardly change in so short a game, so the line of sight is a guess.

Chosen.
"""
_MIN_OF_FIRST = 1e-9
"""Shortest first duration, in radians; chosen: a shorter game is lost in rounding."""
_FARTHEST = 0.7
"""Largest correction, in units of length and speed: beyond it another extremal may be found.

Chosen.
"""
_NEAR = 1e-2
"""Largest distance of the first extremal from its guess, which is nearly exact. Chosen."""
_FRACTION = 0.2
"""Ratio of two corrections up to which derivatives are used again; chosen."""
_NEAR_ENOUGH = 1e-3
"""Correction up to which derivatives are used again; chosen."""


@dataclass(frozen=True)
class ExtremalCraft:
    """One side of a game, which chooses its direction of thrust.

    All values are nondimensional, and `start` has shape (6,).
    """

    start: Floats
    thrust: float
    mass: float
    flow: float
    mu: float
    oblateness: float

    def kernel_craft(self, duration: float) -> Floats:
        """Return the parameters of `flow_back` for a game of a duration."""
        return np.array(
            [self.mu, self.oblateness, self.thrust, self.mass - self.flow * duration, self.flow]
        )

    def respond(
        self, end_state: Floats, nu: Floats, plane: Floats, duration: float, tolerance: float
    ) -> Response | None:
        """Linearise at a guess of the end state.

        It is None if the guess cannot be propagated, or the map to the start is singular.
        """
        craft = self.kernel_craft(duration)
        response = respond(self.start, craft, end_state, nu, plane, duration, tolerance)
        return response if response.residual < math.inf else None

    def correct(
        self, response: Response, end_state: Floats, nu: Floats, duration: float, tolerance: float
    ) -> Floats | None:
        """Return Newton's correction of a guess, (6,), with the derivatives of another.

        It is None if the guess cannot be propagated.
        """
        y = end_of(end_state, nu)
        craft = self.kernel_craft(duration)
        if not flow_back(y, NO_VARIATIONS, craft, 0.0, duration, tolerance):
            return None
        return response.inverse @ (self.start - y[:6])

    def ballistic(self, duration: float, nu: Floats) -> Floats:
        """Return a guess of the end state after a short time, shape (6,).

        Gravity and thrust are constant, as at the start.
        """
        y = np.concatenate([self.start, nu, nu])
        acceleration = rate(y, self.mu, self.oblateness, self.thrust / self.mass)[3:]
        velocity = self.start[3:] + duration * acceleration
        position = self.start[:3] + 0.5 * duration * (self.start[3:] + velocity)
        return np.concatenate([position, velocity])


@dataclass(frozen=True)
class KnownPath:
    """A side on a known path.

    `state_at` returns state, shape (6,), and acceleration, shape (3,), at a time.
    """

    state_at: Callable[[float], tuple[Floats, Floats]]

    def respond(
        self, end_state: Floats, nu: Floats, plane: Floats, duration: float, tolerance: float
    ) -> Response | None:
        """Return the state on the path, whatever nu is.

        A given path has no conjugate point and no costate, and its end is no guess: `inverse` is
        not used.
        """
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


Side = ExtremalCraft | KnownPath


@dataclass(frozen=True)
class Node:
    """An extremal of the game of one duration T, with the distance l.

    `nu`, shape (3,), is the unit vector from the pursuer's end to the evader's; `pursuer` and
    `evader`, shape (6,), are the end states. `curvature`, shape (2,), contains the eigenvalues of
    the Hessian of h_P - h_E across nu, ascending; `closing` is nu . (v_P - v_E), the rate at which
    l falls; `regular` says that neither side's extremal has a conjugate point.

    `slope`, shape (15,), is d/dT of (pursuer, evader, nu) at l free, of the last guess, so to first
    order. `costates`, shape (2, 6), are p at the start, pursuer's and evader's, of the last guess
    that was linearised. `residual` is the error of the start states of that guess, and of r_E - r_P
    = l nu at the ends of this extremal.
    """

    duration: float
    distance: float
    nu: Floats
    pursuer: Floats
    evader: Floats
    curvature: Floats
    closing: float
    regular: bool
    slope: Floats
    costates: Floats
    residual: float

    @property
    def is_saddle(self) -> bool:
        """Whether no small change of nu helps the evader, and both extremals are maxima."""
        return self.regular and bool(self.curvature[0] + self.distance > 0.0)

    @property
    def is_nearest(self) -> bool:
        """Whether no small change brings the pursuer nearer to an evader on a given path.

        Beyond a conjugate point the reachable set of the pursuer is locally concave: the radius of
        curvature of its boundary has changed from plus to minus infinity, and must stay beyond -l.
        """
        minimum, maximum = self.curvature + self.distance
        if self.regular:
            return bool(minimum > 0.0)
        return bool(minimum < 0.0 < maximum)

    @property
    def vector(self) -> Floats:
        """Pursuer, evader, nu: shape (15,)."""
        return np.concatenate([self.pursuer, self.evader, self.nu])


@dataclass(frozen=True)
class _Linear:
    """Both sides linearised at a guess, and the solution of the 3 x 3 system that couples them."""

    pursuer: Response
    evader: Response
    plane: Floats
    time_free: bool
    coupling: Coupling

    def step(self, rho: Floats, state: Floats) -> Step:
        """Return Newton's step of (pursuer, evader, nu, T, l).

        `rho`, shape (2, 6), are the corrections of the two end states.
        """
        return newton_step(
            self.pursuer, self.evader, self.plane, self.coupling.inverse, rho, state, self.time_free
        )

    def node(self, state: Floats) -> Node:
        """Return the extremal that the last step led to."""
        p = self.pursuer
        e = self.evader
        apart = state[6:9] - state[:3] - state[16] * state[12:15]
        return Node(
            duration=float(state[15]),
            distance=float(state[16]),
            nu=state[12:15],
            pursuer=state[:6],
            evader=state[6:12],
            curvature=self.coupling.curvature,
            closing=float(state[12:15] @ (state[3:6] - state[9:12])),
            regular=p.regular and e.regular,
            slope=self.coupling.slope,
            costates=np.stack([p.costate, e.costate]),
            residual=max(p.residual, e.residual, float(np.abs(apart).max())),
        )


@dataclass(frozen=True)
class Pair:
    """Both sides of a game."""

    pursuer: Side
    evader: Side

    def is_sound(self, node: Node) -> bool:
        """Return whether it is a saddle, or a nearest extremal if the evader's path is fixed."""
        if isinstance(self.evader, KnownPath):
            return node.is_nearest
        return node.is_saddle

    def solve(
        self,
        guess: Floats,
        duration: float,
        distance: float,
        *,
        time_free: bool,
        tolerance: float,
        linear_tolerance: float = COARSE,
        close: float = CLOSE,
        latest: float = math.inf,
    ) -> Node | None:
        """Return the extremal near a guess, shape (15,), of end states and nu.

        It is None if Newton's method does not converge, a guess cannot be propagated, or the
        duration leaves (0, `latest`]. If `time_free`, the distance is known and the duration a
        guess, otherwise the reverse. The propagation has a `tolerance`, that of derivatives
        `linear_tolerance` if it is larger; `close` is the maximum size of the last correction. The
        result may be any extremal, also one that is no saddle.

        Both sides are propagated with their variations, then several times without, with the same
        derivatives, while each correction is a fraction of the previous one: 0.5 ms and 0.1 ms per
        revolution.
        """
        state = np.concatenate(
            [guess[:12], guess[12:] / np.sqrt(guess[12:] @ guess[12:]), [duration, distance]]
        )
        before = math.inf
        uses = 0
        linear: _Linear | None = None
        for _ in range(_MAX_ITERATIONS):
            fresh = linear is None
            linear = linear or self._linearised(state, max(tolerance, linear_tolerance), time_free)
            if linear is None:
                return None

            # New derivatives of the same tolerance contain the correction.
            if fresh and tolerance >= linear_tolerance:
                rho = np.array([linear.pursuer.rho, linear.evader.rho])
            else:
                nu = state[12:15]
                length = float(state[15])
                p = self.pursuer.correct(linear.pursuer, state[:6], nu, length, tolerance)
                e = self.evader.correct(linear.evader, state[6:12], nu, length, tolerance)
                if p is None or e is None:
                    return None
                rho = np.array([p, e])

            # A correction above four times the one before diverges; chosen.
            change, correction = linear.step(rho, state)
            if not correction < min(_FARTHEST, 4.0 * before):
                return None
            state = state + change
            state[12:15] /= np.sqrt(state[12:15] @ state[12:15])
            if not 0.0 < state[15] <= latest:
                return None
            if correction < close:
                return linear.node(state)

            # The first correction only restores the start states: the second may be as great.
            uses = 0 if fresh else uses + 1
            if correction > _NEAR_ENOUGH or (uses > 1 and correction > _FRACTION * before):
                linear = None
            before = correction
        return None

    def _linearised(self, state: Floats, tolerance: float, time_free: bool) -> _Linear | None:
        """Return the linear equations of Newton's method at a state, or None if they fail."""
        nu = state[12:15]
        duration = float(state[15])
        distance = float(state[16])
        plane = across(nu)
        p = self.pursuer.respond(state[:6], nu, plane, duration, tolerance)
        e = self.evader.respond(state[6:12], nu, plane, duration, tolerance)
        if p is None or e is None:
            return None
        coupling = couple(p, e, plane, nu, distance, time_free)
        return _Linear(p, e, plane, time_free, coupling) if coupling.solvable else None

    def begin(self, latest: float, radius: float) -> Node | None:
        """Return a saddle of a short duration, at most half of `latest`, or None.

        The guess of nu is the line of sight. Its distance is greater than the capture radius: there
        is no earlier capture.
        """
        duration = min(_FIRST_DURATION, 0.5 * latest)
        while duration > _MIN_OF_FIRST:
            # The line of sight of coasting craft: a direction of zero is no thrust.
            coasting = np.zeros(3)
            pursuer = self.pursuer.ballistic(duration, coasting)
            evader = self.evader.ballistic(duration, coasting)
            sight = evader[:3] - pursuer[:3]
            distance = float(np.linalg.norm(sight))
            nu = sight / distance

            guess = np.concatenate(
                [self.pursuer.ballistic(duration, nu), self.evader.ballistic(duration, nu), nu]
            )
            node = self.solve(
                guess, duration, distance, time_free=False, tolerance=COARSE, close=ROUGH
            )
            close = node is not None and float(np.abs(node.vector - guess).max()) < _NEAR
            if node is not None and close and node.is_saddle and node.distance > radius:
                return node
            duration *= 0.25  # chosen
        return None
