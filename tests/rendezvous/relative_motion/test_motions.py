from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import to_paper
from infoset.rendezvous.reachability import MotionModel, motion_of
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    HeldMotion,
    LinearMotion,
    TimeVaryingMotion,
    TschaunerHempel,
    time_varying,
)
from infoset.rendezvous.relative_motion.elliptic_orbit import eccentric_of_mean
from infoset.rendezvous.relative_motion.linear_motion import HeldSegment

RATE = 1.13e-3
MOTIONS: dict[str, Callable[[], LinearMotion]] = {
    "circular": lambda: ClohessyWiltshire(RATE),
    "elliptic": lambda: TschaunerHempel(EllipticOrbit(RATE, 0.3, 1.0)),
    "very elliptic": lambda: TschaunerHempel(EllipticOrbit(RATE, 0.7, -2.0)),
    "any": lambda: TimeVaryingMotion(EllipticOrbit(RATE, 0.3, 1.0).dynamics),
}
# Barseghyan and Stepanyan's Gramian, state (x, x', y, y', z, z'), T = 30 s, w = 0.001176.
PUBLISHED_GRAMIAN = np.array(
    [
        [8997.761636941204, 449.8135383406748, 0.09879027439642714, -10.575438652455434, 0.0, 0.0],
        [
            449.8135383406748,
            30.000027881906004,
            10.595195887584822,
            0.0009878207706748873,
            0.0,
            0.0,
        ],
        [0.09879027439642714, 10.595195887584822, 9004.480111945337, 450.37331832075387, 0.0, 0.0],
        [
            -10.575438652455434,
            0.0009878207706748873,
            450.37331832075387,
            30.03733105775588,
            0.0,
            0.0,
        ],
        [0.0, 0.0, 0.0, 0.0, 8997.759844442951, 449.8133292217318],
        [0.0, 0.0, 0.0, 0.0, 449.8133292217318, 29.987556314081377],
    ]
)


INTERLEAVED = [0, 3, 1, 4, 2, 5]
"""Order of the states of the published Gramian."""


def in_paper_axes(matrix: Floats) -> Floats:
    """Convert the rows and columns of a matrix from Hill's axes to the papers' axes."""
    return to_paper(to_paper(matrix).T).T


