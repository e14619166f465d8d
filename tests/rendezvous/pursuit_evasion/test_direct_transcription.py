"""The pursuer against the evader's fixed optimal path, by SLSQP on its own steering: no adjoints,
no extremals.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from infoset.arrays import Floats
from infoset.rendezvous.pursuit_evasion import CaptureSolution
from infoset.rendezvous.pursuit_evasion.game import scaled_craft
from infoset.rendezvous.pursuit_evasion.paths import extremal_paths

NODES, STEPS = 16, 400


def fly_batch(
    start: Floats, steering: Floats, duration: Floats, thrust: float, mass: float, flow: float
) -> Floats:
    """Fly many craft at once by Runge and Kutta's method: steering (B, NODES, 3) between nodes in
    time, ends (B, 6).
    """
    state = np.repeat(start[None], len(steering), axis=0)
    step = (duration / STEPS)[:, None]

    def rates(share: float, y: Floats) -> Floats:
        place = share * (NODES - 1)
        k = min(int(place), NODES - 2)
        u = steering[:, k] * (k + 1 - place) + steering[:, k + 1] * (place - k)
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        r = y[:, :3]
        cube = np.linalg.norm(r, axis=1, keepdims=True) ** 3
        push = thrust / (mass - flow * share * duration)
        return np.concatenate([y[:, 3:], -r / cube + push[:, None] * u], axis=1)

    for i in range(STEPS):
        a = i / STEPS
        b = (i + 0.5) / STEPS
        c = (i + 1.0) / STEPS
        k1 = rates(a, state)
        k2 = rates(b, state + 0.5 * step * k1)
        k3 = rates(b, state + 0.5 * step * k2)
        k4 = rates(c, state + step * k3)
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_no_steering_captures_the_fixed_path_earlier(seed: int, solved: CaptureSolution) -> None:
    assert solved.capture is not None
    game = solved.game
    units = solved.units
    node = solved.capture.extremal
    pursuer = scaled_craft(game.pursuer, game.gravity, units)
    path = extremal_paths(pursuer, scaled_craft(game.evader, game.gravity, units), node)[1]
    moves = 1e-7

    def gaps(unknowns: Floats) -> Floats:
        steering = unknowns[:, :-1].reshape(len(unknowns), NODES, 3)
        ends = fly_batch(
            pursuer.start, steering, unknowns[:, -1], pursuer.thrust, pursuer.mass, pursuer.flow
        )
        return np.asarray(ends[:, :3] - np.array([path.at(float(t))[:3] for t in unknowns[:, -1]]))

    def slopes(unknown: Floats) -> Floats:
        moved = np.concatenate(
            [unknown + moves * np.eye(len(unknown)), unknown - moves * np.eye(len(unknown))]
        )
        found = gaps(moved)
        return np.asarray((found[: len(unknown)] - found[len(unknown) :]).T / (2.0 * moves))

    # A rough start: outward and along the way, with noise, and a longer time.
    random = np.random.default_rng(seed)
    begin = np.concatenate(
        [
            (
                np.tile([0.2, 1.0, 0.0], (NODES, 1)) + 0.1 * random.standard_normal((NODES, 3))
            ).ravel(),
            [node.duration * 1.05],
        ]
    )
    size = len(begin)
    found = minimize(
        lambda unknown: float(unknown[-1]),
        begin,
        jac=lambda _unknown: np.eye(size)[-1],
        constraints={"type": "eq", "fun": lambda unknown: gaps(unknown[None])[0], "jac": slopes},
        bounds=[(-3.0, 3.0)] * (size - 1) + [(1.0, 6.0)],
        method="SLSQP",
        options={"maxiter": 400, "ftol": 1e-12},
    )
    assert np.abs(gaps(found.x[None])).max() * units.length_m < 1.0
    capture_s = float(found.x[-1]) * units.time_s
    assert capture_s > solved.capture.time_s - 0.01
    assert (
        capture_s < solved.capture.time_s + 60.0
    )  # it is a search that gets there, not one that fails
