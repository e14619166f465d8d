"""Interpolation of tables of states, compared with exact rationals."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import accumulate

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.experiments.common.ephemeris import interpolation
from infoset.experiments.common.ephemeris.interpolation import (
    Interpolated,
    hermite,
    interpolate,
    lagrange,
)

Polynomial = list[Fraction]
"""Coefficients, the constant first."""


def without_drift(_seconds: Fraction) -> float:
    return 0.0


def value(polynomial: Polynomial, time: Fraction) -> Fraction:
    return sum((each * time**power for power, each in enumerate(polynomial)), Fraction(0))


def derivative(polynomial: Polynomial) -> Polynomial:
    return [power * each for power, each in enumerate(polynomial)][1:]


def random_polynomial(generator: np.random.Generator, degree: int, time_unit: int) -> Polynomial:
    """A polynomial with whole coefficients in units of a time, of the size of an orbit around the
    Sun.
    """
    coefficients = generator.integers(-(10**9), 10**9, size=degree + 1).tolist()
    return [Fraction(each, time_unit**power) for power, each in enumerate(coefficients)]


def table_of(polynomials: list[Polynomial], times: list[Fraction]) -> Floats:
    rates = [derivative(each) for each in polynomials]
    return np.array(
        [
            [[float(value(each, time)) for each in kind] for kind in (polynomials, rates)]
            for time in times
        ]
    )


def at_zero(newton: list[Fraction], nodes: list[Fraction]) -> tuple[float, float]:
    """Value and derivative at zero of a polynomial in Newton's form."""
    position = newton[-1]
    velocity = Fraction(0)
    for coefficient, node in zip(
        reversed(newton[:-1]), reversed(nodes[: len(newton) - 1]), strict=True
    ):
        velocity = position - node * velocity
        position = coefficient - node * position
    return float(position), float(velocity)


def exact_hermite(times: list[Fraction], states: Floats) -> Floats:
    """Position and velocity at time zero of the polynomial by divided differences with repeated
    nodes.
    """
    nodes = [time for time in times for _ in range(2)]
    result = np.empty((2, 3))
    for axis in range(3):
        column = [Fraction(state[0, axis]) for state in states for _ in range(2)]
        rates = [Fraction(state[1, axis]) for state in states for _ in range(2)]
        newton = [column[0]]
        for order in range(1, len(nodes)):
            column = [
                rates[row]
                if nodes[row + order] == nodes[row]
                else (column[row + 1] - column[row]) / (nodes[row + order] - nodes[row])
                for row in range(len(column) - 1)
            ]
            newton.append(column[0])
        result[:, axis] = at_zero(newton, nodes)
    return result


def exact_lagrange(times: list[Fraction], states: Floats) -> Floats:
    """Values at time zero of the polynomials through positions and velocities."""
    result = np.zeros((2, 3), dtype=object)
    for row, time in enumerate(times):
        weight = Fraction(1)
        for other in times[:row] + times[row + 1 :]:
            weight *= other / (other - time)
        result += weight * np.vectorize(Fraction, otypes=[object])(states[row])
    return result.astype(float)


def summed(lengths: Sequence[int], begin: Fraction) -> list[Fraction]:
    """Times from a beginning, with steps of these lengths between them."""
    return list(accumulate(map(Fraction, lengths), initial=begin))


