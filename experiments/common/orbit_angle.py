"""How far an orbit turns during a problem: where linear motion about it means something."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal

from experiments.common.toml_file import KeyPath, Problem

MOST_RADIANS = Decimal(1000)
LEAST_RADIANS = Decimal("1e-9")


def angle_problems(path: KeyPath, duration_s: Decimal | None, rate_rad_s: Decimal | None) -> Iterator[Problem]:
    """Find whether a time is an unlikely angle of the orbit.

    Parameters
    ----------
    path : tuple of str
        Where the time stands.
    duration_s, rate_rad_s : Decimal or None
        None, or not positive, where they are wrong themselves.
    """
    if duration_s is None or rate_rad_s is None or duration_s <= 0 or rate_rad_s <= 0:
        return
    angle = duration_s * rate_rad_s
    if not LEAST_RADIANS <= angle <= MOST_RADIANS:
        yield Problem(
            path,
            f"is {float(angle):.3g} radians of the orbit; {LEAST_RADIANS:g} to {MOST_RADIANS} make sense",
            f"check the units of orbit_rate_rad_s and {path[-1]}",
        )
