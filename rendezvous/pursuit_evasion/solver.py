"""Solution of the game: the branch of extremals from T -> 0, a change of branch at folds, and other routes.

Homotopy and the linear game give an extremal if its branch cannot be followed. They do not exclude earlier captures.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rendezvous._arrays import Floats
from rendezvous.linear_game import LinearGameError, circular_orbit_capture
from rendezvous.pursuit_evasion._branch import MAX_WORK, Ending, follow, polish
from rendezvous.pursuit_evasion._pair import Craft, Node
from rendezvous.pursuit_evasion._scan import end_along, greater
from rendezvous.pursuit_evasion.game import Game, Player, ScaledGame, Units, horizon_s, scaled_game, units_of
from rendezvous.pursuit_evasion.paths import orbital_axes, steered_path
from rendezvous.pursuit_evasion.solution import Capture, DistanceCurve, PlayerEnd, Route, Solution, Verdict
from rendezvous.pursuit_evasion.steering import Policy

_MAX_BRANCHES = 6
_REACH_STEP, _MAX_REACH_STEPS = 0.1, 400
_THRUST_STEP, _MIN_THRUST_STEP = 0.25, 1e-3
_LONGEST = 40.0
"""Longest duration of the linear game, in radians."""


def solve(game: Game, *, change_branch: bool = True, all_directions: bool = False) -> Solution:
    """Solve a game without a guess.

    `change_branch` searches for another branch at a fold; each search takes seconds. `all_directions` searches also at
    the capture for a branch that keeps the evader farther away.

    Notes
    -----
    The game is that of Wang's slides, after Shen and Casalino (2018), who shoot forward from a guess. At each duration
    the evader takes the branch with the maximum distance l; the capture is the first time at which l is the capture
    radius. Cost: 20 to 40 ms per revolution. A capture whose residual is not below 1e-9 is rejected: the verdict is
    then that the branch is not certified.
    """
    scaled = scaled_game(game)
    units, pair, radius, latest = scaled.units, scaled.pair, scaled.radius, scaled.latest
    first = pair.begin(latest, radius)
    if first is None:
        empty = DistanceCurve(np.zeros(0), np.zeros(0), np.zeros(0))
        return Solution(game, units, Verdict.BRANCH_NOT_CERTIFIED, None, Route.CONTINUATION, empty, 0.0)
    nodes: list[Node] = []
    branch = follow(pair, first, radius, latest)
    changes, work = 0, branch.work
    while branch.ending in (Ending.CAPTURE, Ending.FOLD) and changes < _MAX_BRANCHES:
        if not (change_branch if branch.ending is Ending.FOLD else all_directions):
            break
        better = greater(pair, branch.last)
        if better is None:
            break
        nodes += branch.nodes if branch.ending is Ending.FOLD else branch.nodes[:-1]
        branch = follow(pair, better, radius, latest, MAX_WORK - work)
        changes, work = changes + 1, work + branch.work
    nodes += branch.nodes
    route = Route.SWITCHED if changes else Route.CONTINUATION
    curve = DistanceCurve(
        np.array([node.duration for node in nodes]) * units.time_s,
        np.array([node.distance for node in nodes]) * units.length_m,
        np.array([node.curvature[0] + node.distance for node in nodes]),
    )
    looked_at_s = branch.last.duration * units.time_s
    if branch.ending is Ending.CAPTURE:
        capture = _capture(game, units, branch.last)
        verdict = Verdict.CAPTURED if capture.is_local_saddle else Verdict.BRANCH_NOT_CERTIFIED
        return Solution(game, units, verdict, capture, route, curve, looked_at_s)
    if branch.ending is Ending.TIME:
        verdict, exhausted = _uncaptured(game)
        return Solution(game, units, verdict, None, route, curve, looked_at_s, exhausted)
    asked = change_branch and branch.ending is Ending.FOLD
    fallback, other = _by_another_route(game) if asked else (None, None)
    return Solution(game, units, Verdict.BRANCH_NOT_CERTIFIED, None, route, curve, looked_at_s, None, fallback, other)


def solve_near(game: Game, units: Units, guess: Node) -> Capture | None:
    """Solve a `game` from the extremal `guess` of a similar solved game with the `units`; 2 ms.

    Returns a local saddle, or None if Newton's method finds none whose residual is below 1e-9. Earlier captures are not
    excluded.
    """
    scaled = scaled_game(game, units)
    node = _polished(scaled, guess.vector, guess.duration, scaled.radius)
    return None if node is None else _capture(game, units, node)


def _polished(scaled: ScaledGame, guess: Floats, duration: float, radius: float) -> Node | None:
    """Find the extremal near a guess, with positive closing speed and curvature."""
    node = polish(scaled.pair, guess, duration, radius, scaled.latest)
    return node if node is not None and node.is_saddle and node.closing > 0.0 else None


def _capture(game: Game, units: Units, node: Node) -> Capture:
    time_s = node.duration * units.time_s

    def end(player: Player, state: Floats, costate: Floats) -> PlayerEnd:
        return PlayerEnd(
            propellant_kg=player.flow_kg_s * time_s,
            position_m=state[:3] * units.length_m,
            velocity_m_s=state[3:] * units.speed_m_s,
            costate_at_start=costate / node.closing,
        )

    return Capture(
        time_s=time_s,
        position_m=node.evader[:3] * units.length_m,
        direction=node.nu,
        closing_speed_m_s=node.closing * units.speed_m_s,
        curvature=node.curvature,
        pursuer=end(game.pursuer, node.pursuer, node.costates[0]),
        evader=end(game.evader, node.evader, -node.costates[1]),
        residual=node.residual,
        extremal=node,
    )


def _by_another_route(game: Game) -> tuple[Capture | None, Route | None]:
    """Return the capture of the first route that succeeds, and that route."""
    for route, solved_by in ((Route.HOMOTOPY, solve_by_homotopy), (Route.LINEAR_GAME, solve_by_linear_game)):
        capture = solved_by(game)
        if capture is not None:
            return capture, route
    return None, None


def _uncaptured(game: Game) -> tuple[Verdict, str | None]:
    """Return the verdict if there is no capture within the examined time."""
    pursuer, evader = game.pursuer, game.evader
    end_s = horizon_s(game)
    slack = 1.0 - 2e-3
    if evader.burn_time_s * slack <= end_s and evader.burn_time_s < pursuer.burn_time_s:
        return Verdict.PROPELLANT_EXHAUSTED, "evader"
    spent = "pursuer" if pursuer.burn_time_s * slack <= end_s else None
    stronger = pursuer.acceleration_m_s2 > evader.acceleration_m_s2
    return (Verdict.PROPELLANT_EXHAUSTED if spent and stronger else Verdict.ESCAPES), spent


def solve_by_homotopy(game: Game) -> Capture | None:
    """Solve a `game` by raising the evader's thrust from zero, in quarters, halved where Newton's method fails.

    Returns a local saddle; earlier captures are not excluded.
    """
    units = units_of(game)
    still = scaled_game(_with_thrust(game, 0.0), units)
    first = still.pair.begin(still.latest, still.radius)
    if first is None:
        return None
    branch = follow(still.pair, first, still.radius, still.latest, 0.25 * MAX_WORK)
    if branch.ending is not Ending.CAPTURE:
        return None
    node: Node = branch.last
    done, step = 0.0, _THRUST_STEP
    while done < 1.0 and step > _MIN_THRUST_STEP:
        to = min(1.0, done + step)
        scaled = scaled_game(_with_thrust(game, to), units)
        raised = _polished(scaled, node.vector, node.duration, scaled.radius)
        if raised is None:
            step *= 0.5
            continue
        node, done = raised, to
    if done < 1.0:
        return None
    fine = _polished(scaled_game(game, units), node.vector, node.duration, node.distance)
    return None if fine is None else _capture(game, units, fine)


def _with_thrust(game: Game, share: float) -> Game:
    return replace(game, evader=replace(game.evader, thrust_n=share * game.evader.thrust_n))


def solve_by_linear_game(game: Game) -> Capture | None:
    """Solve a `game` from the solution of its linear game about the pursuer's circular orbit.

    Returns a local saddle; earlier captures are not excluded. The relative state is curvilinear, with the arc as the
    coordinate along the motion, so that the linear game remains close to the true one over long distances. Its duration
    and direction are the guess; the ends of both sides are computed by continuation in the duration.
    """
    scaled = scaled_game(game)
    guess = _linear_guess(game, scaled)
    if guess is None or guess[0] >= scaled.latest:
        return None
    duration, nu = guess
    pursuer, evader = (_reached(craft, nu, duration) for craft in (scaled.pursuer, scaled.evader))
    if pursuer is None or evader is None:
        return None
    fine = _polished(scaled, np.concatenate([pursuer, evader, nu]), duration, scaled.radius)
    return None if fine is None else _capture(game, scaled.units, fine)


def _linear_guess(game: Game, scaled: ScaledGame) -> tuple[float, Floats] | None:
    """Return duration and direction of the linear game, nondimensional, in the inertial frame."""
    units, p, e = scaled.units, scaled.pursuer.start, scaled.evader.start
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
        capture = circular_orbit_capture(
            offset,
            drift,
            game.pursuer.acceleration_m_s2 / force,
            game.evader.acceleration_m_s2 / force,
            1.0,
            longest_s=min(_LONGEST, scaled.latest),
        )
    except LinearGameError:  # there is no guess then
        return None
    if capture is None:
        return None
    coast = steered_path(scaled.pursuer, Policy.COAST.direction, capture.time_s).state_at(capture.time_s)[0]
    return capture.time_s, np.asarray(orbital_axes(coast[None, :3], coast[None, 3:])[0].T @ capture.direction)


def _reached(craft: Craft, nu: Floats, duration: float) -> Floats | None:
    """Return the end state of a craft's extremal along nu, by continuation in the duration from zero."""
    time = min(0.01, duration)
    state, step = craft.ballistic(time, nu), _REACH_STEP
    slope: Floats | None = None
    for _ in range(_MAX_REACH_STEPS):
        to = time if slope is None else min(duration, time + step)
        guess = state if slope is None else state + (to - time) * slope
        end = end_along(craft, guess, nu, to)
        if end is None:
            if slope is None or step < 1e-4:
                return None
            step *= 0.4
            continue
        state, slope, time, step = end.state, end.response.by_time, to, min(2.0 * step, _REACH_STEP)
        if time >= duration:
            return state
    return None
