"""Banks of Kalman filters whose angles are measured almost without error."""

from __future__ import annotations

import numpy as np
import pytest

from infoset import AngleSensor, InformationSet, RangeSensor, SetModel, SetSettings, StateBox
from infoset.arrays import Floats
from infoset.guidance import KalmanBank, NoiseKind, Situation, Thruster, TieRule, strategy_names
from infoset.guidance.kalman import MEMBERS, VZ, X, Z
from infoset.sim import Scenario, simulate
from tests.rationals import Fraction

BASELINES = [name for name in strategy_names() if "kalman" in name]
CLOSING_SPEED = 1000.0
STEP_S = 8.0
RANGE_M = 2.0**17


def set_model(box: StateBox) -> SetModel:
    """Angles of y without error, and of z with an error bound that is negligible too."""
    sensor = AngleSensor(
        STEP_S,
        1e-60,
        1e-60,
        RANGE_M,
        error_at_nominal_range_y_rad=0.0,
        error_at_zero_range_y_rad=0.0,
    )
    return SetModel(CLOSING_SPEED, STEP_S, box, sensor)


def box_of(offset_m: float, speed_m_s: float, range_m: float) -> StateBox:
    """The same intervals along both axes, with these half-widths."""
    lateral = (300.0 - offset_m, 300.0 + offset_m)
    fast = (-2.0 - speed_m_s, -2.0 + speed_m_s)
    return StateBox(
        lateral,
        (RANGE_M - range_m, RANGE_M + range_m),
        fast,
        (-CLOSING_SPEED, -CLOSING_SPEED),
        lateral,
        fast,
    )


def after(
    box: StateBox, angles_rad: Floats, gate_sigma: float | None = None
) -> tuple[KalmanBank, Situation]:
    """Return the bank after equal angles of both axes, one a step, without impulses, and its last
    situation.
    """
    model = set_model(box)
    bank = KalmanBank((2, 1), gate_sigma=gate_sigma)
    view = InformationSet(model).view()
    for step, angle in enumerate(angles_rad):
        now = Situation(
            time_s=step * STEP_S,
            step=step,
            step_s=STEP_S,
            predicted_miss=view.predicted_miss(),
            budget_left_m_s=np.full(1, 1e9),
            thruster=Thruster(1e9, 0.0, 1e9),
            closing_speed_m_s=CLOSING_SPEED,
            measured={"angle": np.full((2, 1), angle)},
            last_impulse_m_s=np.zeros((2, 1)),
            information=view,
            new=frozenset({"angle"}),
        )
        bank.update(now)
    return bank, now


def line(z_m: float, v_m_s: float, range_m: float, steps: int) -> Floats:
    """Angles of a motion along a straight line."""
    to_go_s = range_m / CLOSING_SPEED - STEP_S * np.arange(steps)
    return np.asarray(np.arctan2(z_m + v_m_s * STEP_S * np.arange(steps), CLOSING_SPEED * to_go_s))


def test_two_exact_angles_give_the_motion_at_a_known_range() -> None:
    """The error of an angle, an ulp, is 2e-16 of 300 m, and that of V is twice that over the
    step.
    """
    bank, now = after(box_of(5e3, 50.0, 0.0), line(1234.5, -7.25, RANGE_M, 2))

    position_m = 1234.5 - 7.25 * STEP_S
    np.testing.assert_allclose(bank.mean[..., Z], position_m, rtol=1e-9)
    np.testing.assert_allclose(bank.mean[..., VZ], -7.25, rtol=1e-9)
    to_go_s = RANGE_M / CLOSING_SPEED - STEP_S
    np.testing.assert_allclose(bank.estimate(now).miss_m, position_m - 7.25 * to_go_s, rtol=1e-8)
    assert (bank.estimate(now).deviation_m < 1e-3).all()


