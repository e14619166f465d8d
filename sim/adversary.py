"""Search for the start, the measurement errors and the target's accelerations with the maximum miss of a strategy.

A simulated miss is a lower bound of what the strategy can guarantee. It does not prove that no greater one exists.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from guidance import Strategy, TieRule, make_strategy
from guidance.scripted_noise import ScriptedNoise
from infoset import StateBox
from infoset.arrays import Floats
from infoset.limits import COUNT, WHOLE
from sim.closed_form import worst_shift_m
from sim.draws import Draws, draw
from sim.engagement import Engagements
from sim.first_plans import FirstPlans
from sim.plan_changes import PlanChanges
from sim.planned_flights import Flown, PlannedNoise, PlannedTarget, Plans, PlanSpace, by_axis
from sim.record import Record, fly_one
from sim.results import Outcome
from sim.scenario import Scenario, with_strategy
from sim.target import GivenTarget, constant_side

WORST_FOUND = "worst-found"
"""Name of the noise with the errors that a search found, in records."""
CHUNK = 50
"""Engagements in a batch."""
GENERATION = 100
"""Engagements between two selections."""
ELITE = 24
"""Number of plans with the maximum values so far that are changed further."""
LINEAGE_SHARE = 6
"""Maximum number of the elite that comes from one first plan in the first part of the search."""
YOUNG_SHARE = 0.5
"""Share of the budget that is the first part of the search."""
FIRST_SHARE = 0.25
"""Share of the budget for first plans."""


class Objective(Enum):
    """What a search maximises: the value of an engagement."""

    ANY_STATE = "any-state"
    """The maximum miss of a state that the set contained when control ended for its label (`sim.label_ends`).

    All these states agree with what was measured until then, so that the truth can be chosen among them afterwards. The
    sections contain at least all states that agree with the measurements. Where the set became empty, the miss of the
    simulated truth counts.
    """
    FIXED_TRUTH = "fixed-truth"
    """The miss of the simulated true state."""


class NothingCountsError(ValueError):
    """In every engagement of a search the set became empty, or the miss was not finite."""


@dataclass(frozen=True)
class WorstEngagement:
    """The engagement with the maximum miss of a search.

    Parameters
    ----------
    scenario : Scenario
        Scenario of the search, with the start of this engagement as its dispersion.
    objective : Objective
        What the search maximised.
    any_state_miss_m : float
        Maximum miss of a state that the set contained when control ended for its label, m.
    miss_m : float
        Miss of the simulated true state, m.
    truth_kept : bool
        Whether the true state was inside its section after every measurement.
    position_m, velocity_m_s : ndarray, shape (2,) or (3,)
        Start: (z, x) and (V_z, V_x); (y, z, x) and (V_y, V_z, V_x) in space.
    errors : mapping of str to ndarray, shape (C, steps), for ranges (steps,)
        Measurement errors by sensor in units of their bounds, zero where nothing was measured. `ScriptedNoise` with
        these errors repeats the engagement, bit for bit.
    accelerations_m_s2 : ndarray, shape (C, steps), or None
        Accelerations of the target, m/s^2. None if the target is that of the scenario.
    max_acceleration_m_s2 : mapping of str to float
        Maximum acceleration of the searched targets by lateral axis, m/s^2; empty if the target is that of the
        scenario.
    construction : str
        Kind of the first plan from which the engagement was derived.
    sets_emptied : int
        Number of simulated engagements whose set became empty. If it is zero, `keep_set` makes no difference.
    lateral_miss_m : mapping of str to float
        Position at the closest approach by lateral axis, m.
    history : tuple of (int, float)
        Evaluations and maximum value so far, m, at each increase.
    """

    scenario: Scenario
    seed: int
    strategy: str
    objective: Objective
    any_state_miss_m: float
    miss_m: float
    outcome: Outcome
    truth_kept: bool
    position_m: Floats
    velocity_m_s: Floats
    errors: Mapping[str, Floats]
    accelerations_m_s2: Floats | None
    max_acceleration_m_s2: Mapping[str, float]
    construction: str
    changes: int
    evaluations: int
    sets_emptied: int
    lateral_miss_m: Mapping[str, float]
    history: tuple[tuple[int, float], ...]

    @property
    def value_m(self) -> float:
        """What the search maximised, m."""
        return self.any_state_miss_m if self.objective is Objective.ANY_STATE else self.miss_m

    def noise(self) -> ScriptedNoise:
        """Return the errors as the noise of a batch of one."""
        return ScriptedNoise({name: errors[..., None, :] for name, errors in self.errors.items()})

    def target(self) -> GivenTarget | None:
        """Return the accelerations as the target of a batch of one; None if the target is that of the scenario."""
        given = self.accelerations_m_s2
        return None if given is None else GivenTarget(given[..., None, :])

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
        record = fly_one(self.scenario, seed=self.seed, strategy=strategy, noise=self.noise(), target=self.target())
        return replace(record, noise=WORST_FOUND)


def find_worst(
    scenario: Scenario,
    *,
    strategy: Strategy | str | None = None,
    objective: Objective = Objective.ANY_STATE,
    budget: int = 5000,
    seed: int = 0,
    keep_set: bool = False,
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> WorstEngagement:
    """Search possible starts, errors within their bounds, and accelerations of the target, for the maximum miss.

    Parameters
    ----------
    scenario : Scenario
        The search covers all starts in `set_model.bounds` (B x D), not only its dispersion.
    strategy : Strategy, str or None
        A strategy of your own, the name of a registered one, or None for the scenario's.
    objective : Objective
        Which miss is maximised: that of any state of the set, or that of the simulated truth.
    budget : int
        Number of engagements to simulate; the plans of a quarter of them are in memory at a time.
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
    NothingCountsError
        If in every simulated engagement the set became empty, or the miss was not finite.

    Notes
    -----
    A quarter of the budget is for first plans: game noise with its four tie rules and, before a cut-off or
    scheduled impulses, its shift; noise that keeps the upper or the lower extreme in a random or blockwise order,
    constant and extremal errors, and errors that show the middle between the true motion and one with the same
    measurements. The plans with the maximum misses are then changed, by a few steps, blocks, switching times or
    coordinates of the start, and compete with their changes. In the first part of the search, the number of plans
    from one first plan is limited. In space, both axes have errors of their own, and a change of the angle errors
    is along one axis or both.

    In the guaranteed model the targets accelerate at the bound of the model, `set_model.disturbance_m_s2`, with signs
    that belong to the plan: constant, in blocks, or that of the true predicted miss. They replace the target of the
    scenario; if its acceleration is greater than the bound, they accelerate as much. In the model `paper` the bound is
    fictitious, and the target is that of the scenario.

    References
    ----------
    Kumkov and Patsko (1997), section 7, for the rule of the game noise.
    """
    COUNT.need("budget", budget)
    COUNT.need("threads", threads)
    WHOLE.need("seed", seed)
    search = _Search(*with_strategy(scenario, strategy), Objective(objective), seed, keep_set)
    with ThreadPoolExecutor(threads) as pool:
        try:
            search.run(budget, pool, progress)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return search.worst()


class _Search:
    """A search in progress."""

    def __init__(
        self, scenario: Scenario, strategy: Strategy | None, objective: Objective, seed: int, keep_set: bool
    ) -> None:
        self.scenario = replace(scenario, dispersion=scenario.set_model.bounds, covariance=None)
        self.evaluations = self.sets_emptied = 0
        self.history: list[tuple[int, float]] = []
        self._objective, self._seed, self._keep_set = objective, seed, keep_set
        self._strategy = strategy or make_strategy(scenario.strategy)
        self._strategy_name = scenario.strategy if strategy is None else type(strategy).__name__
        self._shift_m = worst_shift_m(scenario)
        # All other random numbers are those of run 0, so that the worst engagement can be repeated alone.
        self._draws = draw(self.scenario, [0], seed)
        self._space = PlanSpace.of(self.scenario, self._draws.steps)
        random = np.random.default_rng(seed)
        self._first_plans, self._changes = FirstPlans(self._space, random), PlanChanges(self._space, random)
        self._elite: Flown | None = None

    def run(self, budget: int, pool: ThreadPoolExecutor, progress: Callable[[float], None] | None) -> None:
        first = self._first_plans.make(max(1, round(FIRST_SHARE * budget)))
        flights = [chunk for plans, tie in first for chunk in _in_chunks(plans, tie)]
        while flights:
            for outcomes in pool.map(lambda flight: self._fly(*flight), flights):
                self._select(outcomes, young=self.evaluations < YOUNG_SHARE * budget)
                if progress is not None:
                    progress(self.evaluations / budget)
            size = min(GENERATION, budget - self.evaluations)
            assert self._elite is not None
            flights = _in_chunks(self._changes.children(self._elite, size), None) if size > 0 else []

    def worst(self) -> WorstEngagement:
        elite = self._elite
        if elite is None or not np.isfinite(elite.value[0]):
            raise NothingCountsError("in every simulated engagement the set became empty, or the miss was not finite")
        start = elite.plans.start[0]
        ends = {name: (value, value) for name, value in zip(state_names(self.scenario), start.tolist(), strict=True)}
        position_m, velocity_m_s = np.split(start, 2)
        errors = {
            name: by_axis(elite.errors[:1, row], self.scenario.sensors.get(name))[..., 0, :]
            for row, name in enumerate(self._space.names)
        }
        maximum: dict[str, float] = {}
        if self._space.has_accelerations:
            maximum = dict(zip(self.scenario.set_model.axes, self._space.acceleration_m_s2.tolist(), strict=True))
        return WorstEngagement(
            scenario=replace(self.scenario, dispersion=StateBox(**ends)),
            seed=self._seed,
            strategy=self._strategy_name,
            objective=self._objective,
            any_state_miss_m=float(elite.any_state_miss_m[0]),
            miss_m=float(elite.miss_m[0]),
            outcome=elite.outcomes[0],
            truth_kept=bool(elite.truth_kept[0]),
            position_m=position_m,
            velocity_m_s=velocity_m_s,
            errors=errors,
            accelerations_m_s2=by_axis(elite.accelerations_m_s2[:1])[..., 0, :] if maximum else None,
            max_acceleration_m_s2=maximum,
            construction=self._first_plans.constructions[int(elite.plans.lineage[0])],
            changes=int(elite.plans.changes[0]),
            evaluations=self.evaluations,
            sets_emptied=self.sets_emptied,
            lateral_miss_m=dict(zip(self.scenario.set_model.axes, elite.lateral_miss_m[0].tolist(), strict=True)),
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
        side, planned = constant_side(self.scenario.target, target), None
        if self._space.has_accelerations:
            planned = PlannedTarget(plans, self._space.acceleration_m_s2)
            side = by_axis(plans.sides[:, :, 0])  # of game noise, whose targets keep it
        noise = PlannedNoise(plans, tie, self._space.names, self._shift_m, side)
        flight = Engagements(self.scenario, draws, self._strategy, noise=noise, target=planned, guarantee=False)
        while flight.flying:
            flight.advance()
        results = flight.results(np.arange(size))
        any_state_m = flight.any_state_miss_m(results)
        value = any_state_m if self._objective is Objective.ANY_STATE else results.miss_m
        counts = np.isfinite(value) & ~(self._keep_set & results.set_emptied)
        if tie is not None:  # the errors of the game become the plan
            plans.sequence[:], plans.prescribed[:] = noise.errors, True
        return Flown(
            plans,
            value=np.where(counts, value, -np.inf),
            miss_m=results.miss_m,
            any_state_miss_m=any_state_m,
            errors=noise.errors,
            accelerations_m_s2=np.zeros_like(plans.sides) if planned is None else planned.accelerations_m_s2,
            outcomes=np.array(results.outcomes, dtype=object),
            set_emptied=results.set_emptied,
            truth_kept=results.truth_kept,
            lateral_miss_m=results.lateral_miss_m,
        )

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
        maximum = float(self._elite.value[0])
        if np.isfinite(maximum) and (not self.history or maximum > self.history[-1][1]):
            self.history.append((self.evaluations, maximum))


def state_names(scenario: Scenario) -> list[str]:
    """Return the names of the coordinates of a start in their order: `StateBox` has them."""
    axes = (*scenario.set_model.axes, "x")
    return [*(f"{axis}_m" for axis in axes), *(f"v{axis}_m_s" for axis in axes)]


def _in_chunks(plans: Plans, tie: TieRule | None) -> list[tuple[Plans, TieRule | None]]:
    """Split plans into equal parts of at most `CHUNK`."""
    parts = np.array_split(np.arange(len(plans)), -(-len(plans) // CHUNK))
    return [(plans.take(part), tie) for part in parts]
