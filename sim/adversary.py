"""Search for start, measurement errors and target accelerations with the maximum miss.

A simulated miss is a lower bound of what the strategy can guarantee. It does not prove that no
greater one exists.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from infoset.arrays import Floats
from infoset.guidance import GameNoise, LineOfSight, MeasurementNoise, Strategy, make_strategy
from infoset.guidance.scripted_noise import ScriptedNoise, errors_made, measure_with_errors
from infoset.information_set import InformationSetView
from infoset.limits import COUNT, WHOLE
from infoset.model import StateBox
from infoset.sensors import Measurements, Sensor
from infoset.sim.adversary_plans import Constructions, Planner, Plans, by_axis
from infoset.sim.closed_form import worst_shift_m
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.record import Record, fly_one
from infoset.sim.results import Results
from infoset.sim.scenario import Scenario, with_strategy
from infoset.sim.target import constant_side

WORST_FOUND = "worst-found"
"""Name of the noise with the errors that a search found, in records."""
CHUNK = 250
"""Maximum number of engagements in a batch. The overhead of a step equals the cost of 30 to 40
engagements (measured): with 250 it is small, and some batches remain for threads.
"""
# The numbers below are chosen: they decide how fast a search finds a miss, and not whether it is
# possible. In the tests' scenario of ten seconds, eight searches of 600 engagements find 25.1 m on
# average, with a standard deviation of 0.5 m. From a quarter to four times of each number the
# average changes by 0.1 m; with 0.06 or 0.9 for FIRST_SHARE it is 0.5 m smaller (measured).
GENERATION = 100
"""Engagements between two selections: a few times `ELITE`; chosen, see above."""
ELITE = 24
"""Number of plans with the maximum values so far that are changed further; chosen, see above."""
LINEAGE_SHARE = 6
"""Maximum number of the elite that comes from one first plan in the first part of the search: a
quarter, so that at least four first plans compete.
"""
YOUNG_SHARE = 0.5
"""Share of the budget that is the first part of the search; chosen, see above."""
FIRST_SHARE = 0.25
"""Share of the budget for first plans; chosen, see above."""


class Objective(Enum):
    """What a search maximises: the value of an engagement."""

    ANY_STATE = "any-state"
    """The maximum miss of a state of the set when control ended for its label (`label_ends.py`).

    All these states agree with what was measured until then, so that the truth can be chosen among
    them afterwards. The sections contain at least all states that agree with the measurements.
    Where the set became empty, the miss of the simulated truth counts.
    """
    FIXED_TRUTH = "fixed-truth"
    """The miss of the simulated true state."""


class NothingCountsError(ValueError):
    """No engagement of a search counts.

    In each the miss was not finite, or with `keep_set` the set became empty.
    """


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
    result : Results
        Results of the engagement, a batch of one.
    noise : ScriptedNoise
        Measurement errors, which repeat the engagement bit for bit.
    accelerations_m_s2 : ndarray, shape (C, 1, steps), or None
        Accelerations of the target, m/s^2; None for the target of the scenario.
    max_acceleration_m_s2 : mapping of str to float
        Maximum acceleration of the searched targets by lateral axis, m/s^2; empty for the target of
        the scenario.
    construction : str
        Kind of the first plan from which the engagement was derived.
    changes : int
        Number of plans from that one to the plan of this engagement; 0 for a first plan.
    evaluations : int
        Number of simulated engagements of the search.
    sets_emptied : int
        Number of simulated engagements whose set became empty. If it is zero, `keep_set` makes no
        difference.
    history : tuple of (int, float)
        Evaluations and maximum value so far, m, at each increase.
    """

    scenario: Scenario
    seed: int
    strategy: str
    objective: Objective
    any_state_miss_m: float
    result: Results
    noise: ScriptedNoise
    accelerations_m_s2: Floats | None
    max_acceleration_m_s2: Mapping[str, float]
    construction: str
    changes: int
    evaluations: int
    sets_emptied: int
    history: tuple[tuple[int, float], ...]

    @property
    def miss_m(self) -> float:
        """Miss of the simulated true state, m."""
        return float(self.result.miss_m[0])

    @property
    def value_m(self) -> float:
        """Miss that the search maximised, m."""
        return self.any_state_miss_m if self.objective is Objective.ANY_STATE else self.miss_m

    def start(self) -> dict[str, float]:
        """Return the start by the names of `StateBox`.

        They are z_m, x_m, vz_m_s and vx_m_s, in space also y_m and vy_m_s.
        """
        start = np.concatenate([self.result.position_m[0], self.result.velocity_m_s[0]])
        return start_of(self.scenario, start)

    def record(self, strategy: Strategy | None = None) -> Record:
        """Simulate the engagement again and return its record.

        Parameters
        ----------
        strategy : Strategy or None
            None is the scenario's. Another strategy than in the search has a different miss.
        """
        target = self.accelerations_m_s2
        record = fly_one(
            self.scenario, seed=self.seed, strategy=strategy, noise=self.noise, target_m_s2=target
        )
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
    """Search possible starts, errors and accelerations of the target for the maximum miss.

    Parameters
    ----------
    scenario : Scenario
        The search covers all starts in `set_model.bounds` (B x D), not only its dispersion.
    strategy : Strategy, str or None
        A strategy of your own, the name of a registered one, or None for the scenario's.
    objective : Objective
        Which miss is maximised: of any state of the set, or of the simulated truth.
    budget : int
        Number of engagements to simulate; the plans of a quarter of them are in memory at a time.
    seed : int
        Root seed. The same seed and budget give the same engagement for any number of threads.
    keep_set : bool
        Count only engagements whose set never became empty. In the model `paper` a set can become
        empty at the start; then nothing is corrected, and the miss says nothing about the strategy.
    progress : callable or None
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    TypeError, ValueError
        If the budget or the number of threads is not an integer from 1, or the seed not one from 0.
    NothingCountsError
        If in every simulated engagement the miss was not finite, or with `keep_set` the set became
        empty.

    Notes
    -----
    A quarter of the budget is for first plans: game noise with its four tie rules and, before a
    cut-off or scheduled impulses, its shift; and noise that keeps the upper or the lower extreme in
    a random or blockwise order. The plan stores these errors. The plans with the maximum misses are
    then changed, by blocks of errors, switching times or coordinates of the start, and compete with
    their changes. In the first part of the search, the number of plans from one first plan is
    limited. In space, each axis has its own errors, and a change of the angle errors is along one
    axis or both.

    In the guaranteed model the targets accelerate at the bound of the model,
    `set_model.disturbance_m_s2`, with signs that belong to the plan, constant or in blocks. They
    replace the target of the scenario; if its acceleration is greater than the bound, they
    accelerate as much. In the model `paper` the bound is fictitious, and the target accelerates as
    in the scenario.

    References
    ----------
    Kumkov and Patsko (1997), section 7, for the rule of the game noise.
    """
    COUNT.need("budget", budget)
    COUNT.need("threads", threads)
    WHOLE.need("seed", seed)
    search = _AdversarySearch(
        *with_strategy(scenario, strategy), Objective(objective), seed, keep_set
    )
    with ThreadPoolExecutor(threads) as pool:
        try:
            search.run(budget, pool, progress)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return search.worst()


