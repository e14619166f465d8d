"""Engagements in space: identities of single runs, and the guarantees of the guaranteed model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import InformationSet, InitialSet, Model, RateSensor, StateBox
from infoset.guidance import NoiseKind, TieRule
from infoset.guidance.scripted_noise import ScriptedNoise
from infoset.guidance.thruster import modulus
from infoset.sim import Results, Scenario, simulate
from infoset.sim.draws import Draws, draw
from infoset.sim.engagement import Engagements, Step
from infoset.sim.scenario import of_model
from tests.long_steps import with_long_steps
from tests.sensors import linear
from tests.space import in_space

NOISES = [(NoiseKind.RANDOM, TieRule.UPPER), *((NoiseKind.GAME, tie) for tie in TieRule)]


def fly(scenario: Scenario, draws: Draws) -> tuple[Results, list[Step]]:
    flight = Engagements(scenario, draws)
    steps: list[Step] = []
    while flight.flying:
        flight.advance(steps.append)
    return flight.results(np.arange(len(draws.position_m))), steps


def in_model(scenario: Scenario, model: Model) -> Scenario:
    shape = InitialSet.BOX if model is Model.GUARANTEED else InitialSet.RECTANGLE
    return replace(
        scenario, **of_model(replace(scenario.set_model, model=model, initial_set=shape))
    )


def equal(there: Results, back: Results) -> None:
    for name in ("miss_m", "impulse_m_s", "guaranteed_miss_m", "truth_margin_m"):
        np.testing.assert_array_equal(getattr(back, name), getattr(there, name), err_msg=name)
    assert back.outcomes == there.outcomes


def flat(box: StateBox) -> StateBox:
    return replace(box, y_m=(0.0, 0.0), vy_m_s=(0.0, 0.0))


@pytest.mark.parametrize(
    ("name", "strategy"),
    [
        ("asteroid", "symmetric-miss"),
        pytest.param("asteroid", "patient", marks=pytest.mark.thorough),
        pytest.param("ranging", "symmetric-miss", marks=pytest.mark.thorough),
    ],
)
@pytest.mark.parametrize("model", list(Model))
@pytest.mark.parametrize(("noise", "tie"), NOISES)
def test_the_plane_is_a_special_case(
    name: str,
    strategy: str,
    model: Model,
    noise: NoiseKind,
    tie: TieRule,
    request: pytest.FixtureRequest,
) -> None:
    # Theory, section 9, item 1: y = V_y = 0, known exactly and measured without error; one code, so
    # equal bits.
    planar = in_model(with_long_steps(request.getfixturevalue(name)), model)
    planar = replace(planar, noise=noise, tie=tie, strategy=strategy)
    sensor = replace(
        linear(planar.angle_sensor), error_at_nominal_range_y_rad=0.0, error_at_zero_range_y_rad=0.0
    )
    bounds = flat(planar.set_model.bounds)
    known = replace(planar.set_model, bounds=bounds, angle_sensor=sensor, disturbance_y_m_s2=0.0)
    spatial = replace(planar, **of_model(known), dispersion=flat(planar.dispersion))
    there = simulate(planar, 6, seed=5)
    back = simulate(spatial, 6, seed=5)
    np.testing.assert_array_equal(back.miss_m, there.miss_m)
    np.testing.assert_array_equal(back.impulse_m_s, there.impulse_m_s)
    assert back.outcomes == there.outcomes
    if model is Model.GUARANTEED:
        assert back.truth_kept.all()
    # Gravity widens the set of the guaranteed model along y; that of the paper's is a point, and so
    # is the impulse.
    np.testing.assert_allclose(
        back.lateral_miss_m[:, 0], 0.0, atol=1e-50 if model is Model.PAPER else 1e-6
    )
    np.testing.assert_allclose(back.guaranteed_miss_m, there.guaranteed_miss_m, rtol=1e-14)


def exchanged_draws(draws: Draws) -> Draws:
    order = [1, 0, 2]
    errors = {
        name: values[::-1] if values.ndim == 3 else values for name, values in draws.errors.items()
    }
    return replace(
        draws,
        position_m=draws.position_m[:, order],
        velocity_m_s=draws.velocity_m_s[:, order],
        errors=errors,
        tie=draws.tie[::-1],
    )


def exchanged_box(box: StateBox) -> StateBox:
    assert box.y_m is not None
    assert box.vy_m_s is not None
    return replace(box, y_m=box.z_m, z_m=box.y_m, vy_m_s=box.vz_m_s, vz_m_s=box.vy_m_s)


def uneven(scenario: Scenario) -> Scenario:
    """A scenario in space whose axes have different bounds, errors and disturbances, without the
    Sun.
    """
    spatial = in_space(
        scenario, error_at_nominal_range_y_rad=0.0002, error_at_zero_range_y_rad=0.0003
    )
    model = spatial.set_model
    box = replace(model.bounds, y_m=(-7e3, 9e3), vy_m_s=(-80.0, 110.0))
    start = replace(spatial.dispersion, y_m=(-800.0, 900.0), vy_m_s=(-50.0, 60.0))
    return replace(
        spatial,
        dispersion=start,
        sun=None,
        **of_model(replace(model, bounds=box, disturbance_y_m_s2=0.007)),
    )


def exchanged(scenario: Scenario) -> Scenario:
    model = scenario.set_model
    sensor = linear(model.angle_sensor)
    y = sensor.axis("y")
    z = sensor.axis("z")
    sensor = replace(
        sensor,
        error_at_nominal_range_rad=y.error_at_nominal_range_rad,
        error_at_zero_range_rad=y.error_at_zero_range_rad,
        error_at_nominal_range_y_rad=z.error_at_nominal_range_rad,
        error_at_zero_range_y_rad=z.error_at_zero_range_rad,
    )
    assert model.disturbance_y_m_s2 is not None
    known = replace(
        model,
        bounds=exchanged_box(model.bounds),
        angle_sensor=sensor,
        disturbance_m_s2=model.disturbance_y_m_s2,
        disturbance_y_m_s2=model.disturbance_m_s2,
    )
    return replace(scenario, dispersion=exchanged_box(scenario.dispersion), **of_model(known))


@pytest.mark.parametrize("name", ["asteroid", pytest.param("ranging", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("model", list(Model))
@pytest.mark.parametrize(("noise", "tie"), NOISES)
def test_an_exchange_of_the_axes_changes_nothing(
    name: str, model: Model, noise: NoiseKind, tie: TieRule, request: pytest.FixtureRequest
) -> None:
    scenario = replace(
        uneven(in_model(with_long_steps(request.getfixturevalue(name)), model)),
        noise=noise,
        tie=tie,
    )
    draws = draw(scenario, range(6), 3)
    there, steps = fly(scenario, draws)
    back, mirrored = fly(exchanged(scenario), exchanged_draws(draws))
    equal(there, back)
    for one, other in zip(steps, mirrored, strict=True):
        np.testing.assert_array_equal(one.impulse_m_s, other.impulse_m_s[::-1])


@pytest.mark.parametrize("axes", [(True, True), (True, False), (False, True)])
@pytest.mark.parametrize("model", list(Model))
@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
def test_a_mirrored_engagement_is_mirrored(
    axes: tuple[bool, bool], model: Model, noise: NoiseKind, asteroid: Scenario
) -> None:
    # Mirror of both axes (theory, section 9, item 3), and of one axis, with random ties of opposite
    # sign.
    scenario = replace(
        uneven(in_model(with_long_steps(asteroid), model)), noise=noise, tie=TieRule.RANDOM
    )
    draws = draw(scenario, range(6), 3)
    flips = np.array([-1.0 if flip else 1.0 for flip in axes])

    def mirror(box: StateBox) -> StateBox:
        for name, flip in zip(("y", "z"), axes, strict=True):
            if flip:
                pairs = {key: getattr(box, key) for key in (f"{name}_m", f"v{name}_m_s")}
                box = replace(box, **{key: (-pair[1], -pair[0]) for key, pair in pairs.items()})
        return box

    mirrored = replace(
        scenario,
        dispersion=mirror(scenario.dispersion),
        **of_model(replace(scenario.set_model, bounds=mirror(scenario.set_model.bounds))),
    )
    turned = replace(
        draws,
        position_m=draws.position_m * [*flips, 1.0],
        velocity_m_s=draws.velocity_m_s * [*flips, 1.0],
        errors={**draws.errors, "angle": draws.errors["angle"] * flips[:, None, None]},
        tie=draws.tie * flips[:, None, None],
    )
    there, _ = fly(scenario, draws)
    back, _ = fly(mirrored, turned)
    # Intervals with ends of different size are mirrored up to rounding in the grid of the start.
    np.testing.assert_allclose(back.miss_m, there.miss_m, rtol=1e-9)
    np.testing.assert_allclose(back.impulse_m_s, there.impulse_m_s, rtol=1e-9)


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
def test_the_diagonal_is_a_planar_engagement_times_root_two(
    noise: NoiseKind, asteroid: Scenario
) -> None:
    # Theory, section 9, item 5: relative errors up to 1.6e-5 of the miss and 2e-7 of the impulse
    # were measured.
    planar = replace(asteroid, noise=noise, sun=None)
    thruster = planar.thruster
    root = np.sqrt(2.0)
    stronger = replace(
        thruster,
        budget_m_s=thruster.budget_m_s * root,
        min_impulse_m_s=thruster.min_impulse_m_s * root,
        max_impulse_m_s=thruster.max_impulse_m_s * root,
    )
    spatial = replace(in_space(planar), thruster=stronger)
    draws = draw(planar, range(20), 1)
    both = Draws(
        draws.position_m[:, [0, 0, 1]],
        draws.velocity_m_s[:, [0, 0, 1]],
        {"angle": np.concatenate([draws.errors["angle"]] * 2)},
        np.concatenate([draws.tie] * 2),
    )
    there, flown = fly(planar, draws)
    back, steps = fly(spatial, both)
    np.testing.assert_allclose(back.miss_m, root * there.miss_m, rtol=5e-5)
    np.testing.assert_allclose(back.impulse_m_s, root * there.impulse_m_s, rtol=1e-6)
    for step in steps:
        np.testing.assert_allclose(step.impulse_m_s[0], step.impulse_m_s[1], rtol=1e-9, atol=1e-9)
    assert len(steps) == len(flown)


@pytest.mark.parametrize(
    ("model", "with_rates"),
    [(Model.PAPER, False), (Model.GUARANTEED, False), (Model.GUARANTEED, True)],
)
def test_sections_in_space_equal_the_sections_of_two_planar_sets(
    model: Model, with_rates: bool, asteroid: Scenario
) -> None:
    # Theory, section 9, item 6: a replay at any label is the product of the planar replays of
    # (alpha_a, k_a).
    scenario = uneven(in_model(asteroid, model))
    if with_rates:
        scenario = replace(scenario, rate_sensor=RateSensor(1.0, 3e-8))
    draws = draw(scenario, [0], 3)
    flight = Engagements(scenario, draws)
    whole = flight._information
    seen: list[Step] = []
    planar = [InformationSet(flight._model.axis(axis)) for axis in ("y", "z")]
    labels = np.linspace(5.6e6, 6.0e6, 9)
    compared = 0
    while flight.flying and flight.step < 190:
        flight.advance(seen.append)
        step = seen[-1]
        for channel, one in enumerate(planar):
            if "angle" in step.measured:
                one.measure_angle(step.measured["angle"][[channel]])
            if "rate" in step.measured and scenario.rate_sensor is not None:
                one.measure_rate(step.measured["rate"][[channel]], scenario.rate_sensor.error_rad_s)
            one.shift(step.impulse_m_s[[channel]])
            one.drop_below_threshold()
            one.predict()
        if flight.step % 30 == 0:
            for label in labels:
                section = whole.section_at(float(label))
                planes = [one.section_at(float(label)).polygons[0] for one in planar]
                is_empty = any(plane.is_empty for plane in planes)
                assert section.polygons.is_empty.tolist() == [is_empty, is_empty]
                if not is_empty:
                    for along, plane in zip(section.polygons, planes, strict=True):
                        np.testing.assert_array_equal(along.polygon(), plane.polygon())
                    compared += 1
    assert compared > 10


def test_the_engine_is_limited_jointly(asteroid: Scenario) -> None:
    scenario = replace(in_space(asteroid), noise=NoiseKind.GAME)
    results, steps = fly(scenario, draw(scenario, range(20), 4))
    sizes = np.stack([modulus(np.where(step.tracking, step.impulse_m_s, 0.0)) for step in steps])
    engine = scenario.thruster
    fired = sizes > 0.0
    assert (sizes[fired] >= engine.min_impulse_m_s).all()
    assert (sizes <= engine.max_impulse_m_s).all()
    assert (sizes.sum(axis=0) <= engine.budget_m_s * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(results.impulse_m_s, sizes.sum(axis=0), rtol=1e-12)
    # The limit binds: otherwise this tests nothing.
    assert (sizes == engine.max_impulse_m_s).any()


def extremal(scenario: Scenario, runs: int, seed: int) -> tuple[Draws, ScriptedNoise]:
    """Starts anywhere in B x D, and errors at their bounds with random signs that keep for a
    while.
    """
    anywhere = replace(scenario, dispersion=scenario.set_model.bounds)
    draws = draw(anywhere, range(runs), seed)
    random = np.random.default_rng(seed)
    switches = random.random((2, runs, draws.steps)) < 10.0 ** random.uniform(
        -2.5, -0.3, (2, runs, 1)
    )
    signs = random.choice([-1.0, 1.0], (2, runs, 1)) * (-1.0) ** np.cumsum(switches, axis=2)
    return draws, ScriptedNoise({"angle": signs})


def test_the_true_state_is_kept(asteroid: Scenario) -> None:
    scenario = in_model(in_space(asteroid), Model.GUARANTEED)
    draws, noise = extremal(scenario, 100, 7)
    flight = Engagements(scenario, draws, noise=noise)
    while flight.flying:
        flight.advance()
    results = flight.results(np.arange(100))
    assert results.truth_kept.all()
    assert not results.set_emptied.any()
    assert results.phi_held.all()