def test_gate_ignores_a_wrong_angle() -> None:
    box = box_of(5e3, 50.0, 0.0)
    angles = line(1234.5, -7.25, RANGE_M, 2)
    right, _ = after(box, angles, gate_sigma=4.0)
    np.testing.assert_allclose(right.mean, after(box, angles)[0].mean, rtol=1e-12)

    # The velocity is known to within 50 m/s: 20 times as much is wrong.
    angles[1] += 20.0 * 50.0 * STEP_S / RANGE_M
    gated, _ = after(box, angles, gate_sigma=4.0)
    first, _ = after(box, angles[:1])
    predicted_m = first.mean[..., Z] + STEP_S * first.mean[..., VZ]
    np.testing.assert_allclose(gated.mean[..., Z], predicted_m, rtol=1e-9)
    without, _ = after(box, angles)
    assert (np.abs(without.mean[..., Z] - predicted_m) > 500.0 * STEP_S).all()


def test_exact_angle_conditions_the_prior_on_a_line_of_sight() -> None:
    """The distribution given z = x tan(alpha), in rational arithmetic: P - P h h'P / h'Ph."""
    angle = 2.0**-7
    bank, _ = after(box_of(5e3, 50.0, 4e3), np.array([angle]))

    row = [Fraction(1), Fraction(0), -Fraction(float(np.tan(angle))), Fraction(0)]
    edges = np.linspace(RANGE_M - 4e3, RANGE_M + 4e3, MEMBERS + 1)
    for member in range(MEMBERS):
        middle_m = Fraction(float(0.5 * (edges[member] + edges[member + 1])))
        mean = [Fraction(300), Fraction(-2), middle_m, Fraction(1000)]
        widths = [Fraction(10_000), Fraction(100), Fraction(8000, MEMBERS), Fraction(0)]
        variances = [width**2 / 12 for width in widths]
        column = [variance * part for variance, part in zip(variances, row, strict=True)]
        total = sum(part * other for part, other in zip(row, column, strict=True))
        off = -sum(part * value for part, value in zip(row, mean, strict=True))
        for i in range(4):
            deviation = float(variances[i]) ** 0.5
            expected = float(mean[i] + column[i] * off / total)
            # The root of the covariance and its product have some ten roundings of an ulp of the
            # deviations.
            np.testing.assert_allclose(
                bank.mean[:, 0, member, i], expected, rtol=1e-14, atol=1e-13 * deviation
            )
            for j in range(4):
                scale = deviation * float(variances[j]) ** 0.5
                expected = float((variances[i] if i == j else 0) - column[i] * column[j] / total)
                actual = bank.covariance[:, 0, member, i, j]
                np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-14 * scale)


def test_equal_axes_have_equal_estimates_if_one_bound_is_zero_and_the_other_negligible() -> None:
    bank, now = after(box_of(5e3, 50.0, 4e3), line(800.0, 3.0, RANGE_M + 1e3, 12))

    np.testing.assert_array_equal(bank.mean[0], bank.mean[1])
    np.testing.assert_array_equal(bank.covariance[0], bank.covariance[1])
    assert np.isfinite(bank.estimate(now).miss_m).all()


def test_exact_angles_leave_an_exactly_known_motion_as_it_is() -> None:
    bank, now = after(box_of(0.0, 0.0, 0.0), line(300.0, -2.0, RANGE_M, 12))

    passed_s = 11 * STEP_S
    assert (bank.mean[..., Z] == 300.0 - 2.0 * passed_s).all()
    assert (bank.mean[..., X] == RANGE_M - CLOSING_SPEED * passed_s).all()
    assert (bank.covariance == 0.0).all()
    assert (bank.estimate(now).deviation_m == 0.0).all()


def nan_scenario(strategy: str) -> Scenario:
    """A scenario whose filters returned impulses that were not finite."""
    box = StateBox(
        z_m=(-56007.0, 33980.0),
        x_m=(526306.0, 528687.0),
        vz_m_s=(80.6, 80.6),
        vx_m_s=(-6462.0, -1261.0),
        y_m=(-57233.0, -51882.0),
        vy_m_s=(396.0, 396.0),
    )
    return Scenario(
        name="exact y",
        nominal_range_m=527500.0,
        closing_speed_m_s=3861.65,
        step_s=31.875,
        strategy=strategy,
        noise=NoiseKind.GAME,
        tie=TieRule.RANDOM,
        uncertainty=box,
        dispersion=box,
        angle_sensor=AngleSensor(
            31.875,
            0.0158,
            0.0432,
            539938.0,
            miss_probability=0.4,
            error_at_nominal_range_y_rad=0.0,
            error_at_zero_range_y_rad=0.0,
        ),
        thruster=Thruster(
            5084.5, 698.2, 3308.7, execution_error_relative=0.05, pointing_error_rad=0.3
        ),
        information_set=SetSettings(sections=1, fewest_sections=1),
    )


