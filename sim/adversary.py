"""Search for the start and the measurement errors with the greatest miss of a strategy.

The miss found is a lower bound of what the strategy can guarantee. It does not prove that no greater one exists.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from guidance import Strategy, TieRule, make_strategy
from guidance.scripted_noise import ScriptedNoise
from infoset import StateBox
from infoset.arrays import Floats
from infoset.limits import COUNT, WHOLE
from sim.closed_form import worst_shift_m
from sim.draws import Draws, corners, draw
from sim.engagement import Engagements
from sim.planned_flights import ANGLE, ROWS, Flown, PlannedNoise, Plans, by_axis
from sim.record import Record, fly_one
from sim.results import Outcome
from sim.scenario import Scenario, with_strategy
from sim.target import constant_side

WORST_FOUND = "worst-found"
"""Name of the noise with the errors that a search found, in records."""
CHUNK = 50
"""Engagements in a batch."""
GENERATION = 100
"""Engagements between two selections."""
ELITE = 24
"""Number of plans with the greatest misses so far that are changed further."""
LINEAGE_SHARE = 6
"""Greatest number of the elite that comes from one first plan in the first part of the search."""
YOUNG_SHARE = 0.5
"""Share of the budget that is the first part of the search."""
FIRST_SHARE = 0.25
"""Share of the budget for first plans."""
MOST_ERRORS = 1e8
"""Greatest number of errors in the first plans, of 8 bytes each."""
MOST_CHANGES = 3
"""Greatest number of changes from a plan to the next."""
LATE_STEPS = 12.0
"""Mean distance from the end, in steps, of the changes near the end."""

UPPER, LOWER = 1.0, -1.0


class NothingCountsError(ValueError):
    """In every engagement of a search the set became empty, or the miss was not finite."""


class BudgetError(ValueError):
    """The first plans of a search need too much memory."""


@dataclass(frozen=True)
class WorstEngagement:
    """The engagement with the greatest miss of a search.

    Parameters
    ----------
    scenario : Scenario
        Scenario of the search, with the start of this engagement as its dispersion.
    truth_kept : bool
        Whether the true state was inside its section after every measurement.
    position_m, velocity_m_s : ndarray, shape (2,) or (3,)
        Start: (z, x) and (V_z, V_x); (y, z, x) and (V_y, V_z, V_x) in space.
    errors : mapping of str to ndarray, shape (steps,)
        Measurement errors by sensor in units of their bounds, zero where nothing was measured; shape (2, steps), along
        y and z, for a sensor that measures both axes. `ScriptedNoise` with these errors repeats the engagement, bit for
        bit.
    construction : str
        Kind of the first plan from which the engagement was derived.
    sets_emptied : int
        Number of simulated engagements whose set became empty. If it is zero, `keep_set` makes no difference.
    lateral_miss_m : mapping of str to float
        Position at the closest approach by lateral axis, y and z, m; empty in a plane.
    history : tuple of (int, float)
        Evaluations and greatest miss so far, m, at each increase.
    """

    scenario: Scenario
    seed: int
    strategy: str
    miss_m: float
    outcome: Outcome
    truth_kept: bool
    position_m: Floats
    velocity_m_s: Floats
    errors: Mapping[str, Floats]
    construction: str
    changes: int
    evaluations: int
    sets_emptied: int
    lateral_miss_m: Mapping[str, float]
    history: tuple[tuple[int, float], ...]

    def noise(self) -> ScriptedNoise:
        """Return the errors as the noise of a batch of one."""
        return ScriptedNoise({name: errors[..., None, :] for name, errors in self.errors.items()})

    def start(self) -> dict[str, float]:
        """Return the start by the names of `StateBox`: z_m, x_m, vz_m_s, vx_m_s; in space also y_m, vy_m_s."""
        names = state_names(self.scenario)
        return dict(zip(names, [*self.position_m.tolist(), *self.velocity_m_s.tolist()], strict=True))

    def record(self, strategy: Strategy | None = None) -> Record:
        """Simulate the engagement again and return its record.

        Parameters
        ----------
        strategy : Strategy or None
            None is the scenario's. A strategy different from that of the search has a different miss.
        """
        return replace(fly_one(self.scenario, seed=self.seed, strategy=strategy, noise=self.noise()), noise=WORST_FOUND)


def find_worst(
    scenario: Scenario,
    *,
    strategy: Strategy | str | None = None,
    budget: int = 5000,
    seed: int = 0,
    keep_set: bool = False,
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> WorstEngagement:
    """Search possible starts, and errors within their bounds, for the greatest true miss.

    Parameters
    ----------
    scenario : Scenario
        The search covers all starts in `set_model.bounds` (B x D), not only its dispersion.
    strategy : Strategy, str or None
        A strategy of your own, the name of a registered one, or None for the scenario's.
    budget : int
        Number of engagements to simulate.
    seed : int
        Root seed. The same seed and budget give the same engagement for any number of threads.
    keep_set : bool
        Count only engagements whose set never became empty. In the model `paper` a set can become empty at the start;
        then nothing is corrected, and the miss says nothing about the strategy.
    progress : callable or None
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    TypeError, ValueError
        If the budget or the number of threads is not an integer from 1, or the seed not one from 0.
    BudgetError
        If the first plans of so many steps need too much memory.
    NothingCountsError
        If in every simulated engagement the set became empty, or the miss was not finite.

    Notes
    -----
    A quarter of the budget is for first plans: game noise with its four tie rules and, before a cut-off or
    scheduled impulses, its shift; noise that keeps the upper or the lower extreme in a random or blockwise order,
    constant and extremal errors, and errors that show the middle between the true motion and one with the same
    measurements. The plans with the greatest misses are then changed, by a few steps, blocks, switching times or
    coordinates of the start, and compete with their changes. In the first part of the search, the number of plans
    from one first plan is limited. In space, both axes have errors of their own, and a change of the angle errors
    is along one axis or both.

    References
    ----------
    Kumkov and Patsko (1997), section 7, for the rule of the game noise.
    """
    COUNT.need("budget", budget)
    COUNT.need("threads", threads)
    WHOLE.need("seed", seed)
    search = _Search(*with_strategy(scenario, strategy), seed, keep_set)
    search.check_memory(budget)
    with ThreadPoolExecutor(threads) as pool:
        try:
            search.run(budget, pool, progress)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return search.worst()


class _Search:
    """A search in progress."""

    def __init__(self, scenario: Scenario, strategy: Strategy | None, seed: int, keep_set: bool) -> None:
        self.scenario = replace(scenario, dispersion=scenario.set_model.bounds)
        self.evaluations = self.sets_emptied = 0
        self.history: list[tuple[int, float]] = []
        self._seed, self._keep_set = seed, keep_set
        self._strategy = strategy or make_strategy(scenario.strategy)
        self._strategy_name = scenario.strategy if strategy is None else type(strategy).__name__
        self._shift_m = worst_shift_m(scenario)
        self._lower, self._upper = corners(scenario.set_model.bounds)
        self._random = np.random.default_rng(seed)
        # All other random numbers are those of run 0, so that the worst engagement can be repeated alone.
        self._draws = draw(self.scenario, [0], seed)
        self._steps = self._draws.steps
        self._names = tuple(dict.fromkeys((*ROWS, *scenario.sensors)))
        self._axes = len(scenario.set_model.axes)
        self._constructions: list[str] = []
        self._elite: Flown | None = None

    def check_memory(self, budget: int) -> None:
        """Raise BudgetError if the first plans of a budget have more than `MOST_ERRORS` errors."""
        most = int(MOST_ERRORS / (FIRST_SHARE * len(self._names) * self._axes * self._steps))
        if budget > most:
            raise BudgetError(
                f"budget must be at most {most} for flights of {self._steps} steps, because the search keeps its first "
                f"plans in memory: got {budget}"
            )

    def run(self, budget: int, pool: ThreadPoolExecutor, progress: Callable[[float], None] | None) -> None:
        flights = self._first_plans(max(1, round(FIRST_SHARE * budget)))
        while flights:
            for outcomes in pool.map(lambda flight: self._fly(*flight), flights):
                self._select(outcomes, young=self.evaluations < YOUNG_SHARE * budget)
                if progress is not None:
                    progress(self.evaluations / budget)
            size = min(GENERATION, budget - self.evaluations)
            flights = _in_chunks(self._children(size), None) if size > 0 else []

    def worst(self) -> WorstEngagement:
        elite = self._elite
        if elite is None or not np.isfinite(elite.value[0]):
            raise NothingCountsError("in every simulated engagement the set became empty, or the miss was not finite")
        start = elite.plans.start[0]
        ends = {name: (value, value) for name, value in zip(state_names(self.scenario), start.tolist(), strict=True)}
        position_m, velocity_m_s = np.split(start, 2)
        errors = {
            name: by_axis(elite.errors[:1, row], self.scenario.sensors.get(name))[..., 0, :]
            for row, name in enumerate(self._names)
        }
        return WorstEngagement(
            scenario=replace(self.scenario, dispersion=StateBox(**ends)),
            seed=self._seed,
            strategy=self._strategy_name,
            miss_m=float(elite.value[0]),
            outcome=elite.outcomes[0],
            truth_kept=bool(elite.truth_kept[0]),
            position_m=position_m,
            velocity_m_s=velocity_m_s,
            errors=errors,
            construction=self._constructions[int(elite.plans.lineage[0])],
            changes=int(elite.plans.changes[0]),
            evaluations=self.evaluations,
            sets_emptied=self.sets_emptied,
            lateral_miss_m=(
                dict(zip("yz", elite.lateral_miss_m[0].tolist(), strict=True)) if self.scenario.is_spatial else {}
            ),
            history=tuple(self.history),
        )

    def _fly(self, plans: Plans, tie: TieRule | None) -> Flown:
        size = len(plans)
        position_m, velocity_m_s = (part.copy() for part in np.split(plans.start, 2, axis=1))
        of_draws = self._draws.execution, self._draws.target, self._draws.pointing, self._draws.images
        execution, target, pointing, images = (
            None if drawn is None else np.repeat(drawn, size, axis=-2) for drawn in of_draws
        )
        tie_draws = np.repeat(self._draws.tie, size, axis=-2)
        draws = Draws(position_m, velocity_m_s, {}, tie_draws, execution, target, pointing, images=images)
        noise = PlannedNoise(plans, tie, self._names, self._shift_m, constant_side(self.scenario.target, target))
        flight = Engagements(self.scenario, draws, self._strategy, noise=noise, guarantee=False)
        while flight.flying:
            flight.advance()
        results = flight.results(np.arange(size))
        outcomes = np.array(results.outcomes, dtype=object)
        counts = np.isfinite(results.miss_m) & ~(self._keep_set & results.set_emptied)
        if tie is not None:  # the errors of the game become the plan
            plans.sequence[:], plans.prescribed[:] = noise.errors, True
        value = np.where(counts, results.miss_m, -np.inf)
        lateral = results.lateral_miss.filled(np.nan)
        return Flown(plans, value, noise.errors, outcomes, results.set_emptied, results.truth_kept, lateral)

    def _select(self, outcomes: Flown, young: bool) -> None:
        """Update the elite and the history with new flights."""
        self.evaluations += len(outcomes.value)
        self.sets_emptied += int(outcomes.set_emptied.sum())
        rivals = outcomes if self._elite is None else self._elite.join(outcomes)
        order = np.argsort(-rivals.value, kind="stable")
        kept: list[int] = []
        of_lineage: dict[int, int] = {}
        for index in order.tolist():
            lineage = int(rivals.plans.lineage[index])
            same = bool(kept) and rivals.value[index] == rivals.value[kept[-1]]
            full = young and of_lineage.get(lineage, 0) >= LINEAGE_SHARE
            if not same and not full:
                kept.append(index)
                of_lineage[lineage] = of_lineage.get(lineage, 0) + 1
            if len(kept) == ELITE:
                break
        self._elite = rivals.take(np.array(kept))
        greatest = float(self._elite.value[0])
        if np.isfinite(greatest) and (not self.history or greatest > self.history[-1][1]):
            self.history.append((self.evaluations, greatest))

    def _first_plans(self, count: int) -> list[tuple[Plans, TieRule | None]]:
        """Return `count` first plans, in equal numbers for each construction."""
        makers: list[tuple[str, TieRule | None, Callable[[int, Floats], tuple[Floats, bool]]]] = [
            *((f"game noise, tie {tie.value}", tie, self._coins) for tie in TieRule),
            ("extremes kept in random order", None, self._coins),
            ("extremes kept in blocks", None, self._blocks),
            ("extremal errors in blocks", None, self._extremal),
            ("constant bias", None, self._constant),
            ("middle of a pair", None, self._pair),
        ]
        shares = [len(part) for part in np.array_split(np.arange(count), len(makers))]
        plans: list[tuple[Plans, TieRule | None]] = []
        for (name, tie, maker), share in zip(makers, shares, strict=True):
            if share == 0:
                continue
            start = self._starts(share)
            angle, prescribed = maker(share, start)
            others = np.repeat(
                self._random.choice([-1.0, 0.0, 1.0], (share, len(self._names) - 1, self._axes, 1)), self._steps, axis=3
            )
            sequence = np.concatenate([angle[:, None], others], axis=1)
            lineage = len(self._constructions) + np.arange(share)
            self._constructions += [name] * share
            none = np.zeros(share, dtype=np.int64)
            all_steps = np.full((share, self._steps), prescribed)
            plans += _in_chunks(Plans(start, sequence, all_steps, lineage, none), tie)
        return plans

    def _starts(self, count: int) -> Floats:
        """Return starts in B x D; in a quarter of them, some coordinates are at an end of their interval."""
        share = self._random.random((count, len(self._lower)))
        at_end = (self._random.random(share.shape) < 0.5) & (self._random.random((count, 1)) < 0.5)
        return self._lower + (self._upper - self._lower) * np.where(at_end, np.round(share), share)

    def _coins(self, count: int, start: Floats) -> tuple[Floats, bool]:
        return self._random.choice([LOWER, UPPER], (count, self._axes, self._steps)), False

    def _blocks(self, count: int, start: Floats) -> tuple[Floats, bool]:
        one = (count, self._axes, 1)
        switches = self._random.random((*one[:2], self._steps)) < 10.0 ** self._random.uniform(-2.5, -0.5, one)
        return self._random.choice([LOWER, UPPER], one) * (-1.0) ** np.cumsum(switches, axis=2), False

    def _extremal(self, count: int, start: Floats) -> tuple[Floats, bool]:
        return self._blocks(count, start)[0], True

    def _constant(self, count: int, start: Floats) -> tuple[Floats, bool]:
        return np.repeat(self._random.uniform(-1.0, 1.0, (count, self._axes, 1)), self._steps, axis=2), True

    def _pair(self, count: int, start: Floats) -> tuple[Floats, bool]:
        """Return errors that show the middle between the true motion and another straight one.

        Shortly before the end the two are two bounds apart and can be distinguished; after that the measurements are
        exact. In space, the two differ along both axes.
        """
        model = self.scenario.set_model
        step_s = model.step_s
        x, closing = _range_m(start)[:, None, None], -start[:, -1, None, None]
        ranges = np.maximum(x - closing * step_s * np.arange(self._steps), 0.0)
        bound = ranges * np.concatenate(
            [model.angle_sensor.axis(axis).error_bound(ranges) for axis in model.axes], axis=1
        )
        time_left = self._random.uniform(1.0, 12.0, (count, 1, 1)) * step_s
        apart_at = np.clip(np.round((x / closing - time_left) / step_s), 1, self._steps - 1).astype(int)
        begin = self._random.uniform(-1.0, 1.0, (count, self._axes, 1)) * bound[..., :1]
        end = self._random.choice([-1.0, 1.0], (count, self._axes, 1)) * np.take_along_axis(
            bound, np.repeat(apart_at, self._axes, axis=1), axis=2
        )
        half = begin + (end - begin) * np.arange(self._steps) / apart_at
        errors = np.divide(half, bound, out=np.zeros_like(half), where=bound > 0.0)
        return np.where(np.arange(self._steps) <= apart_at, np.clip(errors, -1.0, 1.0), 0.0), True

    def _children(self, count: int) -> Plans:
        """Return changed plans of the elite; plans with a greater miss are chosen more often."""
        elite = self._elite
        if elite is None:
            raise RuntimeError("no plan has been simulated yet")
        ranks = np.floor(len(elite.value) * self._random.random(count) ** 2).astype(np.int64)
        plans = elite.plans.take(ranks)
        for i in range(count):
            for _ in range(int(self._random.integers(1, MOST_CHANGES + 1))):
                change = self._CHANGES[int(self._random.integers(len(self._CHANGES)))]
                change(self, plans, i)
        plans.changes[:] += 1
        return plans

    def _last_step(self, plans: Plans, i: int) -> int:
        """Return the last step before the closest approach of a start, plus one."""
        x, vx = float(_range_m(plans.start[i])), float(plans.start[i, -1])
        return min(self._steps - 1, int(x / (-vx * self.scenario.set_model.step_s)) + 1)

    def _step(self, plans: Plans, i: int) -> int:
        """Return a random step: anywhere or near the end, with equal probability."""
        last = self._last_step(plans, i)
        if self._random.random() < 0.5:
            return int(self._random.integers(last + 1))
        return max(0, last - int(self._random.exponential(LATE_STEPS)))

    def _span(self, plans: Plans, i: int) -> slice:
        """Return a random block of steps; short ones are more frequent."""
        begin = self._step(plans, i)
        return slice(begin, begin + 1 + int(10.0 ** self._random.uniform(0.0, 2.0)))

    def _angle_errors(self, plans: Plans, i: int) -> Floats:
        """Return the errors of the angles along one axis or both, a view of shape (1 or 2, steps)."""
        first, end = (0, 1) if self._axes == 1 else ((0, 1), (1, 2), (0, 2))[int(self._random.integers(3))]
        return np.asarray(plans.sequence[i, ANGLE, first:end])

    def _flip_step(self, plans: Plans, i: int) -> None:
        self._angle_errors(plans, i)[:, self._step(plans, i)] *= -1.0

    def _flip_block(self, plans: Plans, i: int) -> None:
        self._angle_errors(plans, i)[:, self._span(plans, i)] *= -1.0

    def _move_switch(self, plans: Plans, i: int) -> None:
        """Move one switching time by a few steps; if both axes are moved, one of the first."""
        errors = self._angle_errors(plans, i)
        signs = np.sign(errors[0, : self._last_step(plans, i) + 1])
        switches = np.flatnonzero(np.diff(signs))
        if switches.size:
            at, by = int(self._random.choice(switches)), int(self._random.integers(1, 5))
            if self._random.random() < 0.5:
                errors[:, at + 1 : at + 1 + by] *= -1.0
            else:
                errors[:, max(0, at + 1 - by) : at + 1] *= -1.0

    def _roll(self, plans: Plans, i: int) -> None:
        """Move the whole plan by a few steps."""
        by = int(self._random.choice([-3, -2, -1, 1, 2, 3]))
        plans.sequence[i] = np.roll(plans.sequence[i], by, axis=-1)
        plans.prescribed[i] = np.roll(plans.prescribed[i], by)

    def _give_block(self, plans: Plans, i: int) -> None:
        """Prescribe the errors of a block, or let the noise keep extremes there."""
        span = self._span(plans, i)
        if plans.prescribed[i, span].all():
            plans.prescribed[i, span] = False
        else:
            plans.prescribed[i, span] = True
            anything = self._random.uniform(-1.0, 1.0)
            plans.sequence[i, ..., span] = self._random.choice(
                [-1.0, 0.0, 1.0, anything], (len(self._names), self._axes, 1)
            )

    def _move_error(self, plans: Plans, i: int) -> None:
        """Change the size of the prescribed errors of a block."""
        span = self._span(plans, i)
        moved = plans.sequence[i, ..., span] + 10.0 ** self._random.uniform(-2.0, 0.0) * self._random.normal(
            size=(len(self._names), self._axes, 1)
        )
        prescribed = plans.prescribed[i, span]
        plans.sequence[i, ..., span] = np.where(prescribed, np.clip(moved, -1.0, 1.0), plans.sequence[i, ..., span])

    def _cross(self, plans: Plans, i: int) -> None:
        """Replace the end of the plan by that of another plan of the elite."""
        elite = self._elite
        if elite is not None:
            other, begin = int(self._random.integers(len(elite.value))), self._step(plans, i)
            plans.sequence[i, ..., begin:] = elite.plans.sequence[other, ..., begin:]
            plans.prescribed[i, begin:] = elite.plans.prescribed[other, begin:]

    def _move_start(self, plans: Plans, i: int) -> None:
        """Move the start in some coordinates or in all, or set some coordinates to an end."""
        width = self._upper - self._lower
        which = self._random.random(len(width)) < self._random.choice([0.25, 1.0])
        moved = plans.start[i] + width * 10.0 ** self._random.uniform(-5.0, -0.5) * self._random.normal(size=len(width))
        if self._random.random() < 0.1:
            moved = np.where(self._random.random(len(width)) < 0.5, self._lower, self._upper)
        plans.start[i] = np.clip(np.where(which, moved, plans.start[i]), self._lower, self._upper)

    _CHANGES = (
        _flip_step,
        _flip_block,
        _move_switch,
        _roll,
        _give_block,
        _move_error,
        _cross,
        _move_start,
        _move_start,
        _move_start,
    )


def state_names(scenario: Scenario) -> list[str]:
    """Return the names of the coordinates of a start in their order: `StateBox` has them."""
    axes = (*scenario.set_model.axes, "x")
    return [*(f"{axis}_m" for axis in axes), *(f"v{axis}_m_s" for axis in axes)]


def _range_m(start: Floats) -> Floats:
    """Return the range x of starts, m; the last of the positions."""
    return np.asarray(start[..., start.shape[-1] // 2 - 1])


def _in_chunks(plans: Plans, tie: TieRule | None) -> list[tuple[Plans, TieRule | None]]:
    """Split plans into equal parts of at most `CHUNK`."""
    parts = np.array_split(np.arange(len(plans)), -(-len(plans) // CHUNK))
    return [(plans.take(part), tie) for part in parts]
