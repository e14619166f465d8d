"""Limits of the norm of controls: "Thrust in norm" of docs/guaranteed-rendezvous.md."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.rendezvous.reachability import (
    IMPULSE,
    ErrorBounds,
    ReachabilityProblem,
    ThrustShape,
    affine_plan,
    fly_plan,
    impulsive,
    norm_faces,
    with_errors,
)
from infoset.rendezvous.relative_motion import ClohessyWiltshire, TschaunerHempel
from tests.rendezvous.reachability.leo_rendezvous import FREE


def radii(controls: int) -> np.ndarray:
    """The norms of points of the polytope's boundary in 20 000 directions."""
    faces = norm_faces(controls)
    directions = np.random.default_rng(1).normal(size=(20_000, controls))
    directions = np.vstack([directions, np.eye(controls)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(faces.distance / (directions @ faces.normals.T).max(axis=1))


@pytest.mark.parametrize(("controls", "loss"), [(1, 0.0), (2, 1.0 - np.cos(np.pi / 16.0))])
def test_polygon_is_inside_the_ball_and_loses_the_known_part(controls: int, loss: float) -> None:
    reached = radii(controls)

    assert norm_faces(controls).loss == pytest.approx(loss, abs=1e-15)
    assert reached.max() == pytest.approx(1.0, abs=1e-6)
    assert reached.min() == pytest.approx(1.0 - loss, abs=1e-6)
    # Nothing is lost along the axes.
    np.testing.assert_allclose(reached[-controls:], 1.0, rtol=1e-12)


def test_polytope_is_inside_the_ball_and_loses_less_than_two_per_cent() -> None:
    reached = radii(3)

    assert reached.max() <= 1.0 + 1e-12
    assert reached.max() >= 0.999
    assert reached.min() >= norm_faces(3).distance - 1e-12
    assert 0.01 < norm_faces(3).loss < 0.02


@pytest.mark.parametrize("controls", [1, 2, 3])
def test_box_is_inside_the_polytope(controls: int) -> None:
    faces = norm_faces(controls)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * controls)).reshape(controls, -1).T

    heights = faces.box * signs @ faces.normals.T
    assert heights.max() <= faces.distance
    assert heights.max() >= faces.distance * (1.0 - 1e-8)


@pytest.mark.parametrize(
    ("degrees", "reached_m"),
    [
        # At a vertex, on the circle; halfway between two, on a face.
        (0.0, 100.0),
        (45.0, 100.0),
        (11.25, 100.0 * np.cos(np.pi / 16.0)),
    ],
)
def test_one_impulse_reaches_the_polygon(degrees: float, reached_m: float) -> None:
    """An impulse of at most 10 m/s for 10 s towards a point 300 m away, of which the norm counts
    along this direction only."""
    transition, control = impulsive(TschaunerHempel(FREE), 1, 10.0)
    angle = np.radians(degrees)
    away = 300.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
    problem = ReachabilityProblem(
        transition,
        control,
        np.concatenate([-away, np.zeros(3)]),
        np.full(6, 1e3),
        np.full(3, 10.0),
        ThrustShape.BALL,
        jump=IMPULSE,
    )
    nothing = ErrorBounds(np.zeros(6), np.zeros(3), np.zeros(3), np.zeros(0))
    whole = with_errors(problem, nothing, np.zeros(6), np.repeat([1.0, np.inf], 3))
    whole = replace(whole, goal=np.concatenate([away, np.zeros(3)])[None, :] / 300.0)

    assert affine_plan(whole).guarantee == pytest.approx(300.0 - reached_m, abs=1e-3)


def approach(thrust: ThrustShape) -> ReachabilityProblem:
    """Four impulses a minute apart, of at most 1.6 m/s, from 300 m behind and 200 m above."""
    transition, control = impulsive(ClohessyWiltshire(0.00113), 4, 60.0)
    return ReachabilityProblem(
        transition,
        control,
        np.array([200.0, -300.0, 0.0, 0.0, 0.0, 0.0]),
        np.repeat([1000.0, 20.0], 3),
        np.full(3, 1.6),
        thrust,
        jump=IMPULSE,
    )


def test_norm_is_kept_for_all_errors() -> None:
    errors = ErrorBounds(np.repeat([5.0, 0.3], 3), np.full(3, 1e-2), np.zeros(3), np.full(3, 0.5))
    plans = {}
    for thrust in ThrustShape:
        whole = with_errors(approach(thrust), errors, np.zeros(6), np.repeat([1.0, 0.02], 3))
        plans[thrust] = affine_plan(whole, 2)
    ball = approach(ThrustShape.BALL)

    flights = fly_plan(ball, plans[ThrustShape.BALL], errors, 2000, 1)
    unaware = fly_plan(ball, plans[ThrustShape.BOX], errors, 2000, 1)

    assert flights.outside == 0
    # The plan with a limit of each axis exceeds the norm.
    assert unaware.outside > 0
    box, norm = (plans[thrust].guarantee for thrust in (ThrustShape.BOX, ThrustShape.BALL))
    assert norm >= box - 1e-6
