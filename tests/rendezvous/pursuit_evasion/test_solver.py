from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from infoset.arrays import Floats
from infoset.rendezvous.pursuit_evasion import (
    Capture,
    CaptureSolution,
    CertificateVerdict,
    Game,
    Gravity,
    Player,
    solve,
)
from infoset.rendezvous.pursuit_evasion._branch import Ending, follow
from infoset.rendezvous.pursuit_evasion._pair import Node, Pair
from infoset.rendezvous.pursuit_evasion.game import scaled_game, units_of

from .conftest import EARTH_M, MU_M3_S2, MakeGame
from .linear_game import capture_s
from .published import CASES, Case

GEO_M = 42166e3
OFFSET_M = np.array([100e3, 1500e3, 200e3])
DRIFT_M_S = np.array([10.0, -20.0, 15.0])


def captured(solution: CaptureSolution) -> Capture:
    assert solution.verdict is CertificateVerdict.CAPTURED
    assert solution.capture is not None
    return solution.capture


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.thrust_n:g}N")
def test_the_slides_cases(case: Case, slides: MakeGame) -> None:
    solution = solve(slides(case.thrust_n))
    capture = captured(solution)
    units = solution.units
    assert solution.branch_changes == 0
    assert units.length_m == pytest.approx(42166e3, rel=1e-12)
    assert capture.time_s == pytest.approx(case.capture_s, rel=1e-9)
    assert capture.pursuer.propellant_kg == pytest.approx(case.propellant_kg[0], rel=1e-9)
    assert capture.evader.propellant_kg == pytest.approx(case.propellant_kg[1], rel=1e-9)
    assert capture.closing_speed_m_s / 1e3 == pytest.approx(case.closing_km_s, abs=1e-10)
    np.testing.assert_allclose(capture.curvature, case.curvature, atol=5e-6)
    end = np.array(case.end)
    found = np.concatenate(
        [
            capture.position_m / units.length_m,
            capture.pursuer.velocity_m_s / units.speed_m_s,
            capture.evader.velocity_m_s / units.speed_m_s,
            capture.direction,
            [capture.time_s / units.time_s],
        ]
    )
    np.testing.assert_allclose(found, end, rtol=1e-8, atol=1e-10)
    costates = np.concatenate([capture.pursuer.costate_at_start, capture.evader.costate_at_start])
    np.testing.assert_allclose(costates, case.costates, rtol=1e-8, atol=1e-8)
    assert capture.residual < 1e-10


def test_a_capture_within_seconds_is_found(slides: MakeGame) -> None:
    game = slides()
    x, y, z = game.pursuer.position_m
    evader = replace(game.pursuer, position_m=(x, y, z + 0.1), thrust_n=10.0)
    near = captured(solve(replace(game, evader=evader)))
    # (a_P - a_E) t^2 / 2 = 0.1 m, with 20 N and 10 N on 2000 kg.
    assert near.time_s == pytest.approx(math.sqrt(0.2 / 0.005), rel=1e-4)


def test_a_coasting_evader_is_captured_the_first_time_it_can_be(slides: MakeGame) -> None:
    game = slides(0.0)
    capture = captured(solve(game))
    units = units_of(game)
    pair = scaled_game(game).pair
    first = pair.begin(10.0, 0.0)
    assert first is not None
    # There is another extremal at 138928 s; before and after the first capture l changes its sign.
    branch = follow(pair, first, -math.inf, capture.time_s / units.time_s * 1.02)
    assert branch.ending is Ending.TIME
    assert branch.last.distance < 0.0
    assert capture.time_s == pytest.approx(34287.714264, abs=1e-5)


@pytest.mark.parametrize("thrust_n", [20.0, 25.0])
@pytest.mark.parametrize("radius_m", [0.0, 100e3])
def test_evader_that_is_not_weaker_is_not_reported_as_captured(
    thrust_n: float, radius_m: float, slides: MakeGame
) -> None:
    solution = solve(slides(thrust_n, capture_radius_m=radius_m))
    assert solution.capture is None
    assert (solution.curve.distance_m > radius_m).all()
    if thrust_n == 20.0:
        assert (solution.verdict, solution.exhausted) == (CertificateVerdict.ESCAPES, "pursuer")
    else:  # its propellant is spent first: what it does then is not looked at
        assert (solution.verdict, solution.exhausted) == (
            CertificateVerdict.PROPELLANT_EXHAUSTED,
            "evader",
        )


def test_verdict_is_exhausted_if_propellant_is_spent_before_the_capture(slides: MakeGame) -> None:
    solution = solve(slides(dry_kg=1800.0))
    assert (solution.verdict, solution.exhausted) == (
        CertificateVerdict.PROPELLANT_EXHAUSTED,
        "pursuer",
    )
    assert solution.looked_at_s == pytest.approx(200.0 * 350.0 * 9.80665 / 20.0)
    assert solution.looked_at_s < 45343.6


def test_game_is_searched_until_its_longest_duration(slides: MakeGame) -> None:
    game = slides()
    solution = solve(Game(game.gravity, game.pursuer, game.evader, longest_s=20e3))
    assert (solution.verdict, solution.exhausted) == (CertificateVerdict.ESCAPES, None)
    assert solution.looked_at_s == pytest.approx(20e3, rel=1e-6)


@pytest.fixture(scope="module")
def linear_capture_s() -> float:
    """All shares of the linear game have the same time of capture."""
    found = capture_s(OFFSET_M, DRIFT_M_S, 0.005, math.sqrt(MU_M3_S2 / GEO_M**3), until_s=25e3)
    assert found == pytest.approx(21366.29566606, rel=1e-11)
    return found