class _AdversarySearch:
    """A search in progress."""

    guarantee = False
    """Whether flights compute Phi; no value that a search maximises uses it."""

    def __init__(
        self,
        scenario: Scenario,
        strategy: Strategy | None,
        objective: Objective,
        seed: int,
        keep_set: bool,
    ) -> None:
        self.scenario = replace(scenario, dispersion=scenario.set_model.bounds, covariance=None)
        self.evaluations = 0
        self.sets_emptied = 0
        self.history: list[tuple[int, float]] = []
        self.elite: Plans | None = None
        self._objective = objective
        self._seed = seed
        self._keep_set = keep_set
        self._strategy = strategy or make_strategy(scenario.strategy)
        self._strategy_name = scenario.strategy if strategy is None else type(strategy).__name__
        self._shift_m = worst_shift_m(scenario)
        # All other random numbers are those of run 0: the worst engagement can be repeated alone.
        self._draws = functools.cache(lambda size: draw(self.scenario, [0] * size, seed))
        self._planner = Planner(self.scenario, self._draws(1).steps, seed)

    def run(
        self, budget: int, pool: ThreadPoolExecutor, progress: Callable[[float], None] | None
    ) -> None:
        """Simulate `budget` engagements: first plans, then generations of changed plans."""
        flights = _in_chunks(*self._planner.first(max(1, round(FIRST_SHARE * budget))))
        while flights:
            # In the order of the flights: the result must not depend on the threads.
            for plans, emptied in pool.map(self._evaluate, *zip(*flights, strict=True)):
                self.evaluations += len(plans)
                self.sets_emptied += emptied
                self._select(plans, young=self.evaluations < YOUNG_SHARE * budget)
                if progress is not None:
                    progress(self.evaluations / budget)

            size = min(GENERATION, budget - self.evaluations)
            assert self.elite is not None
            flights = []
            if size > 0:
                flights = _in_chunks(self._planner.children(self.elite, size), None)

    def worst(self) -> WorstEngagement:
        """Return the best plan of the elite, flown again alone for all its results."""
        if self.elite is None or not np.isfinite(self.elite.value[0]):
            raise NothingCountsError(
                "in every simulated engagement the set became empty, or the miss was not finite"
            )
        best = self.elite.take(slice(0, 1))
        planner = self._planner
        flight = self.engagements(best)
        while flight.flying:
            flight.advance()
        result = flight.results(np.arange(1))

        start = start_of(self.scenario, best.start[0])
        dispersion = StateBox(**{name: (value, value) for name, value in start.items()})
        maximum = planner.acceleration_m_s2
        max_acceleration: dict[str, float] = {}
        if maximum.any():
            axes = self.scenario.set_model.axes
            max_acceleration = dict(zip(axes, maximum.tolist(), strict=True))
        return WorstEngagement(
            scenario=replace(self.scenario, dispersion=dispersion),
            seed=self._seed,
            strategy=self._strategy_name,
            objective=self._objective,
            any_state_miss_m=float(flight.any_state_miss_m(result)[0]),
            result=result,
            noise=self._scripted(best),
            accelerations_m_s2=self._target_m_s2(best),
            max_acceleration_m_s2=max_acceleration,
            construction=planner.constructions[int(best.lineage[0])],
            changes=int(best.changes[0]),
            evaluations=self.evaluations,
            sets_emptied=self.sets_emptied,
            history=tuple(self.history),
        )

    def engagements(self, plans: Plans, constructions: Constructions | None = None) -> Engagements:
        """Return plans in flight.

        With `constructions` game noise chooses the errors and writes them into `plans`; without
        them the errors of the plans are made.
        """
        position_m, velocity_m_s = (part.copy() for part in np.split(plans.start, 2, axis=1))
        draws = replace(self._draws(len(plans)), position_m=position_m, velocity_m_s=velocity_m_s)
        target_m_s2 = self._target_m_s2(plans)

        noise: MeasurementNoise = self._scripted(plans)
        if constructions is not None:
            side = constant_side(self.scenario.target, draws.target)
            if target_m_s2 is not None:
                # The sign at step 0: where the noise shifts, the target keeps its sign.
                side = by_axis(plans.sides[:, :, 0])
            game = constructions.noise(self._shift_m, side)
            noise = _Recorded(game, plans, self._planner.sensors)
        return Engagements(
            self.scenario,
            draws,
            self._strategy,
            noise=noise,
            target_m_s2=target_m_s2,
            guarantee=self.guarantee,
        )

    def _scripted(self, plans: Plans) -> ScriptedNoise:
        sensors = enumerate(self._planner.sensors)
        return ScriptedNoise(
            {sensor.name: by_axis(plans.errors[:, row], sensor) for row, sensor in sensors}
        )

    def _target_m_s2(self, plans: Plans) -> Floats | None:
        maximum = self._planner.acceleration_m_s2
        return by_axis(maximum[:, None] * plans.sides) if maximum.any() else None

    def value_m(self, flight: Engagements, results: Results) -> Floats:
        """Return the misses that the search maximises, m, shape (B,)."""
        if self._objective is Objective.ANY_STATE:
            return flight.any_state_miss_m(results)
        return results.miss_m

    def _evaluate(self, plans: Plans, constructions: Constructions | None) -> tuple[Plans, int]:
        """Fly plans, and return them with values, and the number of sets that became empty.

        The value is -inf for plans that do not count. Game noise writes its errors into `plans`;
        the returned plans share these arrays.
        """
        flight = self.engagements(plans, constructions)
        while flight.flying:
            flight.advance()
        results = flight.results(np.arange(len(plans)))
        value = self.value_m(flight, results)
        counts = np.isfinite(value) & ~(self._keep_set & results.set_emptied)
        valued = replace(plans, value=np.where(counts, value, -np.inf))
        return valued, int(results.set_emptied.sum())

    def _select(self, plans: Plans, young: bool) -> None:
        """Update the elite and the history with new flights.

        The elite is in descending order of value. Of plans with equal values one remains, so that
        at most one plan that does not count is among them.
        """
        rivals = plans if self.elite is None else self.elite.join(plans)
        kept: list[int] = []
        of_lineage: Counter[int] = Counter()
        for index in np.argsort(-rivals.value, kind="stable").tolist():
            lineage = int(rivals.lineage[index])
            # Plans with equal values are most often equal flights.
            is_repeated = bool(kept) and rivals.value[index] == rivals.value[kept[-1]]
            is_full = young and of_lineage[lineage] >= LINEAGE_SHARE
            if not is_repeated and not is_full:
                kept.append(index)
                of_lineage[lineage] += 1
            if len(kept) == ELITE:
                break

        self.elite = rivals.take(np.array(kept))
        maximum = float(self.elite.value[0])
        if np.isfinite(maximum) and (not self.history or maximum > self.history[-1][1]):
            self.history.append((self.evaluations, maximum))


