"""Feedback: a pursuer that solves the game repeatedly, against an evader with any steering."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._branch import MAX_WORK, Ending, follow
from infoset.rendezvous.pursuit_evasion._pair import FINE, ExtremalCraft, Node, Pair
from infoset.rendezvous.pursuit_evasion.game import Game, Units, scaled_game
from infoset.rendezvous.pursuit_evasion.paths import ExtremalPath, extremal_paths, steered_path
from infoset.rendezvous.pursuit_evasion.solution import CaptureSolution
from infoset.rendezvous.pursuit_evasion.solver import solve
from infoset.rendezvous.pursuit_evasion.steering import Steering

PathNow = Callable[[float], Floats]
"""State of a craft, shape (6,), nondimensional, by the time from the start of a leg."""

HIT_M = 100.0
"""Distance up to which the closest approach to a point counts as a capture. Chosen: in the last leg
the evader is not observed."""

_OUTPUT_TIMES = 65
"""Number of times in a leg at which the distance is computed, before its minimum or the first time
within the radius is refined. A capture between two of them is not seen. Chosen: `leo-pursuit` and
`geo-pursuit` end alike from 17 to 257, with and without errors of observation (measured)."""
_PAST = 1.05
"""Length of the last leg, if it is not a full one, relative to the time to the predicted capture:
it includes the closest approach.

Chosen: the pursuits of `_OUTPUT_TIMES` end alike from 1.0125 to 1.2 (measured).
"""
_WIDE = 2.0
"""Factor of the drift of a leg within which a capture is looked for: thrust adds to the drift.

Chosen: the pursuits of `_OUTPUT_TIMES` end alike from 0.5 to 8 (measured); a large one costs time.
"""
_PATIENCE = 1.0
"""Delay of the capture by a plan from scratch, relative to the time to the capture of the last
plan, up to which it replaces the last plan.

