"""The orbital pursuit-evasion game: without and with an initial guess, and compared with SciPy.

Times are processor times, the shortest of many rounds, so that other work on the machine has little
effect.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from infoset.experiments.common.input_file import load_problem
from infoset.rendezvous.pursuit_evasion import CaptureSolution, Game, solve
from infoset.rendezvous.pursuit_evasion.game import scaled_craft, units_of

Floats = NDArray[np.float64]
Check = Callable[[str, float, float, str], None]

COLD_MS, TIMES_FASTER = 50.0, 20.0


@pytest.fixture(scope="module")
def game() -> Game:
    """The game of the slides: thrusts of 20 N and 10 N."""
    game: Game = load_problem("geo-pursuit").game
    return game


@pytest.fixture(scope="module")
def solved(game: Game) -> CaptureSolution:
    return solve(game)


def best_s(benchmark: BenchmarkFixture) -> float:
    """Return the shortest time of a round, s."""
    assert benchmark.stats is not None
    return float(benchmark.stats.stats.min)


def seconds(work: Callable[[], object], rounds: int) -> float:
    """Return the shortest processor time of several rounds, s."""
    times = []
    for _ in range(rounds):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


@pytest.mark.benchmark(group="pursuit", timer=time.process_time)
def test_cold(benchmark: BenchmarkFixture, game: Game, under: Check) -> None:
    benchmark.pedantic(solve, args=(game,), rounds=30, warmup_rounds=2)
    under("pursuit, game of the slides without a guess", 1e3 * best_s(benchmark), COLD_MS, "ms")


def rates(t: float, y: Floats, thrust: float, mass: float, flow: float) -> Floats:
    """Rates of state and costate of a player, for mu = 1; the evader's costate is negated."""
    r = y[:3]
    lv = y[9:]
    square = float(r @ r)
    cube = square * math.sqrt(square)
    out = np.empty(12)
    out[:3] = y[3:6]
    out[3:6] = -r / cube + thrust / (mass - flow * t) / math.sqrt(lv @ lv) * lv
    out[6:9] = lv / cube - (3.0 * float(lv @ r) / (cube * square)) * r
    out[9:] = -y[6:9]
    return out


def test_compared_with_scipy(game: Game, solved: CaptureSolution, at_least: Check) -> None:
    """Compare with `solve_ivp` (DOP853) and `fsolve` on 13 unknowns.

    Their guess has a relative error of 1e-4. SciPy's right-hand side is scalar Python with few
    array operations. The solver of the project has no guess.
    """
    assert solved.capture is not None
    units = units_of(game)
    node = solved.capture.extremal
    crafts = [scaled_craft(player, game.gravity, units) for player in (game.pursuer, game.evader)]

    def end_of(k: int, unknown: Floats) -> Floats:
        craft = crafts[k]
        motion = solve_ivp(
            rates,
            (0.0, unknown[12]),
            np.concatenate([craft.start, unknown[6 * k : 6 * k + 6]]),
            method="DOP853",
            rtol=1e-10,
            atol=1e-12,
            args=(craft.thrust, craft.mass, craft.flow),
        )
        return np.asarray(motion.y[:, -1])

    def miss(unknown: Floats) -> Floats:
        p = end_of(0, unknown)
        e = end_of(1, unknown)
        return np.concatenate(
            [p[:3] - e[:3], p[6:9] - e[6:9], p[9:], e[9:], [p[6:9] @ p[6:9] - 1.0]]
        )

    found = np.concatenate([node.costates[0], node.costates[1], [node.duration]])
    guess = found * (1.0 + 1e-4 * np.cos(np.arange(13)))
    times: list[float] = []

    def scipy() -> None:
        times.append(float(fsolve(miss, guess, xtol=1e-11)[12]) * units.time_s)

    theirs = seconds(scipy, 3)
    assert times[-1] == pytest.approx(solved.capture.time_s, rel=1e-7)
    cold = seconds(lambda: solve(game), 20)
    at_least(
        "pursuit without a guess, compared with SciPy from a close guess",
        theirs / cold,
        TIMES_FASTER,
        "x",
    )
