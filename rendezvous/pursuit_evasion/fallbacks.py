"""Other routes to an extremal, for where its branch cannot be followed: none of them excludes an earlier capture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rendezvous.linear_game import LinearGameError, circular_orbit_capture
from rendezvous.pursuit_evasion._branch import MOST_WORK, Ending, follow, polish
from rendezvous.pursuit_evasion._capture import capture_of, horizon_s, near
from rendezvous.pursuit_evasion._pair import COARSE, Node
from rendezvous.pursuit_evasion._side import Craft, across
from rendezvous.pursuit_evasion.game import Game
from rendezvous.pursuit_evasion.history import orbital_axes
from rendezvous.pursuit_evasion.paths import Policy, steered_path
from rendezvous.pursuit_evasion.solution import Capture
from rendezvous.pursuit_evasion.units import Units, scaled_craft, scaled_pair, units_of

Floats = NDArray[np.float64]

_REACH_STEP, _MOST_REACH_STEPS, _REACHED = 0.1, 400, 1e-6
_MOST_ITERATIONS = 8
_THRUST_STEP, _LEAST_THRUST_STEP = 0.25, 1e-3
_LONGEST = 40.0
"""Radians that the linear game is looked at."""


def solve_by_homotopy(game: Game) -> Capture | None:
    """Solve a game by raising the evader's thrust from zero.

    Parameters
    ----------
    game : Game

    Returns
    -------
    Capture or None
        A local saddle, whose time says nothing of earlier captures.

    Notes
    -----
    Quarters of the thrust, halved where Newton's method fails.
    """
    units = units_of(game)
    still = _with_thrust(game, 0.0)
    latest = horizon_s(still) / units.time_s
    first = scaled_pair(still, units).begin(latest)
    if first is None:
        return None
    branch = follow(scaled_pair(still, units), first, game.capture_radius_m / units.length_m, latest, 0.25 * MOST_WORK)
    if branch.ending is not Ending.CAPTURE:
        return None
    node: Node = branch.last
    done, step = 0.0, _THRUST_STEP
    while done < 1.0 and step > _LEAST_THRUST_STEP:
        to = min(1.0, done + step)
        found = near(_with_thrust(game, to), units, node)
        if found is None:
            step *= 0.5
            continue
        node, done = found, to
    if done < 1.0:
        return None
    fine = polish(scaled_pair(game, units), node.vector, node.duration, node.distance, horizon_s(game) / units.time_s)
    return capture_of(game, units, fine) if fine is not None and fine.is_saddle and fine.closing > 0.0 else None


def solve_by_linear_game(game: Game) -> Capture | None:
    """Solve a game from the answer of its linear game about the pursuer's circular orbit.

    Parameters
    ----------
    game : Game

    Returns
    -------
    Capture or None
        A local saddle, whose time says nothing of earlier captures.

    Notes
    -----
    The relative state is curvilinear: along the motion it is the arc, which keeps the linear game near the real one for
    long distances. Its duration and direction are the guess; each side's end is found by lengthening its own flight.
    """
    units = units_of(game)
    linear = _linear_guess(game, units)
    if linear is None or linear[0] * units.time_s >= horizon_s(game):
        return None
    duration, nu = linear
    pair = scaled_pair(game, units)
    ends = [_reached(scaled_craft(player, game.gravity, units), nu, duration) for player in (game.pursuer, game.evader)]
    if ends[0] is None or ends[1] is None:
        return None
    fine = polish(
        pair,
        np.concatenate([ends[0], ends[1], nu]),
        duration,
        game.capture_radius_m / units.length_m,
        horizon_s(game) / units.time_s,
    )
    return capture_of(game, units, fine) if fine is not None and fine.is_saddle and fine.closing > 0.0 else None


def _linear_guess(game: Game, units: Units) -> tuple[float, Floats] | None:
    """Return duration and direction of the linear game, nondimensional, in the inertial frame."""
    pursuer = scaled_craft(game.pursuer, game.gravity, units)
    p, e = pursuer.start, scaled_craft(game.evader, game.gravity, units).start
    axes = orbital_axes(p[None, :3], p[None, 3:])[0]
    position, velocity = axes @ e[:3], axes @ e[3:]
    angle, radius = np.arctan2(position[1], position[0]), np.hypot(position[0], position[1])
    inward, ahead = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    own_radius = float(np.linalg.norm(p[:3]))
    own_rate = float((axes @ p[3:])[1]) / own_radius
    rate = float(velocity[:2] @ ahead) / radius
    offset = np.array([radius - own_radius, angle, position[2]])
    drift = np.array([velocity[:2] @ inward - (axes @ p[3:])[0], rate - own_rate, velocity[2]])
    force = units.length_m / units.time_s**2
    try:
        found = circular_orbit_capture(
            offset,
            drift,
            game.pursuer.acceleration_m_s2 / force,
            game.evader.acceleration_m_s2 / force,
            1.0,
            longest_s=min(_LONGEST, horizon_s(game) / units.time_s),
        )
    except LinearGameError:  # it is only a guess
        return None
    if found is None:
        return None
    coast = steered_path(pursuer, Policy.COAST.direction, found.time_s).state_at(found.time_s)[0]
    return found.time_s, np.asarray(orbital_axes(coast[None, :3], coast[None, 3:])[0].T @ found.direction)


def _reached(craft: Craft, nu: Floats, duration: float) -> Floats | None:
    """Return where a craft gets that strives along nu, by lengthening its flight from nothing."""
    plane = across(nu)
    time = min(0.01, duration)
    state, step = craft.ballistic(time, nu), _REACH_STEP
    slope: Floats | None = None
    for _ in range(_MOST_REACH_STEPS):
        to = time if slope is None else min(duration, time + step)
        guess = state if slope is None else state + (to - time) * slope
        found = _end_near(craft, guess, nu, plane, to)
        if found is None:
            if slope is None or step < 1e-4:
                return None
            step *= 0.4
            continue
        (state, slope), time, step = found, to, min(2.0 * step, _REACH_STEP)
        if time >= duration:
            return state
    return None


def _end_near(craft: Craft, state: Floats, nu: Floats, plane: Floats, duration: float) -> tuple[Floats, Floats] | None:
    """Return the end state near a guess, and its slope in time."""
    for _ in range(_MOST_ITERATIONS):
        response = craft.respond(state, nu, plane, duration, COARSE)
        if response is None or np.abs(response.rho).max() > 0.5:
            return None
        state = state + response.rho
        if np.abs(response.rho).max() < _REACHED:
            return state, response.by_time
    return None


def _with_thrust(game: Game, share: float) -> Game:
    return replace(game, evader=replace(game.evader, thrust_n=share * game.evader.thrust_n))
