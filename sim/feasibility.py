"""What engine, budget, images and body of a scenario allow, before anything is simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.guidance.authority import max_correctable_m
from infoset.sim.closed_form import PossibleMiss, possible_miss
from infoset.sim.draws import draw_starts
from infoset.sim.scenario import MAX_STEPS, Scenario
from infoset.sim.schedule import image_times_s

STARTS = 400
"""Number of starts: those of the first runs of seed 0."""


@dataclass(frozen=True)
class Feasibility:
    """What a scenario allows.

    Parameters
    ----------
    steps, images, decisions : int
        Numbers of steps until the nominal arrival, of images before the last decision, and of steps
        in which an impulse can be given.
    unguided_miss_m : float
        Maximum miss without impulses of `STARTS` starts, without gravity, m.
    engine_corrects_m, budget_corrects_m : float
        What all impulses of the nominal flight can correct: with any budget, and with that of the
        engine, m.
    beyond_engine, beyond_budget : float
        Shares of the starts that no impulses can bring to a hit: with any budget, and with that of
        the engine.
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
    """Return what a scenario allows; None if the nominal arrival is more than `MAX_STEPS` away.

    A start is beyond an engine that corrects less than its miss minus the radius of the body.
    """
    model = scenario.set_model
    thruster = scenario.thruster
    arrival_s = scenario.nominal_arrival_s
    if arrival_s > MAX_STEPS * model.step_s:
        return None
    position_m, velocity_m_s, _ = draw_starts(scenario, range(STARTS), 0)
    arrivals_s = position_m[:, -1] / -velocity_m_s[:, -1]
    unguided_m = np.hypot.reduce(
        position_m[:, :-1] + velocity_m_s[:, :-1] * arrivals_s[:, None], axis=1
    )
    every = range(thruster.delay_steps, int(arrivals_s.max() / model.step_s) + 1)
    times_s = model.step_s * np.array(
        every if scenario.impulse_steps is None else scenario.impulse_steps, dtype=float
    )
    radius_m, to_go_s = (
        scenario.radius_m or 0.0,
        np.append(arrivals_s, arrival_s),
    )  # the last one is the nominal flight
    by_engine, by_budget = (
        max_correctable_m(times_s, thruster, to_go_s, budget=budget)
        for budget in (None, thruster.budget_m_s)
    )
    return Feasibility(
        steps=int(arrival_s / model.step_s),
        images=len(image_times_s(scenario)),
        decisions=int((times_s < arrival_s).sum()),
        unguided_miss_m=float(unguided_m.max()),
        engine_corrects_m=float(by_engine[-1]),
        budget_corrects_m=float(by_budget[-1]),
        beyond_engine=float((unguided_m - by_engine[:-1] > radius_m).mean()),
        beyond_budget=float((unguided_m - by_budget[:-1] > radius_m).mean()),
        possible_miss=possible_miss(scenario),
    )
