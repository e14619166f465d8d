"""Bodies that are not spheres, and aim points beside the centre."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset.covered_set import information_set
from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Body, MissCause, Scenario, simulate
from infoset.sim.draws import draw
from infoset.sim.feasibility import feasibility

DIMORPHOS_M = (88.5, 58.0)
AIM_M = (12.0, -7.0)


@pytest.fixture(scope="module")
def impactor() -> Scenario:
    """A flight of 120 steps with four impulses, toward a body of 50 m."""
    steps = ["step_s=60", "camera.period_s=60"]
    return load_scenario("haiv-2013", steps)


@pytest.mark.parametrize(
    ("distance_m", "probability"),
    [(57.9, 1.0), (60.0, 0.7793), (70.0, 0.4683), (80.0, 0.2693), (88.6, 0.0)],
)
def test_hit_probability_is_the_share_of_the_directions(
    distance_m: float, probability: float
) -> None:
    """The numbers are shares of 10^6 sampled directions."""
    body = Body(semi_axes_m=DIMORPHOS_M)
    found = body.hit_probability(distance_m)
    # A share of samples has a standard error of at most 0.0005.
    assert found == pytest.approx(probability, abs=1e-3)

    turns = np.linspace(0.0, np.pi, 100_001)
    points = np.tile([[distance_m], [0.0]], len(turns))
    share = body.contains(points, turns).mean()
    # Of equally spaced directions, up to four are on the wrong side of an end.
    assert share == pytest.approx(float(found), abs=4e-5)


@pytest.mark.parametrize(
    ("angle_rad", "aim_m"),
    [
        (0.3, (10.0, 5.0)),
        (0.0, (40.0, 0.0)),  # on the longer axis, where the nearest point is beside it
        (0.0, (80.0, 0.0)),  # on the longer axis, beyond the centre of curvature
        (0.0, (0.0, -57.0)),
        (-2.0, (-20.0, 30.0)),
        (1.0, (0.0, 0.0)),
    ],
)
def test_inscribed_radius_is_the_distance_to_the_nearest_point_of_the_edge(
    angle_rad: float, aim_m: tuple[float, float]
) -> None:
    body = Body(semi_axes_m=DIMORPHOS_M, axis_angle_rad=angle_rad, aim_m=aim_m)

    turns = np.linspace(0.0, 2.0 * np.pi, 1_000_001)
    along_m = DIMORPHOS_M[0] * np.cos(turns)
    across_m = DIMORPHOS_M[1] * np.sin(turns)
    cosine = np.cos(angle_rad)
    sine = np.sin(angle_rad)
    edge_m = np.array([along_m * cosine - across_m * sine, along_m * sine + across_m * cosine])
    nearest_m = np.hypot(edge_m[0] - aim_m[0], edge_m[1] - aim_m[1]).min()

    # The nearest of so many points is farther by half of the square of their spacing at most.
    assert body.inscribed_m == pytest.approx(nearest_m, abs=1e-8)


def test_inscribed_radius_of_an_unknown_direction_is_the_shorter_axis_less_the_aim() -> None:
    assert Body(semi_axes_m=DIMORPHOS_M, aim_m=(3.0, 4.0)).inscribed_m == 53.0
    assert Body(semi_axes_m=DIMORPHOS_M).inscribed_m == 58.0
    assert Body(60.0, aim_m=(3.0, 4.0)).inscribed_m == 55.0


def test_miss_beyond_which_no_hit_is_sure() -> None:
    assert Body(60.0, aim_m=(3.0, 4.0)).certain_miss_m == 65.0
    known = Body(semi_axes_m=DIMORPHOS_M, axis_angle_rad=0.0, aim_m=(3.0, 4.0))
    assert known.certain_miss_m == 93.5
    assert Body(semi_axes_m=DIMORPHOS_M).certain_miss_m == 58.0


def test_outer_radius_contains_the_body() -> None:
    assert Body(60.0, aim_m=(3.0, 4.0)).outer_m == 65.0
    assert Body(semi_axes_m=DIMORPHOS_M, aim_m=(3.0, 4.0)).outer_m == 93.5
    assert Body(semi_axes_m=DIMORPHOS_M).outer_m == 88.5


def test_ellipse_contains_the_points_of_its_equation() -> None:
    body = Body(semi_axes_m=(2.0, 1.0), axis_angle_rad=0.5 * np.pi)
    points_m = np.array([[0.0, 0.0, 0.9, 1.1], [1.9, 2.1, 0.0, 0.0]])
    assert body.contains(points_m, body.axis_angle_rad).tolist() == [True, False, True, False]
    assert body.contains(points_m, None).tolist() == [False, False, True, False]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, r"set either radius_m \(sphere\) or semi_axes_m \(ellipse\): got neither"),
        ({"radius_m": 1.0, "semi_axes_m": (2.0, 1.0)}, "got both; .*delete the line of radius_m"),
        ({"semi_axes_m": (1.0, 2.0)}, "the longer semi-axis first"),
        ({"semi_axes_m": (1.0,)}, "two numbers"),
        ({"radius_m": 1.0, "axis_angle_rad": 0.0}, "direction of an ellipse"),
        ({"radius_m": 1.0, "aim_m": (0.0,)}, "two numbers"),
        ({"radius_m": 1.0, "aim_m": (0.0, 1.0)}, "inside the body"),
        ({"semi_axes_m": (3.0, 1.0), "aim_m": (2.0, 0.0)}, "for all its possible directions"),
        (
            {"semi_axes_m": (3.0, 1.0), "axis_angle_rad": 0.0, "aim_m": (0.0, 2.0)},
            "inside the body",
        ),
    ],
)
def test_contradictory_body_is_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Body(**keys)


@pytest.mark.parametrize(
    ("body", "key"),
    [
        (Body(semi_axes_m=(2.0, 1.0)), "semi_axes_m"),
        (Body(5.0, aim_m=(1.0, 0.0)), "aim_m"),
    ],
)
def test_ellipse_and_aim_point_need_space(body: Body, key: str) -> None:
    with pytest.raises(ValueError, match=rf"body\.{key} is a value of an engagement in space"):
        replace(load_scenario("asteroid-1997"), body=body)


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
@pytest.mark.parametrize("strategy", ["symmetric-miss", "zero-effort-miss", "kalman"])
def test_guidance_aims_at_the_aim_point(
    impactor: Scenario, strategy: str, noise: NoiseKind
) -> None:
    at_centre = replace(impactor, strategy=strategy, noise=noise)
    body = Body(semi_axes_m=DIMORPHOS_M, axis_angle_rad=0.4, aim_m=AIM_M)
    aimed = replace(at_centre, body=body)

    before = simulate(at_centre, 3, seed=2)
    results = simulate(aimed, 3, seed=2)

    # The centre passes opposite to the aim point. The approach is inclined by up to 1e-3.
    from_aim_m = np.hypot.reduce(results.lateral_miss_m + AIM_M, axis=1)
    np.testing.assert_allclose(results.miss_m, from_aim_m, rtol=1e-5)
    # The set sees a body that is displaced by 14 m, and the start is uncertain by kilometres.
    np.testing.assert_allclose(results.miss_m, before.miss_m, atol=0.5)
    assert results.truth_kept.all()
    assert results.phi_held.all()
    assert results.phi_held.count() == 3
    np.testing.assert_array_equal(results.hit, body.contains(results.lateral_miss_m.T, 0.4))


@pytest.mark.parametrize("wrong_images", [0, 1])
def test_predicted_misses_are_those_of_the_aim_point(impactor: Scenario, wrong_images: int) -> None:
    settings = replace(impactor.information_set, wrong_images=wrong_images)
    model = replace(impactor, information_set=settings).set_model
    sets = [information_set(each) for each in (model, replace(model, aim_m=AIM_M))]
    for each in sets:
        each.measure_angle([[1e-5], [-2e-5]])

    centre, aimed = (each.predicted_miss() for each in sets)
    for end in ("lower_m", "upper_m"):
        moved_m = getattr(aimed, end) - getattr(centre, end)
        np.testing.assert_allclose(moved_m[:, 0], AIM_M, rtol=1e-9)
    assert aimed.lower_point.range_m.tolist() == centre.lower_point.range_m.tolist()

    by_section = [np.stack(each.predicted_miss_by_section_m()) for each in sets]
    feasible = sets[0].feasible
    moved_m = (by_section[1] - by_section[0])[..., feasible]
    np.testing.assert_allclose(moved_m, np.broadcast_to(np.array(AIM_M)[:, None], moved_m.shape))
    assert not by_section[1][..., ~feasible].any()


def test_hit_is_certain_if_phi_is_at_most_the_inscribed_radius(impactor: Scenario) -> None:
    bound_m = np.sort(simulate(impactor, 4).guaranteed_miss_m.filled(np.inf))
    between_m = float(bound_m[1:3].mean())
    results = simulate(replace(impactor, body=Body(semi_axes_m=(90.0, between_m))), 4)

    assert results.certain_hit is not None
    assert int(results.certain_hit.sum()) == 2
    assert (results.hit | ~results.certain_hit).all()
    without = simulate(impactor, 2, guarantee=False)
    assert without.certain_hit is not None
    assert not without.certain_hit.count()


def test_flight_is_beyond_the_engine_if_it_cannot_come_to_the_longer_axis(
    impactor: Scenario,
) -> None:
    """With impulses of 0.06 m/s, some starts can be brought to 4 km and not to 20 m."""
    body = Body(semi_axes_m=(4000.0, 20.0), axis_angle_rad=0.4)
    weak = replace(impactor.thruster, max_impulse_m_s=0.06)
    scenario = replace(impactor, body=body, thruster=weak)
    results = simulate(scenario, 20, guarantee=False)

    left_m = results.unguided_miss_m - results.engine_corrects_m
    missed = ~results.hit.filled(False)
    by_engine = [cause is MissCause.ENGINE for cause in results.causes]
    assert by_engine == (missed & (left_m > 4000.0)).tolist()
    assert (missed & (left_m > 20.0) & (left_m <= 4000.0)).any()

    found = feasibility(scenario)
    sphere = feasibility(replace(scenario, body=Body(4000.0)))
    assert found is not None
    assert sphere is not None
    assert 0.0 < found.beyond_engine == sphere.beyond_engine < 1.0


def test_direction_of_an_ellipse_depends_on_seed_and_run_only(impactor: Scenario) -> None:
    turned = replace(impactor, body=Body(semi_axes_m=DIMORPHOS_M))
    angles = draw(turned, [0, 1, 2], 5).axis_angle_rad
    assert angles is not None
    assert ((angles >= 0.0) & (angles < np.pi)).all()
    assert len(set(angles.tolist())) == 3
    alone = draw(turned, [2], 5).axis_angle_rad
    assert alone is not None
    assert alone[0] == angles[2]
    known = Body(semi_axes_m=DIMORPHOS_M, axis_angle_rad=0.0)
    assert draw(replace(impactor, body=known), [0], 5).axis_angle_rad is None


def test_unknown_direction_has_the_probability_of_a_hit(impactor: Scenario) -> None:
    body = Body(semi_axes_m=(60.0, 30.0))
    results = simulate(replace(impactor, noise=NoiseKind.GAME, body=body), 4)
    angles = draw(replace(impactor, body=body), range(4), 0).axis_angle_rad

    assert results.hit_probability is not None
    distance_m = np.hypot.reduce(results.lateral_miss_m, axis=1)
    np.testing.assert_array_equal(results.hit_probability, body.hit_probability(distance_m))
    assert ((results.hit_probability > 0.0) & (results.hit_probability < 1.0)).all()
    np.testing.assert_array_equal(results.hit, body.contains(results.lateral_miss_m.T, angles))
