from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from infoset.rendezvous.multipoint import Meet, Tour, TourTarget
from infoset.rendezvous.relative_motion import ClohessyWiltshire

Make = Callable[..., Tour]
RATE = 1.13e-3
# T1 to T3 of the acceptance, then three more: (x, y, z, x', -2 n x, z') at t = 0.
TARGETS = np.array(
    [
        [100.0, 2000.0, 50.0, 0.05, -2 * RATE * 100.0, 0.02],
        [-150.0, 3500.0, -80.0, -0.10, 2 * RATE * 150.0, 0.05],
        [200.0, 5000.0, 0.0, 0.0, -2 * RATE * 200.0, -0.10],
        [-300.0, 1000.0, 100.0, 0.0, 2 * RATE * 300.0, 0.03],
        [250.0, -1500.0, -40.0, 0.02, -2 * RATE * 250.0, 0.0],
        [50.0, 2500.0, -140.0, 0.02, -2 * RATE * 50.0, 0.0],
    ]
)


@pytest.fixture(scope="session")
def tours() -> Make:
    """Makes tours of the first few targets."""

    def make(count: int, meets: Sequence[Meet] = (), dwell_s: Sequence[float] = ()) -> Tour:
        visits = zip(meets or [Meet.FLYBY] * count, dwell_s or [0.0] * count, strict=True)
        targets = tuple(TourTarget(f"T{number}", *visit) for number, visit in enumerate(visits, 1))
        return Tour(ClohessyWiltshire(RATE), targets, TARGETS[:count], np.zeros(6))

    return make