@dataclass(frozen=True)
class _Recorded:
    """Game noise that writes its errors into plans: `ScriptedNoise` repeats the measurements."""

    game: GameNoise
    plans: Plans
    sensors: Sequence[Sensor]

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Return the measurements of a step."""
        errors = errors_made(sight, self.game.measure(sight, predicted))
        for row, sensor in enumerate(self.sensors):
            if sensor.name in errors:
                # Shape (B, C), of ranges (B, 1): these are written for all axes, and the first is
                # used.
                self.plans.errors[:, row, :, sight.step] = np.atleast_2d(errors[sensor.name]).T
        return measure_with_errors(sight, errors)


def start_of(scenario: Scenario, start: Floats) -> dict[str, float]:
    """Return the coordinates of a start by their names in `StateBox`."""
    axes = (*scenario.set_model.axes, "x")
    names = [*(f"{axis}_m" for axis in axes), *(f"v{axis}_m_s" for axis in axes)]
    return dict(zip(names, start.tolist(), strict=True))


def _in_chunks(
    plans: Plans, constructions: Constructions | None
) -> list[tuple[Plans, Constructions | None]]:
    """Split at least one plan into as few parts of at most `CHUNK` plans as possible.

    The sizes of the parts differ by at most one.
    """
    parts = np.array_split(np.arange(len(plans)), -(-len(plans) // CHUNK))
    return [(plans.take(part), constructions and constructions.take(part)) for part in parts]
