"""Limits of the misses of a scenario by its engine, budget and images, without a simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.clock import STEP_ROUNDING
from infoset.guidance.authority import max_correctable_m
from infoset.sim.closed_form import PossibleMiss, possible_miss
from infoset.sim.draws import draw_starts
from infoset.sim.scenario import MAX_STEPS, Scenario
from infoset.sim.schedule import image_times_s

STARTS = 400
"""Number of starts, of runs 0, 1, ... of seed 0: a share of them has a standard error of at most
2.5 %.
"""


@dataclass(frozen=True)
class Feasibility:
    """Numbers that limit the misses of a scenario.

    Parameters
    ----------
    steps, images, decisions : int
        Numbers of steps until the nominal arrival, of images until the last decision, and of steps
        before the nominal arrival in which an impulse can be given.
    unguided_miss_m : float
        Maximum miss without impulses of `STARTS` starts, without gravity, m.
    engine_corrects_m, budget_corrects_m : float
        Maximum miss that all impulses of the nominal flight can correct, m: with an unlimited
        budget, and with the budget of the scenario.
    beyond_engine, beyond_budget : float
        Shares of the starts that no impulses can bring to a hit: with an unlimited budget, and with
        the budget of the scenario.
    possible_miss : PossibleMiss or None
        The misses that are possible at the last decision; None with fewer than two images.
    """

    steps: int
    images: int
    decisions: int
    unguided_miss_m: float
    engine_corrects_m: float
    budget_corrects_m: float
    beyond_engine: float
    beyond_budget: float
    possible_miss: PossibleMiss | None


def feasibility(scenario: Scenario) -> Feasibility | None:
    """Return the limits of the misses; None if the nominal arrival is more than `MAX_STEPS` away.

    A start is beyond an engine that corrects less than its miss minus the outer radius of the body,
    which is zero for a scenario without a body.
    """
    model = scenario.set_model
    thruster = scenario.engine
    arrival_s = scenario.nominal_arrival_s
    if arrival_s > MAX_STEPS * model.step_s:
        return None

    position_m, velocity_m_s, _ = draw_starts(scenario, range(STARTS), 0)
    # x is the last component.
    arrivals_s = position_m[:, -1] / -velocity_m_s[:, -1]
    lateral_m = position_m[:, :-1] + velocity_m_s[:, :-1] * arrivals_s[:, None]
    unguided_m = np.hypot.reduce(lateral_m + model.lateral_aim_m, axis=1)

    steps = scenario.impulse_steps
    if steps is None:
        steps = range(thruster.delay_steps, int(arrivals_s.max() / model.step_s) + 1)
    times_s = model.step_s * np.array(steps, dtype=float)
    # The last one is the nominal flight.
    to_go_s = np.append(arrivals_s, arrival_s)
    by_engine = max_correctable_m(times_s, thruster, to_go_s, budget=None)
    by_budget = max_correctable_m(times_s, thruster, to_go_s, budget=thruster.budget_m_s)
    radius_m = scenario.outer_radius_m or 0.0
    return Feasibility(
        steps=int(arrival_s / model.step_s + STEP_ROUNDING),
        images=len(image_times_s(scenario)),
        decisions=int((times_s < arrival_s).sum()),
        unguided_miss_m=float(unguided_m.max()),
        engine_corrects_m=float(by_engine[-1]),
        budget_corrects_m=float(by_budget[-1]),
        beyond_engine=float((unguided_m - by_engine[:-1] > radius_m).mean()),
        beyond_budget=float((unguided_m - by_budget[:-1] > radius_m).mean()),
        possible_miss=possible_miss(scenario),
    )
