"""States and thrust of both players along an extremal, at times, for figures and tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.pursuit_evasion.paths import ExtremalPath, extremal_paths
from rendezvous.pursuit_evasion.solution import Solution
from rendezvous.pursuit_evasion.units import Units, scaled_game

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PlayerHistory:
    """One player at times.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (n, 3)
        In the inertial frame.
    mass_kg : ndarray, shape (n,)
        Mass with propellant.
    thrust_direction : ndarray, shape (n, 3)
        Unit vectors; zero for a craft without thrust.
    switching : ndarray, shape (n,)
        |lambda_v| / m - k lambda_m / c over its value at the start: full thrust is optimal while it is positive. It is
        the factor of k T in the Hamiltonian of Wang's slides, "Optimal control".
    """

    position_m: Floats
    velocity_m_s: Floats
    mass_kg: Floats
    thrust_direction: Floats
    switching: Floats


@dataclass(frozen=True)
class History:
    """Both players at times.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times from the start.
    pursuer, evader : PlayerHistory
        At these times.
    """

    time_s: Floats
    pursuer: PlayerHistory
    evader: PlayerHistory


def history(solution: Solution, count: int = 400) -> History:
    """Sample the capture or the fallback of a `solution` at `count` equally spaced times, from the start to the end.

    Raises
    ------
    ValueError
        If the solution has neither.
    """
    capture = solution.capture or solution.fallback
    if capture is None:
        raise ValueError(f"a game that ends as {solution.verdict.value} has no capture to sample")
    units, node = solution.units, capture.extremal
    times = np.linspace(0.0, node.duration, count)
    scaled = scaled_game(solution.game, units)
    paths = extremal_paths(scaled.pursuer, scaled.evader, node)
    pursuer, evader = (_sampled(path, times, units) for path in paths)
    return History(times * units.time_s, pursuer, evader)


def orbital_axes(position_m: Floats, velocity_m_s: Floats) -> Floats:
    """Return the axes radial, along the motion and normal at states, shape (n, 3, 3).

    `position_m` and `velocity_m_s` have shape (n, 3). Rows are the axes: the components of a vector are axes @ vector.
    """
    radial = position_m / np.linalg.norm(position_m, axis=1, keepdims=True)
    normal = np.cross(position_m, velocity_m_s)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([radial, np.cross(normal, radial), normal], axis=1)


def _sampled(path: ExtremalPath, times: Floats, units: Units) -> PlayerHistory:
    y, craft = path.sampled(times), path.craft
    mass = craft.mass - craft.flow * times
    size = np.linalg.norm(y[:, 9:], axis=1)
    direction = np.where(size[:, None] > 0.0, y[:, 9:] / np.maximum(size, 1e-300)[:, None], path.nu)
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