@pytest.mark.parametrize("strategy", BASELINES)
def test_flight_with_an_exact_angle_gives_finite_impulses(strategy: str) -> None:
    """An impulse that is not finite is an error, and so is a warning."""
    results = simulate(nan_scenario(strategy), 12)
    assert np.isfinite(results.impulse_m_s).all()


def random_scenario(number: int) -> Scenario:
    """An engagement in space with precise angles: of y, which is exact, or of both axes, and known
    starts.
    """
    generator = np.random.default_rng([54, number])

    def decades(minimum: float, maximum: float) -> float:
        return float(10.0 ** generator.uniform(minimum, maximum))

    def often(share: float) -> bool:
        return bool(generator.uniform() < share)

    def around(middle: float, half_width: float) -> tuple[float, float]:
        if often(0.4):
            return middle, middle
        return middle - half_width, middle + half_width

    speed_m_s = 1e3 * decades(0.0, 2.0)
    steps = decades(1.2, 1.8)
    step_s = decades(-2.0, 1.0)
    range_m = speed_m_s * steps * step_s
    wide_m = range_m * decades(-4.0, -0.5)
    fast_m_s = speed_m_s * decades(-5.0, -1.0)
    box = StateBox(
        z_m=around(wide_m * generator.uniform(-1.0, 1.0), wide_m),
        x_m=around(range_m, range_m * decades(-4.0, -0.7)),
        vz_m_s=around(fast_m_s * generator.uniform(-1.0, 1.0), fast_m_s),
        vx_m_s=around(-speed_m_s, speed_m_s * decades(-5.0, -0.3)),
        y_m=around(wide_m * generator.uniform(-1.0, 1.0), wide_m),
        vy_m_s=around(fast_m_s * generator.uniform(-1.0, 1.0), fast_m_s),
    )

    errors_rad = decades(-6.0, -2.0), decades(-6.0, -2.0)
    if number % 3 == 0:
        errors_rad = (decades(-60.0, -6.0),) * 2
    sensor = AngleSensor(
        step_s * int(generator.integers(1, 4)),
        *errors_rad,
        2.0 * range_m,
        error_at_nominal_range_y_rad=None if number % 3 == 1 else 0.0,
        error_at_zero_range_y_rad=0.0,
        miss_probability=0.4 if often(0.3) else 0.0,
    )
    impulse_m_s = max(wide_m / (steps * step_s), fast_m_s) * decades(-1.0, 1.0)
    return Scenario(
        name=f"precise {number}",
        nominal_range_m=range_m,
        closing_speed_m_s=speed_m_s,
        step_s=step_s,
        noise=NoiseKind.GAME if often(0.5) else NoiseKind.RANDOM,
        tie=TieRule.RANDOM,
        uncertainty=box,
        dispersion=box,
        angle_sensor=sensor,
        range_sensor=RangeSensor(2.0 * step_s, decades(-12.0, -0.5)) if often(0.4) else None,
        thruster=Thruster(
            30.0 * impulse_m_s,
            0.01 * impulse_m_s,
            impulse_m_s,
            execution_error_relative=0.05 if often(0.5) else 0.0,
            pointing_error_rad=decades(-4.0, -0.5) if often(0.5) else 0.0,
            delay_steps=int(generator.integers(3)),
        ),
        information_set=SetSettings(
            sections=2,
            fewest_sections=2,
            range_threshold_m=1e-3 * range_m,
            disturbance_m_s2=wide_m / (steps * step_s) ** 2 * decades(-3.0, 0.0)
            if often(0.5)
            else 0.0,
        ),
    )


@pytest.mark.parametrize(
    "number", [*range(6), *(pytest.param(n, marks=pytest.mark.thorough) for n in range(6, 300))]
)
def test_random_flights_with_precise_angles_have_finite_impulses(number: int) -> None:
    scenario = random_scenario(number)
    for strategy in BASELINES:
        results = simulate(scenario, 4, strategy=strategy)
        assert np.isfinite(results.impulse_m_s).all(), strategy