def random_times(
    generator: np.random.Generator, count: int, first: int, second: int
) -> list[Fraction]:
    """Times with a change of the step in the middle; zero is not one of them."""
    lengths = [first] * (count // 2) + [second] * (count - count // 2)
    begin = Fraction(-sum(lengths[: count // 2])) + Fraction(
        int(generator.integers(1, 99)), 100
    ) * min(first, second)
    return summed(lengths, begin)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("method", ["HERMITE", "LAGRANGE"])
def test_polynomial_equals_exact_rational_interpolation(method: str, seed: int) -> None:
    """Random tables with equal steps, as near and as large as those of an orbit around the Sun."""
    generator = np.random.default_rng(seed)
    step = int(10 ** generator.uniform(1, 5))
    size = int(generator.integers(2, 10))
    times = random_times(generator, size, step, step)[:size]
    states = generator.normal(size=(size, 2, 3)) * 1e4
    states[:, 0] = 1e11 + np.cumsum(states[:, 1] * step, axis=0)
    relative = np.array([float(time) for time in times])

    polynomial, exact = (
        (hermite, exact_hermite) if method == "HERMITE" else (lagrange, exact_lagrange)
    )
    found = polynomial(relative, states)

    # In the middle of nine equal steps the weights have a sum below 100, and each product has a
    # rounding error.
    spread = np.ptp(states[:, 0], axis=0).max() + step * np.abs(states[:, 1]).max()
    scale = np.array([1e11 + spread, spread / step])[:, None]
    np.testing.assert_allclose(
        found / scale, exact(times, states) / scale, rtol=0.0, atol=100.0 * 2.0**-52
    )


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("method", "degree"), [("HERMITE", 15), ("LAGRANGE", 6)])
def test_table_of_a_polynomial_gives_this_polynomial(method: str, degree: int, seed: int) -> None:
    """Eight states determine a polynomial of degree 15 by Hermite's method, and of degree 7 by
    Lagrange's.
    """
    generator = np.random.default_rng(seed)
    step = 600
    polynomials = [random_polynomial(generator, degree, step * 8) for _ in range(3)]
    times = [Fraction(step * row + 1, 3) for row in range(-20, 20)]
    epoch = Fraction(int(generator.integers(-2000, 2000))) + Fraction(1, 7)

    found = interpolate(epoch, times, table_of(polynomials, times), method, 7, without_drift)

    assert found.degree == 7
    position = [float(value(each, epoch)) for each in polynomials]
    velocity = [float(value(derivative(each), epoch)) for each in polynomials]
    # Coefficients are below 1e9 within 20 / 24 of the unit of time: values below 1e10 have
    # roundings of 1e-6, which the weights of Hermite's method, below 10 in the middle of a table,
    # add up.
    np.testing.assert_allclose(found.state[0], position, rtol=0.0, atol=1e-3)
    np.testing.assert_allclose(found.state[1], velocity, rtol=0.0, atol=1e-5)


def orbit(times: list[Fraction]) -> Floats:
    """A circular orbit around the Sun in a plane, m and m/s: its derivatives are known."""
    radius_m, rate = 1.5e11, 2e-7
    angles = rate * np.array([float(time) for time in times])
    none = np.zeros_like(angles)
    positions = radius_m * np.stack([np.cos(angles), np.sin(angles), none], axis=1)
    velocities = rate * radius_m * np.stack([-np.sin(angles), np.cos(angles), none], axis=1)
    return np.stack([positions, velocities], axis=1)


@pytest.mark.parametrize(
    ("first", "second"), [(86400, 60), (86400, 600), (3600, 60), (600, 86400), (60, 3600)]
)
@pytest.mark.parametrize("interval", range(-4, 4))
@pytest.mark.parametrize("method", ["HERMITE", "LAGRANGE"])
def test_state_near_a_change_of_the_step_is_on_the_orbit(
    method: str, interval: int, first: int, second: int
) -> None:
    """The error was 0.1 to 5 000 km: the window was that of the nearest mean time."""
    times = summed([first] * 12 + [second] * 12, Fraction(-12 * first))
    row = 12 + interval
    epoch = times[row] + Fraction(57, 100) * (times[row + 1] - times[row])

    found = interpolate(epoch, times, orbit(times), method, 7, without_drift)

    error_m, error_m_s = np.linalg.norm(found.state - orbit([epoch])[0], axis=1)
    # Positions have roundings of 3e-5 m. The error of degree 7 with steps of a day is below (2e-7
    # 86400)^8 1.5e11 m 273 / 10^5 = 3 mm; the velocity by Hermite has the roundings per step of 60
    # s.
    assert error_m < 1e-2
    assert error_m_s < 1e-5
    assert max(found.error[0], 1e-4) * 10.0 > error_m


@pytest.mark.parametrize("count", range(2, 8))
def test_short_table_has_the_greatest_possible_degree(count: int) -> None:
    times = [Fraction(60 * row) for row in range(count)]

    found = interpolate(Fraction(30), times, orbit(times), "HERMITE", 7, without_drift)

    assert found.degree == count - 1


@pytest.mark.parametrize("row", [0, 1, 4])
@pytest.mark.parametrize("method", interpolation.METHODS)
def test_tabulated_epoch_is_the_tabulated_state(method: str, row: int) -> None:
    times = [Fraction(60 * number) for number in range(5)]
    states = orbit(times)

    found = interpolate(times[row], times, states, method, 7, without_drift)

    np.testing.assert_array_equal(found.state, states[row])
    assert (found.method, found.nearest_s) == ("TABULATED", 0.0)


def test_table_of_one_state_has_the_state_of_its_epoch() -> None:
    times = [Fraction(60)]

    assert (
        interpolate(Fraction(60), times, orbit(times), "HERMITE", 7, without_drift).method
        == "TABULATED"
    )
    with pytest.raises(ValueError, match="outside the table"):
        interpolate(Fraction(61), times, orbit(times), "HERMITE", 7, without_drift)


def test_linear_interpolation_is_the_mean_in_the_middle_of_an_interval() -> None:
    times = [Fraction(60 * number) for number in range(5)]
    states = orbit(times)

    found = interpolate(Fraction(90), times, states, "LINEAR", 1, without_drift)

    np.testing.assert_allclose(found.state, 0.5 * (states[1] + states[2]), rtol=1e-15)
    # The sagitta of an arc of 60 s: rate^2 radius 60^2 / 8 = 2.7 m.
    assert found.error[0] == pytest.approx(2.7, rel=1e-3)


def gap_after(step: int, gap: int) -> tuple[list[Fraction], Fraction]:
    times = summed([step] * 8 + [gap] + [step] * 8, Fraction(0))
    return times, times[8] + Fraction(gap, 2)


def test_epoch_in_a_gap_is_refused() -> None:
    times, epoch = gap_after(60, 60 * 21)

    with pytest.raises(
        ValueError, match=r"in a gap of 1260 s, 21 times the steps beside it \(at most 20\)"
    ):
        interpolate(epoch, times, orbit(times), "HERMITE", 7, without_drift)


def test_interval_of_twenty_steps_is_interpolated() -> None:
    times, epoch = gap_after(60, 60 * 20)

    found = interpolate(epoch, times, orbit(times), "HERMITE", 7, without_drift)

    assert np.linalg.norm(found.state - orbit([epoch])[0], axis=1)[0] < 1e-2


def test_epoch_next_to_a_gap_is_interpolated() -> None:
    times, _ = gap_after(60, 86400)

    found = interpolate(times[7] + 30, times, orbit(times), "HERMITE", 7, without_drift)

    assert np.linalg.norm(found.state - orbit([times[7] + 30])[0], axis=1)[0] < 1e-2


def test_drift_of_the_clock_stretches_the_derivatives() -> None:
    """A clock that is fast by 1e-6: positions are those of its table, velocities are per second of
    the other clock.
    """
    slow = [Fraction(60 * row) for row in range(10)]
    fast = [time * Fraction(1_000_000, 1_000_001) for time in slow]
    epoch = Fraction(301)

    expected = interpolate(epoch, slow, orbit(slow), "HERMITE", 7, without_drift)
    found: Interpolated = interpolate(
        epoch * Fraction(1_000_000, 1_000_001),
        fast,
        orbit(slow),
        "HERMITE",
        7,
        lambda time: float(time) * 1e-6,
    )

    # Times have relative roundings of 1e-16, at 30 km/s and 300 s below 1e-8 m; positions 3e-5 m.
    np.testing.assert_allclose(found.state[0], expected.state[0], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(found.state[1], expected.state[1], rtol=0.0, atol=1e-5)