def integrated(motion: LinearMotion, start: float, end: float) -> tuple[Floats, Floats, Floats]:
    """Transition, Gramian and effect of a held control by DOP853."""

    def rates(time: float, values: Floats) -> Floats:
        matrix = motion.dynamics(time)
        inputs = np.eye(6)[:, 3:]
        transition = values[:36].reshape(6, 6)
        gramian = values[36:72].reshape(6, 6)
        held = values[72:].reshape(6, 3)
        spread = matrix @ gramian
        parts = (matrix @ transition, spread + spread.T + inputs @ inputs.T, matrix @ held + inputs)
        return np.concatenate([part.ravel() for part in parts])

    begin = np.concatenate([np.eye(6).ravel(), np.zeros(54)])
    found = solve_ivp(rates, (start, end), begin, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    return found[:36].reshape(6, 6), found[36:72].reshape(6, 6), found[72:].reshape(6, 3)


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("duration", [20.0, 900.0, 7000.0])
def test_matrices_satisfy_their_differential_equations(name: str, duration: float) -> None:
    motion = MOTIONS[name]()
    start = 130.0
    transition, gramian, held = integrated(motion, start, start + duration)
    scale = np.array([duration] * 3 + [1.0] * 3)
    weight = scale[None, :] / scale[:, None]
    found = motion.segment(start, start + duration)
    breaks = motion.breaks(start, start + duration)
    assert (breaks[0], breaks[-1]) == (start, start + duration)
    assert (np.diff(breaks) > 0.0).all()
    size = np.abs(transition * weight).max()
    np.testing.assert_allclose(
        found.transition * weight, transition * weight, rtol=0.0, atol=2e-10 * size
    )
    spread = np.sqrt(np.outer(np.diag(gramian), np.diag(gramian)))
    np.testing.assert_allclose(found.gramian / spread, gramian / spread, rtol=0.0, atol=2e-10)
    if isinstance(motion, HeldMotion):
        effect = motion.segment(start, start + duration).held / scale[:, None]
        wanted = held / scale[:, None]
        np.testing.assert_allclose(
            effect, wanted, rtol=0.0, atol=2e-10 * float(np.abs(wanted).max())
        )


def test_gramian_agrees_with_the_published_gramian() -> None:
    found = in_paper_axes(ClohessyWiltshire(0.001176).gramian(0.0, 30.0))[:, INTERLEAVED][
        INTERLEAVED
    ]
    np.testing.assert_allclose(found, PUBLISHED_GRAMIAN, rtol=2e-12, atol=1e-18)


def test_dynamics_are_the_equations_of_two_papers() -> None:
    # x'' = 2 w y', y'' = 3 w^2 y - 2 w x', z'' = -w^2 z: (1.8) of Barseghyan and Stepanyan.
    found = in_paper_axes(ClohessyWiltshire(RATE).dynamics(0.0)) @ np.array(
        [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    )
    expected = [4.0, 5.0, 6.0, 2 * RATE * 5, 3 * RATE**2 * 2 - 2 * RATE * 4, -(RATE**2) * 3]
    np.testing.assert_allclose(found, expected, rtol=1e-15)
    # (2) of Shorikov and Goranov, at perigee, where w' = 0: x'' = 2 w y' - w^2 (r/p - 1) x, and so
    # on.
    orbit = EllipticOrbit(RATE, 0.1)
    e = 0.1
    w = orbit.semi_latus_rate_rad_s * (1.0 + e) ** 2
    r_by_p = 1.0 / (1.0 + e)
    found = in_paper_axes(orbit.dynamics(0.0)) @ np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    pulls = [
        2 * w * 5 - w**2 * (r_by_p - 1),
        -2 * w * 4 + w**2 * (2 * r_by_p + 1) * 2,
        -(w**2) * r_by_p * 3,
    ]
    np.testing.assert_allclose(found, [4.0, 5.0, 6.0, *pulls], rtol=1e-13)


@given(st.floats(0.0, 0.99), st.floats(-50.0, 50.0))
def test_eccentric_anomaly_satisfies_keplers_equation(eccentricity: float, mean: float) -> None:
    found = float(eccentric_of_mean(mean, eccentricity))
    assert found - eccentricity * np.sin(found) == pytest.approx(mean, rel=1e-14, abs=1e-14)


def test_orbit_of_a_semi_major_axis_has_the_identified_matrices() -> None:
    orbit = EllipticOrbit.of_size(1e7, 0.1, 3.986004418e14)
    # Shorikov and Goranov (2021), identified from their tables: frozen at perigee, a period of 180
    # s, 0.15 m/s^2.
    frozen = motion_of(orbit, MotionModel.FROZEN).segment(0.0, 180.0)
    matrix, effect = (in_paper_axes(each) for each in (frozen.transition, 0.15 * frozen.held))
    row = [1.000880159508, 2.552748205224e-3, 0.0, 177.7169731072, 25.08284792087, 0.0]
    np.testing.assert_allclose(matrix[0], row, rtol=1e-12, atol=1e-18)
    assert matrix[2, 2] == pytest.approx(0.9911552814183, rel=1e-12)
    assert matrix[2, 5] == pytest.approx(179.4690033082, rel=1e-12)
    np.testing.assert_allclose(effect[0, :2], [2414.584434285, 225.9057563127], rtol=1e-12)
    assert effect[5, 2] == pytest.approx(26.92035049622, rel=1e-12)
    turn = 2.0 * np.pi / orbit.mean_motion_rad_s
    assert float(orbit.true_anomaly(3.0 * turn)) == pytest.approx(6.0 * np.pi, rel=1e-14)
    assert float(orbit.time_of_eccentric(orbit.eccentric_anomaly(777.0))) == pytest.approx(
        777.0, rel=1e-13
    )


def test_many_intervals_that_do_not_converge_are_refused_in_bounded_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Formerly the number of panels was bounded for each interval only: 75 GB of 1000 of them."""
    sizes = []

    def collocated(_dynamics: object, starts: Floats, _ends: Floats, panels: int) -> HeldSegment:
        count = len(starts)
        sizes.append(count * panels)
        # No two solutions agree.
        transition = np.full((count, 6, 6), float(len(sizes)))
        return HeldSegment(transition, transition, transition[..., :3])

    monkeypatch.setattr(time_varying, "_collocated", collocated)
    motion = TimeVaryingMotion(EllipticOrbit(RATE, 0.3, 1.0).dynamics)
    starts = np.arange(1000.0)

    with pytest.raises(ValueError, match="A\\(t\\) changes too fast"):
        motion.segment(starts, starts + 1.0)
    assert max(sizes) <= 2 * time_varying.MAX_PANELS