# Theory, analytic checks: pursuer on a circular orbit, evader offset along the arc, masses that
# stay.
@pytest.mark.parametrize(
    ("share", "difference"), [(1.0, -4.278e-3), (0.1, -4.566e-4), (0.01, -4.595e-5)]
)
def test_small_games_approach_the_linear_one(
    share: float, difference: float, linear_capture_s: float
) -> None:
    axis = GEO_M
    offset = OFFSET_M
    drift = DRIFT_M_S
    rate = math.sqrt(MU_M3_S2 / axis**3)
    (x, y, z), (vx, vy, vz) = share * offset, share * drift
    angle = y / axis
    radius = axis + x
    outward = np.array([math.cos(angle), math.sin(angle), 0.0])
    ahead = np.array([-math.sin(angle), math.cos(angle), 0.0])
    position = radius * outward + np.array([0.0, 0.0, z])
    velocity = vx * outward + radius * (rate + vy / axis) * ahead + np.array([0.0, 0.0, vz])
    pursuer = Player(
        (axis, 0.0, 0.0), (0.0, rate * axis, 0.0), 2000.0, 200.0, share * 20.0, math.inf
    )
    evader = Player(tuple(position), tuple(velocity), 2000.0, 200.0, share * 10.0, math.inf)
    found = captured(solve(Game(Gravity(MU_M3_S2, EARTH_M), pursuer, evader)))
    assert found.time_s / linear_capture_s - 1.0 == pytest.approx(
        difference, abs=5e-4 * abs(difference)
    )


def rates(t: float, y: Floats, thrust: float, mass: float, flow: float) -> Floats:
    """The conditions as the theory writes them, for the pursuer, or the evader with its costate
    turned.
    """
    r = y[:3]
    v = y[3:6]
    lr = y[6:9]
    lv = y[9:]
    cube = float(r @ r) ** 1.5
    push = thrust / (mass - flow * t) * lv / np.linalg.norm(lv)
    turned = lv / cube - 3.0 * r * (lv @ r) / (cube * float(r @ r))
    return np.concatenate([v, -r / cube + push, turned, -lr])


def independent_capture(game: Game, capture: Capture) -> float:
    """Shoot forward on 13 unknowns with SciPy from a guess a little off, nondimensional; return the
    capture time, s.
    """
    units = units_of(game)
    pair = scaled_game(game, units).pair
    crafts = (pair.pursuer, pair.evader)
    node = capture.extremal

    def miss(unknown: Floats) -> Floats:
        ends = []
        for k, craft in enumerate(crafts):
            begin = np.concatenate([craft.start, unknown[6 * k : 6 * k + 6]])  # type: ignore[union-attr]
            found = solve_ivp(
                rates,
                (0.0, unknown[12]),
                begin,
                method="DOP853",
                rtol=1e-10,
                atol=1e-12,
                args=(craft.thrust, craft.mass, craft.flow),  # type: ignore[union-attr]
            )
            ends.append(found.y[:, -1])
        p, e = ends
        scale = [float(p[6:9] @ p[6:9]) - 1.0]
        return np.concatenate([p[:3] - e[:3], p[6:9] - e[6:9], p[9:], e[9:], scale])

    off = 1.0 + 1e-4 * np.cos(np.arange(13.0))
    guess = np.concatenate([node.costates[0], node.costates[1], [node.duration]]) * off
    found, _, _, _ = fsolve(miss, guess, full_output=True, xtol=1e-11)
    assert np.abs(miss(found)).max() < 1e-7
    return float(found[12]) * units.time_s


@pytest.mark.parametrize(
    ("thrust_n", "anomaly_deg", "inclination_deg"), [(10.0, 312.0, 0.3), (10.0, 325.0, 2.0)]
)
def test_other_geometries_agree_with_an_independent_solver(
    thrust_n: float, anomaly_deg: float, inclination_deg: float, slides: MakeGame
) -> None:
    game = slides(thrust_n, anomaly_deg=anomaly_deg, inclination_deg=inclination_deg)
    capture = captured(solve(game))
    assert independent_capture(game, capture) == pytest.approx(capture.time_s, rel=1e-7)


def test_solution_changes_to_a_better_branch_at_a_fold(slides: MakeGame) -> None:
    game = slides(18.0, anomaly_deg=330.0)
    plain = solve(game, change_branch=False)
    changed = solve(game)
    assert plain.verdict is CertificateVerdict.BRANCH_NOT_CERTIFIED
    assert plain.capture is None
    assert captured(changed).time_s > plain.looked_at_s
    assert changed.branch_changes > 0
    assert (changed.curve.distance_m[:-1] > 0.0).all()


def test_a_capture_that_misses_the_conditions_is_not_returned(
    slides: MakeGame, monkeypatch: pytest.MonkeyPatch
) -> None:
    exact = Pair.solve
    game = slides()

    def inexact(
        pair: Pair, guess: Floats, duration: float, distance: float, **how: Any
    ) -> Node | None:
        found = exact(pair, guess, duration, distance, **how)
        return None if found is None else replace(found, residual=1e-8)

    monkeypatch.setattr(Pair, "solve", inexact)
    solution = solve(game, change_branch=False)
    assert solution.verdict is CertificateVerdict.BRANCH_NOT_CERTIFIED
    assert solution.capture is None
