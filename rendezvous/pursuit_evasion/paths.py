"""Paths of the players, extremal or steered, and samples of a capture for figures and tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._extremal import (
    NO_VARIATIONS,
    STATES,
    end_of,
    flow_back,
    rate,
)
from infoset.rendezvous.pursuit_evasion._pair import FINE, ExtremalCraft, Node
from infoset.rendezvous.pursuit_evasion.game import Units, scaled_game
from infoset.rendezvous.pursuit_evasion.solution import CaptureSolution

Direction = Callable[[float, Floats], Floats]
"""Direction of thrust, shape (3,), of a time and a state: any length, zero to coast."""

_PATH_TOLERANCE = 1e-12
"""Tolerance of steered paths, near the smallest that DOP853 reaches."""
_MAX_RATES = 50_000
"""Largest number of evaluations in a path: about a second, and 50 times a path without turns."""


class PathError(ArithmeticError):
    """A path cannot be followed."""


@dataclass(frozen=True)
class ExtremalPath:
    """The path of one side of an extremal.

    It ends in `end_state`, shape (6,), along `nu`, shape (3,), after `duration`.
    """

    craft: ExtremalCraft
    end_state: Floats
    nu: Floats
    duration: float

    def at(self, time: float) -> Floats:
        """Return state and costate at a time, shape (12,), which may be a little beyond the end."""
        y = end_of(self.end_state, self.nu)
        self._carry(y, 0.0, self.duration - time)
        return y

    def sampled(self, times: Floats) -> Floats:
        """Return states and costates at rising times, shape (n, 12)."""
        out = np.empty((len(times), STATES))
        y = end_of(self.end_state, self.nu)
        to_go = 0.0
        for i in range(len(times) - 1, -1, -1):
            self._carry(y, to_go, self.duration - times[i])
            to_go = self.duration - times[i]
            out[i] = y
        return out

    def state_at(self, time: float) -> tuple[Floats, Floats]:
        """Return state, shape (6,), and acceleration, shape (3,), at a time."""
        y = self.at(time)
        if not y[9:].any():
            # At the very end p_v is zero, and the thrust is along nu.
            y[9:] = self.nu
        mass = self.craft.mass - self.craft.flow * time
        return y[:6], rate(y, self.craft.mu, self.craft.oblateness, self.craft.thrust / mass)[3:]

    def _carry(self, y: Floats, begin: float, end: float) -> None:
        craft = self.craft.kernel_craft(self.duration)
        if not flow_back(y, NO_VARIATIONS, craft, begin, end, FINE):
            raise PathError("an extremal of the solution cannot be propagated")


def extremal_paths(
    pursuer: ExtremalCraft, evader: ExtremalCraft, node: Node
) -> tuple[ExtremalPath, ExtremalPath]:
    """Return the paths of both sides of an extremal."""
    return (
        ExtremalPath(pursuer, node.pursuer, node.nu, node.duration),
        ExtremalPath(evader, node.evader, node.nu, node.duration),
    )


@dataclass(frozen=True)
class SteeredPath:
    """The path of a craft that is steered by a rule.

    `solution` returns state and mass, shape (7,), at a time.
    """

    craft: ExtremalCraft
    direction: Direction
    solution: Callable[[float], Floats]

    def state_at(self, time: float) -> tuple[Floats, Floats]:
        """Return state, shape (6,), and acceleration, shape (3,), at a time."""
        state = np.asarray(self.solution(time), dtype=np.float64)
        return state[:6], _rates(time, state, self.craft, self.direction)[3:6]


def steered_path(craft: ExtremalCraft, direction: Direction, duration: float) -> SteeredPath:
    """Return the path of a craft with thrust along a direction, or none where that is zero.

    SciPy's DOP853 to 1e-12: some 3 ms a revolution. Raise `PathError` if the direction turns so
    fast that integration takes too long, or the path comes too near the planet's centre.
    """
    calls = 0

    def counted(time: float, state: Floats) -> Floats:
        nonlocal calls
        calls += 1
        if calls > _MAX_RATES:
            raise PathError("the direction of thrust turns too fast to integrate the path")
        return _rates(time, state, craft, direction)

    path = solve_ivp(
        counted,
        (0.0, duration),
        np.append(craft.start, craft.mass),
        method="DOP853",
        rtol=_PATH_TOLERANCE,
        atol=_PATH_TOLERANCE,
        dense_output=True,
    )
    if not path.success:
        raise PathError("the path cannot be integrated: it passes too near the planet's centre")
    return SteeredPath(craft, direction, path.sol)


def _rates(time: float, state: Floats, craft: ExtremalCraft, direction: Direction) -> Floats:
    y = np.zeros(STATES)
    y[:6] = state[:6]
    y[9:] = direction(time, state[:6])
    out = np.zeros(7)
    out[:6] = rate(y, craft.mu, craft.oblateness, craft.thrust / state[6])
    out[6] = -craft.flow if y[9:].any() else 0.0
    return out


@dataclass(frozen=True)
class PlayerHistory:
    """One player at n times, in the inertial frame; vectors have shape (n, 3).

    `thrust_direction` has unit vectors; zero for a craft without thrust. `switching`, shape (n,),
    is |lambda_v| / m - k lambda_m / c over its value at the start: full thrust is optimal while it
    is positive. It is the factor of k T in the Hamiltonian of Wang's slides, "Optimal control".
    """

    position_m: Floats
    velocity_m_s: Floats
    mass_kg: Floats
    thrust_direction: Floats
    switching: Floats


@dataclass(frozen=True)
class CaptureHistory:
    """Both players at times from the start, shape (n,)."""

    time_s: Floats
    pursuer: PlayerHistory
    evader: PlayerHistory


def history(solution: CaptureSolution, count: int = 400) -> CaptureHistory:
    """Sample the capture of a `solution` at `count` equally spaced times from start to end.

    The default is chosen for smooth curves.

    Raises
    ------
    ValueError
        If there is no capture.
    """
    capture = solution.capture
    if capture is None:
        raise ValueError(f"there is no capture to sample: the verdict is {solution.verdict.value}")
    units = solution.units
    node = capture.extremal
    times = np.linspace(0.0, node.duration, count)
    scaled = scaled_game(solution.game, units)
    paths = extremal_paths(scaled.pursuer, scaled.evader, node)
    pursuer, evader = (_sampled(path, times, units) for path in paths)
    return CaptureHistory(times * units.time_s, pursuer, evader)


def orbital_axes(position_m: Floats, velocity_m_s: Floats) -> Floats:
    """Return the radial, transverse and normal axes at states, shape (n, 3, 3).

    The transverse axis is in the plane of the motion; on a circle it is along the motion.
    `position_m` and `velocity_m_s` have shape (n, 3). Rows are the axes: the components of a vector
    are axes @ vector.
    """
    radial = position_m / np.linalg.norm(position_m, axis=1, keepdims=True)
    normal = np.cross(position_m, velocity_m_s)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([radial, np.cross(normal, radial), normal], axis=1)


def _sampled(path: ExtremalPath, times: Floats, units: Units) -> PlayerHistory:
    """Return states, thrust and switching function of a path at rising times, in SI.

    The switching function is |p_v| / m plus the integral of flow |p_v| / m^2 until the end, divided
    by its first value: thrust is best where it is positive.
    """
    y = path.sampled(times)
    craft = path.craft
    mass = craft.mass - craft.flow * times
    size = np.linalg.norm(y[:, 9:], axis=1)
    # p_v is zero at the end, where the thrust is along nu: 1e-300 only avoids a division by zero.
    along_costate = y[:, 9:] / np.maximum(size, 1e-300)[:, None]
    direction = np.where(size[:, None] > 0.0, along_costate, path.nu)

    # The costate of the mass, by the trapezoid rule: this is drawn, not computed with.
    rate = size * craft.flow / mass**2
    lost = np.append(np.cumsum((0.5 * (rate[1:] + rate[:-1]) * np.diff(times))[::-1])[::-1], 0.0)
    switching = size / mass + lost

    return PlayerHistory(
        position_m=y[:, :3] * units.length_m,
        velocity_m_s=y[:, 3:6] * units.speed_m_s,
        mass_kg=mass * units.mass_kg,
        thrust_direction=direction if craft.thrust > 0.0 else np.zeros_like(direction),
        switching=switching / switching[0],
    )
