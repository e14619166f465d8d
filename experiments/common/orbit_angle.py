"""Angle of the orbit during a problem, within which linear motion is meaningful."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal

from experiments.common.toml_file import KeyPath, Problem

MOST_RADIANS = Decimal(1000)
LEAST_RADIANS = Decimal("1e-9")


def angle_problems(path: KeyPath, duration_s: Decimal | None, rate_rad_s: Decimal | None) -> Iterator[Problem]:
    """Yield a problem if the orbit turns by an unlikely angle in a time; wrong or missing values yield none."""
    if duration_s is None or rate_rad_s is None or duration_s <= 0 or rate_rad_s <= 0:
        return
    angle = duration_s * rate_rad_s
    if not LEAST_RADIANS <= angle <= MOST_RADIANS:
        yield Problem(
            path,
            f"is {float(angle):.3g} radians of the orbit; {LEAST_RADIANS:g} to {MOST_RADIANS} make sense",
            f"check the units of orbit_rate_rad_s and {path[-1]}",
        )
