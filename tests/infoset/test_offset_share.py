"""The lower bound of the miss with images of a point beside the centre: how far the measured angles
of two motions differ.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from infoset.sensors import Apart, OffsetCamera

PIXEL_RAD = 1e-3
CENTROID_M = 1.0


def camera(*offset_m: float) -> OffsetCamera:
    return OffsetCamera(
        1.0, PIXEL_RAD, CENTROID_M, phase_angle_rad=1.0, sun_angle_rad=0.0, offset_m=offset_m
    )


def apart(z_m: tuple[float, float], x_m: tuple[float, float]) -> Apart:
    """Return the difference of two positions (z, x); the velocities are not used."""
    unused = np.zeros(1)
    farthest_m = max(map(math.hypot, z_m, x_m))
    return Apart(
        offset_m=np.array([[abs(z_m[0] - z_m[1]) + max(map(abs, z_m)) / min(x_m) * np.ptp(x_m)]]),
        predicted_miss_m=unused[None],
        shift_m=np.array([np.ptp(x_m)]),
        range_m=np.array([min(x_m)]),
        farthest_m=np.array([farthest_m]),
        slope=unused,
        closing_speed_m_s=unused,
    )


def half_difference(offset_m: float, z_m: tuple[float, float], x_m: tuple[float, float]) -> float:
    """Return half of the difference of the angles of the two points, in units of the smaller
    bound.
    """
    first, second = (math.atan2(z + offset_m, x) for z, x in zip(z_m, x_m, strict=True))
    bound_rad = PIXEL_RAD + CENTROID_M / max(map(math.hypot, z_m, x_m))
    return 0.5 * abs(first - second) / bound_rad


def test_offset_is_seen_at_two_ranges_although_the_centres_have_one_direction() -> None:
    z_m = (0.0, 0.0)
    x_m = (1000.0, 1100.0)
    true = half_difference(20.0, z_m, x_m)
    (share,) = camera(20.0).share(apart(z_m, x_m))

    # 1 / 1000 - 1 / 1100 is at most 100 / 1000^2, by a factor of 1.1.
    assert true <= share <= 1.1 * (1.0 + 1e-3) * true
    (without,) = camera(0.0).share(apart(z_m, x_m))
    assert without == 0.0


def test_offset_does_not_matter_at_one_range() -> None:
    at = apart((3.0, -4.0), (1000.0, 1000.0))
    assert camera(20.0).share(at) == pytest.approx(camera(0.0).share(at))


def test_measured_angles_differ_by_at_most_the_share() -> None:
    draws = np.random.default_rng(3)
    for _ in range(2000):
        first_m, second_m = draws.uniform(-50.0, 50.0, 2)
        x_m = (1000.0, 1000.0 + draws.uniform(0.0, 200.0))
        offset_m = draws.uniform(-100.0, 100.0)
        (share,) = camera(offset_m).share(apart((first_m, second_m), x_m))
        assert half_difference(offset_m, (first_m, second_m), x_m) <= share
