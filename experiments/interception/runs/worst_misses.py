"""The greatest misses of a strategy that a search finds, for `bound` and `adversary`."""

from __future__ import annotations

import os
from dataclasses import dataclass

from experiments.common.errors import InputError
from experiments.common.screen import BeginProgress
from guidance import Strategy
from sim import Scenario
from sim.adversary import BudgetError, NothingCountsError, WorstEngagement, find_worst
from sim.scenario import strategy_name


@dataclass(frozen=True)
class WorstMisses:
    """The engagements with the greatest misses of a strategy: of those whose set never became empty, and of all.

    The first is None if there was none, the second if no miss was finite.
    """

    set_kept: WorstEngagement | None
    overall: WorstEngagement | None

    @property
    def engagements(self) -> tuple[WorstEngagement, ...]:
        """The one or two different engagements."""
        both = (self.set_kept, self.overall) if self.set_kept is not self.overall else (self.overall,)
        return tuple(engagement for engagement in both if engagement is not None)

    def misses(self) -> dict[str, float | None]:
        """Return both misses as JSON, m."""
        named = {"worst_of_search_set_kept_m": self.set_kept, "worst_of_search_m": self.overall}
        return {name: None if engagement is None else engagement.miss_m for name, engagement in named.items()}


def find_worst_misses(
    scenario: Scenario, own: Strategy | None, *, budget: int, seed: int, begin: BeginProgress
) -> WorstMisses:
    """Search for the greatest miss with the set never empty, and for the greatest miss of all engagements.

    The second search is simulated only if the set became empty in the first one. Otherwise both are the same.
    """

    def search(keep_set: bool, name: str) -> WorstEngagement | None:
        try:
            return find_worst(
                scenario,
                strategy=own,
                budget=budget,
                seed=seed,
                keep_set=keep_set,
                threads=os.cpu_count() or 1,
                progress=begin(f"worst against {strategy_name(scenario, own)}{name}"),
            )
        except NothingCountsError:
            return None
        except BudgetError as error:
            raise InputError(f"--{error}") from None

    set_kept = search(True, "")
    if set_kept is not None and set_kept.sets_emptied == 0:
        return WorstMisses(set_kept, set_kept)
    overall = search(False, ", empty sets included")
    found = [engagement for engagement in (overall, set_kept) if engagement is not None]
    return WorstMisses(set_kept, max(found, key=lambda engagement: engagement.miss_m, default=None))
