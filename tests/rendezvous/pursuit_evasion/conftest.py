from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from infoset.rendezvous.pursuit_evasion import CaptureSolution, Game, Gravity, Player, solve
from infoset.rendezvous.two_body import OrbitalElements

MU_M3_S2 = 398600.4418e9
EARTH_M = 6378137.0
MakeGame = Callable[..., Game]


def player(
    thrust_n: float,
    *,
    axis_km: float = 42166.0,
    eccentricity: float,
    inclination_deg: float,
    raan_deg: float,
    anomaly_deg: float,
    dry_kg: float = 1000.0,
) -> Player:
    elements = OrbitalElements(
        axis_km * 1e3,
        eccentricity,
        *(math.radians(each) for each in (inclination_deg, raan_deg, 0.0, anomaly_deg)),
    )
    position, velocity = elements.state(MU_M3_S2)
    return Player(tuple(position), tuple(velocity), 2000.0, dry_kg, thrust_n, 350.0)


@pytest.fixture(scope="session")
def slides() -> MakeGame:
    """The slides' case, with another thrust, place or capture radius."""

    def make(
        thrust_n: float = 10.0,
        *,
        anomaly_deg: float = 309.0,
        inclination_deg: float = 0.828,
        capture_radius_m: float = 0.0,
        dry_kg: float = 200.0,
    ) -> Game:
        return Game(
            Gravity(MU_M3_S2, EARTH_M),
            player(
                20.0,
                eccentricity=0.00013,
                inclination_deg=1.565,
                raan_deg=47.0,
                anomaly_deg=350.0,
                dry_kg=dry_kg,
            ),
            player(
                thrust_n,
                eccentricity=0.00016,
                inclination_deg=inclination_deg,
                raan_deg=79.0,
                anomaly_deg=anomaly_deg,
                dry_kg=dry_kg,
            ),
            capture_radius_m,
        )

    return make


@pytest.fixture(scope="session")
def low() -> MakeGame:
    """In low orbit, with J2 and a capture radius: the evader leads by some degrees, its thrust a
    share of 20 N.
    """

    def make(lead_deg: float = 1.6, ratio: float = 0.5, *, j2: float = 1.08262668e-3) -> Game:
        players = []
        for axis_km, inclination_deg, raan_deg, anomaly_deg, thrust_n in (
            (6878.0, 51.6, 10.0, 0.0, 20.0),
            (6888.0, 51.8, 10.1, lead_deg - 0.1, 20.0 * ratio),
        ):
            angles = (math.radians(each) for each in (inclination_deg, raan_deg, 0.0, anomaly_deg))
            position, velocity = OrbitalElements(axis_km * 1e3, 0.001, *angles).state(MU_M3_S2)
            players.append(Player(tuple(position), tuple(velocity), 500.0, 400.0, thrust_n, 300.0))
        return Game(Gravity(MU_M3_S2, EARTH_M, j2, 6378136.3), players[0], players[1], 1e3)

    return make


@pytest.fixture(scope="session")
def solved(slides: MakeGame) -> CaptureSolution:
    """The slides' case, 20 against 10 N."""
    return solve(slides())
