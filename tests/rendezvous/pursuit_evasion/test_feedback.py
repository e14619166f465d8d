from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.rendezvous.pursuit_evasion import (
    CaptureSolution,
    Ended,
    Observation,
    Policy,
    Steering,
    feedback,
    fly,
    solve,
)
from infoset.rendezvous.pursuit_evasion._pair import ExtremalCraft, Node

from .conftest import MakeGame

# Theory, receding horizon: plans every 600 s; the last plan's prediction.
PUBLISHED: list[tuple[str, Steering | None, float]] = [
    ("optimal", None, 45343.6),
    ("coast", Policy.COAST.direction, 34632.0),
    ("prograde", Policy.PROGRADE.direction, 34947.7),
    ("normal", Policy.NORMAL.direction, 36473.4),
]


@pytest.mark.parametrize(
    ("name", "steering", "capture_s"), PUBLISHED, ids=[each[0] for each in PUBLISHED]
)
def test_receding_horizon(
    name: str, steering: Steering | None, capture_s: float, solved: CaptureSolution
) -> None:
    flight = fly(solved.game, steering, solution=solved)
    assert flight.ended is Ended.CAPTURED
    assert flight.predicted_s[-1] == pytest.approx(capture_s, abs=0.1)
    assert flight.time_s == pytest.approx(capture_s, abs=2.0)
    assert flight.distance_m < 20.0
    if name != "normal":
        assert np.diff(flight.predicted_s).max() < 1e-8


@pytest.mark.parametrize("policy", [Policy.NORMAL, Policy.RETROGRADE])
def test_loss_of_a_held_plan_vanishes_with_the_time_between_plans(
    policy: Policy, solved: CaptureSolution
) -> None:
    # Within a leg the pursuer does not answer: its loss is of high order in the leg.
    losses = [
        np.diff(fly(solved.game, policy.direction, solution=solved, replan_s=leg).predicted_s).max()
        for leg in (600.0, 120.0)
    ]
    assert losses[0] < 0.05
    assert losses[1] < losses[0] / 50.0


def test_delayed_and_noisy_observation_delays_the_capture(slides: MakeGame) -> None:
    solution = solve(slides(capture_radius_m=20e3))
    assert solution.capture is not None
    noisy = fly(
        solution.game, None, solution=solution, observation=Observation(300.0, 500.0, 0.05), seed=3
    )
    assert noisy.ended is Ended.CAPTURED
    assert noisy.time_s > solution.capture.time_s
    assert noisy.time_s == pytest.approx(solution.capture.time_s, rel=1e-3)


def test_path_of_an_optimal_evader_without_propellant_is_continuous(
    slides: MakeGame, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Formerly it thrust in a leg whose plan was to coast: its path began 2 km away."""
    game = slides(capture_radius_m=20e3)
    first = solve(game)
    assert first.capture is not None
    # Its propellant ends 2 s after the capture, thus within the last leg.
    dry_kg = game.evader.mass_kg - game.evader.flow_kg_s * (first.capture.time_s + 2.0)
    game = replace(game, evader=replace(game.evader, dry_mass_kg=dry_kg))
    gaps_m = []
    path_of_leg = feedback._Pursuit._evader_path

    def recorded(
        pursuit: feedback._Pursuit, own: Node, spell: float
    ) -> tuple[feedback.PathNow, float]:
        path, mass = path_of_leg(pursuit, own, spell)
        gap = np.linalg.norm(path(0.0)[:3] - pursuit._evader.start[:3])
        gaps_m.append(gap * first.units.length_m)
        return path, mass

    monkeypatch.setattr(feedback._Pursuit, "_evader_path", recorded)
    fly(game, None, replan_s=1200.0, observation=Observation(300.0, 500.0, 0.05), seed=3)
    # States of a plan agree with the start to its residual, some 1e-11 of 42 166 km.
    assert max(gaps_m) < 0.1


def test_path_of_an_optimal_evader_without_a_new_plan_is_continuous(
    slides: MakeGame, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Formerly it followed the pursuer's plan of the leg before, from the start of that leg."""
    solution = solve(slides(capture_radius_m=20e3))
    gaps_m = []
    path_of_leg = feedback._Pursuit._evader_path
    plan_of_leg = feedback._Pursuit._plan

    def recorded(
        pursuit: feedback._Pursuit, own: Node, spell: float
    ) -> tuple[feedback.PathNow, float]:
        path, mass = path_of_leg(pursuit, own, spell)
        gap = np.linalg.norm(path(0.0)[:3] - pursuit._evader.start[:3])
        gaps_m.append(gap * solution.units.length_m)
        return path, mass

    def not_of_the_evader(
        pursuit: feedback._Pursuit, before: Node, spell: float, evader: ExtremalCraft
    ) -> Node | None:
        if evader is pursuit._evader:
            return None
        return plan_of_leg(pursuit, before, spell, evader)

    monkeypatch.setattr(feedback._Pursuit, "_evader_path", recorded)
    monkeypatch.setattr(feedback._Pursuit, "_plan", not_of_the_evader)
    observation = Observation(300.0, 500.0, 0.05)
    flight = fly(solution.game, None, solution=solution, observation=observation, seed=3)
    assert flight.ended is Ended.CAPTURED
    # States of a plan agree with the start to its residual, some 1e-11 of 42 166 km.
    assert max(gaps_m) < 0.1
