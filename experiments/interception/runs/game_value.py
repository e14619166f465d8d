"""What `infoset bound` says about the value of the game."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

from experiments.common.screen import number
from experiments.interception.runs.shared import WorstMisses
from experiments.interception.study import max_guarantee_m
from sim import Record, Results, Scenario
from sim.bound import LowerBound
from sim.game_value import ValueReserve, value_reserve, why_no_value
from sim.pair import PairFlight
from sim.results import join
from sim.truth_pair import TruthPair


@dataclass(frozen=True)
class WorstOfStrategy:
    """Simulations of one strategy: the pairs of the bound, and the worst engagements of the searches."""

    name: str
    flights: tuple[tuple[TruthPair, PairFlight], ...]
    searched: WorstMisses
    records: tuple[Record, ...]

    @property
    def results(self) -> Results:
        """Results of all simulations."""
        return join([*(flight.results for _, flight in self.flights), *(record.result for record in self.records)])

    @property
    def pairs_m(self) -> float:
        """Maximum miss of the pairs, m."""
        return max(float(flight.results.miss_m.max()) for _, flight in self.flights)

    @property
    def worst_m(self) -> float:
        """Maximum miss of all simulations, m."""
        return float(self.results.miss_m.max())

    @property
    def set_kept_m(self) -> float | None:
        """Maximum miss of the engagements whose set never became empty, m; None if there is none."""
        results = self.results
        return max(results.miss_m[~results.set_emptied].tolist(), default=None)

    @property
    def guaranteed_m(self) -> float | None:
        """Maximum guaranteed miss of all simulations, m; None if the model has no guarantee."""
        return max_guarantee_m(self.results)

    def over(self, lower: LowerBound) -> float | None:
        """Return the maximum miss with the set never empty, divided by the bound; None if one of them is missing."""
        return self.set_kept_m / lower.bound_m if lower.bound_m > 0.0 and self.set_kept_m is not None else None


@dataclass(frozen=True)
class GameValue:
    """The minimum miss that a strategy can guarantee: its lower end, and what is known of the upper one.

    Parameters
    ----------
    lower_m : float
        The lower bound.
    reserve : ValueReserve or None
        How much greater the value can be; None if this is not proved.
    reasons : tuple of str
        Assumptions of the proof that the scenario does not meet.
    best : WorstOfStrategy or None
        The strategy whose maximum miss found is minimum; None without a search.
    """

    lower_m: float
    reserve: ValueReserve | None
    reasons: tuple[str, ...]
    best: WorstOfStrategy | None

    def lines(self) -> Iterator[str]:
        """Return the lines for the screen."""
        if self.reserve is not None:
            items = {name.removesuffix("_m").replace("_", " "): part for name, part in asdict(self.reserve).items()}
            yield (
                f"the bound is the value of the game up to a reserve of {number(self.reserve.total_m)} m: no strategy "
                f"guarantees less than {number(self.lower_m)} m, and symmetric-miss guarantees at most the reserve more"
            )
            yield f"reserve, m: {', '.join(f'{name} {number(part)}' for name, part in items.items())}"
            return
        if self.best is None:
            yield (
                f"the value of the game is at least {number(self.lower_m)} m; a search is needed to compare strategies "
                "with it"
            )
        else:
            yield (
                f"the value of the game is at least {number(self.lower_m)} m; the minimum of the maximum misses found "
                f"is {number(self.best.worst_m)} m, of {self.best.name}: what it guarantees is that or more"
            )
        yield f"no upper end is proved, because of: {', '.join(self.reasons)}"

    def summary(self) -> dict[str, object]:
        """Return the value as JSON."""
        reserve = self.reserve
        return {
            "at_least_m": self.lower_m,
            "at_most_m": None if reserve is None else self.lower_m + reserve.total_m,
            "reserve_m": None if reserve is None else {"total": reserve.total_m} | _without_unit(asdict(reserve)),
            "not_proved_because": list(self.reasons),
            "best_strategy": None if self.best is None else self.best.name,
            "best_strategy_worst_found_m": None if self.best is None else self.best.worst_m,
        }


def value_of(scenario: Scenario, lower: LowerBound, worst: Sequence[WorstOfStrategy]) -> GameValue:
    """Return what is known of the value of the game from the lower bound and the engagements of strategies."""
    searched = [strategy for strategy in worst if strategy.searched.engagements]
    best = min(searched, key=lambda strategy: strategy.worst_m, default=None)
    failed = why_no_value(scenario)
    reserve = failed if failed else value_reserve(scenario, lower)
    if isinstance(reserve, str):
        reserve = (reserve,)
    if isinstance(reserve, ValueReserve):
        return GameValue(lower.bound_m, reserve, (), best)
    return GameValue(lower.bound_m, None, reserve, best)


def _without_unit(values: dict[str, float]) -> dict[str, float]:
    return {name.removesuffix("_m"): value for name, value in values.items()}