Chosen: the pursuits of `_OUTPUT_TIMES` end alike from 0.25 to 4 (measured).
"""
_MAX_PLANS = 10_000
"""Largest number of plans; chosen: five times the default of the command, `MAX_PLANS`."""
_LONGEST = 1e3
"""Longest game of a plan, in radians; chosen: above the longest duration of any game by default."""


@dataclass(frozen=True)
class Observation:
    """The pursuer's observation of the evader when it plans.

    `delay_s` is its age; the pursuer assumes that the evader has been optimal since. The errors are
    standard deviations of each component.
    """

    delay_s: float = 0.0
    position_error_m: float = 0.0
    velocity_error_m_s: float = 0.0

    @property
    def is_exact(self) -> bool:
        """Whether the pursuer observes the evader exactly."""
        return not any((self.delay_s, self.position_error_m, self.velocity_error_m_s))


class Ended(Enum):
    """How a flight ends."""

    CAPTURED = "captured"
    MISSED = "missed"
    """The last leg, without observation, passes farther than counts as a capture of a point."""
    PROPELLANT_EXHAUSTED = "propellant-exhausted"
    NO_PLAN = "no-plan"
    """The game could not be solved from the current states, or there were too many plans."""


@dataclass(frozen=True)
class PursuitFlight:
    """A pursuit with feedback.

    It ends at `time_s`, at the capture, at the closest approach or for another reason, at
    `distance_m`. At the times of the n plans, `planned_s`, which predict captures at `predicted_s`,
    the distances are `distances_m`, shape (n,).
    """

    ended: Ended
    time_s: float
    distance_m: float
    planned_s: Floats
    predicted_s: Floats
    distances_m: Floats


def fly(
    game: Game,
    steering: Steering | None,
    *,
    replan_s: float = 600.0,
    observation: Observation | None = None,
    seed: int | np.random.SeedSequence = 0,
    solution: CaptureSolution | None = None,
) -> PursuitFlight:
    """Simulate a pursuer that computes and follows a new plan at times `replan_s` apart.

    The default is some 150 plans in a revolution of a geostationary orbit; shorter games need less.

    `steering` steers the evader; None is optimal against the true state of the pursuer. No
    `observation` means that the evader is observed exactly; otherwise `seed` determines the errors.
    `solution` is the solution of the game, if it is known.

    Raises
    ------
    ValueError
        If the game has no capture and therefore no first plan, or `replan_s` is not positive and
        finite.
    PathError
        If the evader's path cannot be followed.

    Notes
    -----
    The first plan is the solution of the game, from the true states. Each later plan starts
    Newton's method at the previous one. A step costs 2 ms for the plan and, with a `steering`, 2 ms
    for the evader's path. The last leg is the one in which the plan predicts the capture: no plan
    is made in it. If the evader is not within the radius in it, a new plan follows. If Newton's
    method fails from the previous plan, the game is solved from scratch; the previous plan is kept
    if the capture would be much later.
    """
    if not 0.0 < replan_s < np.inf:
        raise ValueError("the time between plans must be positive")
    solution = solve(game) if solution is None else solution
    if solution.capture is None:
        raise ValueError(
            f"there is no first plan: the verdict of the game is {solution.verdict.value}"
        )
    units = solution.units
    seen = observation or Observation()
    random = np.random.default_rng(seed)
    flight = _Pursuit(game, units, steering, seen, random)
    return flight.run(solution.capture.extremal, replan_s / units.time_s)


class _Pursuit:
    """One pursuit in progress, nondimensional.

    `_past` has the start time and the evader's path, by the time from there, of each flown leg.
    `_log` has of each plan its time, the time of its predicted capture, and the position of the
    evader relative to the pursuer, shape (3,). `_dry` are the dry masses of pursuer and evader, and
    `_work` the radians left for plans from scratch.
    """

    def __init__(
        self,
        game: Game,
        units: Units,
        steering: Steering | None,
        observation: Observation,
        random: np.random.Generator,
    ) -> None:
        self._units = units
        self._steering = steering
        self._observation = observation
        self._random = random
        scaled = scaled_game(game, units)
        self._radius = scaled.radius
        self._pursuer = scaled.pursuer
        self._evader = scaled.evader
        self._hit = HIT_M / units.length_m
        self._dry = (
            game.pursuer.dry_mass_kg / units.mass_kg,
            game.evader.dry_mass_kg / units.mass_kg,
        )
        self._time = 0.0
        self._work = MAX_WORK
        self._past: list[tuple[float, PathNow]] = []
        self._log: list[tuple[float, float, Floats]] = []

    def run(self, plan: Node, leg: float) -> PursuitFlight:
        """Fly legs of a duration `leg`, each with a new plan, until the flight ends.

        `plan` is the pursuer's plan of the first leg, then of each one, from what it observes;
        `own` is the evader's, from the exact states, which it needs if it is optimal and the
        observation is not exact.
        """
        own = plan
        while len(self._log) < _MAX_PLANS:
            apart = self._evader.start[:3] - self._pursuer.start[:3]
            self._log.append((self._time, self._time + plan.duration, apart))
            # In the last leg the plan predicts the capture; `spell` is the duration of this leg.
            last = plan.duration <= leg
            spell = min(leg, plan.duration * _PAST) if last else leg
            if spell > _lasts(self._pursuer, self._dry[0]):
                return self._end(Ended.PROPELLANT_EXHAUSTED)
            pursuer = extremal_paths(self._pursuer, self._evader, plan)[0]
            evader, evader_mass = self._evader_path(own, spell)
            ended = self._end_in_leg(pursuer, evader, spell, last)
            if ended is not None:
                return ended

            self._past.append((self._time, evader))
            mass = self._pursuer.mass - self._pursuer.flow * spell
            self._pursuer = replace(self._pursuer, start=pursuer.at(spell)[:6], mass=mass)
            self._evader = replace(self._evader, start=evader(spell), mass=evader_mass)
            self._time += spell
            if self._steering is None and _lasts(self._evader, self._dry[1]) < spell:
                # As its plan, see `_plan`.
                self._evader = replace(self._evader, thrust=0.0, flow=0.0)

            planned = self._plan(plan, spell, self._seen(plan))
            if planned is None:
                return self._end(Ended.NO_PLAN)
            plan = planned
            if self._steering is not None or self._observation.is_exact:
                own = plan
            else:
                # Without a new plan the evader goes on with its last one, if need be past its end.
                going_on = replace(own, duration=own.duration - spell)
                own = self._plan(own, spell, self._evader) or going_on
        return self._end(Ended.NO_PLAN)

    def _plan(self, before: Node, spell: float, evader: ExtremalCraft) -> Node | None:
        """Solve the game from the current states, from the previous plan or from scratch.

        `before` is the plan of the leg that was flown, from its start, `spell` the duration of this
        leg, and `evader` the evader now, as its planner knows it. An evader whose propellant does
        not last another such leg coasts. The result is None if there is no plan.
        """
        if _lasts(evader, self._dry[1]) < spell:
            evader = replace(evader, thrust=0.0, flow=0.0)
        pair = Pair(self._pursuer, evader)
        latest = min(_lasts(self._pursuer, self._dry[0]), _lasts(evader, self._dry[1]), _LONGEST)

        kept: Node | None = None
        if before.duration > spell:
            kept = replace(before, duration=before.duration - spell)
            node = pair.solve(
                kept.vector,
                kept.duration,
                self._radius,
                time_free=True,
                tolerance=FINE,
                latest=latest,
            )
            if node is not None and node.is_saddle and node.closing > 0.0:
                return node
        # No game begins within the radius, where errors of observation can show the evader.
        if float(np.linalg.norm(evader.start[:3] - self._pursuer.start[:3])) <= self._radius:
            return kept

        afresh: Node | None = None
        first = pair.begin(latest, self._radius)
        if first is not None:
            branch = follow(pair, first, self._radius, latest, self._work)
            self._work -= branch.work
            if branch.ending is Ending.CAPTURE:
                afresh = branch.last
        # Near the end a point may be unreachable by metres: a near miss is better than another
        # revolution.
        if kept is not None and (
            afresh is None or afresh.duration > kept.duration + _PATIENCE * (kept.duration + spell)
        ):
            return kept
        return afresh

    def _evader_path(self, own: Node, spell: float) -> tuple[PathNow, float]:
        """Return the evader's path of a leg, and its mass at the end of it."""
        if self._steering is None:
            path = ExtremalPath(self._evader, own.evader, own.nu, own.duration)
            return (lambda time: path.at(time)[:6]), self._evader.mass - self._evader.flow * spell

        units = self._units
        begin = self._time
        steering = self._steering
        scale = np.repeat([units.length_m, units.speed_m_s], 3)
        # An evader whose propellant does not last the leg coasts in all of it.
        spent = self._evader.mass <= self._dry[1] + self._evader.flow * spell

        def direction(time: float, state: Floats) -> Floats:
            if spent:
                return np.zeros(3)
            return np.asarray(steering((begin + time) * units.time_s, state * scale))

        steered = steered_path(self._evader, direction, spell)
        mass = float(steered.solution(spell)[6])
        return (lambda time: np.asarray(steered.solution(time)[:6])), mass

    def _seen(self, plan: Node) -> ExtremalCraft:
        """Return the evader as the pursuer observes it now, at the end of a leg.

        `plan` is the pursuer's plan of this leg.
        """
        seen = self._observation
        if seen.is_exact:
            return self._evader

        # Before the start the evader was not observed.
        delay = min(seen.delay_s / self._units.time_s, self._time)
        state = self._evader.start
        if delay > 0.0:
            at = self._time - delay
            begin, path = next(leg for leg in reversed(self._past) if leg[0] <= at)
            state = path(at - begin)

        position_error = seen.position_error_m / self._units.length_m
        velocity_error = seen.velocity_error_m_s / self._units.speed_m_s
        errors = np.repeat([position_error, velocity_error], 3)
        state = state + errors * self._random.standard_normal(6)
        if delay > 0.0:
            # Since the observation the pursuer believes in full thrust in one direction, that at
            # the start of the leg in its plan: it turns slowly. A plan that was kept has that of an
            # earlier start.
            believed = plan.costates[1][3:]
            delayed = replace(self._evader, start=state)
            since = steered_path(delayed, lambda _time, _state: believed, delay)
            state = since.state_at(delay)[0]
        return replace(self._evader, start=state)

    def _end_in_leg(
        self, pursuer: ExtremalPath, evader: PathNow, spell: float, last: bool
    ) -> PursuitFlight | None:
        """Return the flight if it ends in the leg, else None.

        With a radius it ends when the distance reaches the radius: if that does not happen, not
        even the last leg ends the flight, and a new plan follows. Without a radius it ends in the
        last leg, at the closest approach.
        """
        if self._radius == 0.0 and not last:
            return None

        def distance(time: float) -> float:
            return float(np.linalg.norm(pursuer.at(time)[:3] - evader(time)[:3]))

        drift = spell * float(np.linalg.norm(self._pursuer.start[3:] - self._evader.start[3:]))
        if not last and min(distance(0.0), distance(spell)) - self._radius > _WIDE * drift:
            return None

        times = np.linspace(0.0, spell, _OUTPUT_TIMES)
        values = np.array([distance(time) for time in times])
        if self._radius > 0.0:
            inside = np.flatnonzero(values <= self._radius)
            if not len(inside):
                return None
            first = int(inside[0])
            at = 0.0
            if first:
                at = brentq(
                    lambda time: distance(time) - self._radius, times[first - 1], times[first]
                )
            return self._flight(Ended.CAPTURED, self._time + at, distance(at))

        # The last leg to a point: its closest approach.
        near = int(np.argmin(values))
        low = times[max(0, near - 1)]
        high = times[min(_OUTPUT_TIMES - 1, near + 1)]
        # A tolerance far below the times that are printed.
        at = float(
            minimize_scalar(
                distance, bounds=(low, high), method="bounded", options={"xatol": 1e-12}
            ).x
        )
        ended = Ended.CAPTURED if distance(at) <= self._hit else Ended.MISSED
        return self._flight(ended, self._time + at, distance(at))

    def _end(self, ended: Ended) -> PursuitFlight:
        apart = float(np.linalg.norm(self._pursuer.start[:3] - self._evader.start[:3]))
        return self._flight(ended, self._time, apart)

    def _flight(self, ended: Ended, time: float, distance: float) -> PursuitFlight:
        units = self._units
        planned, predicted, apart = (np.array(column) for column in zip(*self._log, strict=True))
        return PursuitFlight(
            ended=ended,
            time_s=time * units.time_s,
            distance_m=distance * units.length_m,
            planned_s=planned * units.time_s,
            predicted_s=predicted * units.time_s,
            distances_m=np.linalg.norm(apart, axis=1) * units.length_m,
        )


def _lasts(craft: ExtremalCraft, dry: float) -> float:
    """Return the duration of the propellant.

    It is 0.1 % less for a craft without dry mass, whose acceleration diverges; chosen.
    """
    if not craft.flow > 0.0:
        return np.inf
    share = 1.0 if dry > 0.0 else 0.999
    return share * (craft.mass - dry) / craft.flow
