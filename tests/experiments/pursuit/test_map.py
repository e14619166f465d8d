"""Capture times of a column of a map, over the thrust of the evader."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.experiments.common.input_file import load_problem
from infoset.experiments.pursuit.map import game_at
from infoset.rendezvous.pursuit_evasion import CaptureSolution, solve
from infoset.rendezvous.pursuit_evasion._branch import Ending, follow
from infoset.rendezvous.pursuit_evasion._pair import COARSE, ROUGH, Node
from infoset.rendezvous.pursuit_evasion.game import ScaledGame, scaled_game


def solved(phase_deg: float, thrust_ratio: float) -> CaptureSolution:
    values = {"phase_deg": phase_deg, "thrust_ratio": thrust_ratio}
    return solve(game_at(load_problem("geo-pursuit"), values), change_branch=False)


def scaled(phase_deg: float, thrust_ratio: float) -> ScaledGame:
    return scaled_game(
        game_at(load_problem("geo-pursuit"), {"phase_deg": phase_deg, "thrust_ratio": thrust_ratio})
    )


@pytest.mark.parametrize("phase_deg", [-24.0, 0.0, 12.0, 28.0])
def test_capture_time_does_not_fall_as_the_thrust_of_the_evader_rises(phase_deg: float) -> None:
    solutions = [solved(phase_deg, ratio) for ratio in np.linspace(0.0, 0.8, 9)]

    times_s = [solution.capture.time_s for solution in solutions if solution.capture is not None]

    assert len(times_s) >= 8
    assert np.all(np.diff(times_s) > 0.0)


def test_extremal_continued_in_thrust_may_differ_from_the_solution() -> None:
    # Two branches exist over this column. The one at 70 % of the pursuer's thrust continues
    # smoothly up to 80 %, but there the branch from T = 0 keeps the evader away at its capture
    # time: a point cannot start at its neighbour.
    capture = solved(28.0, 0.7).capture
    assert capture is not None
    continued: Node = capture.extremal
    for ratio in np.linspace(0.705, 0.8, 20):
        game = scaled(28.0, float(ratio))
        begin = game.pair.solve(
            continued.vector,
            continued.duration,
            0.0,
            time_free=False,
            tolerance=COARSE,
            close=ROUGH,
        )
        assert begin is not None
        branch = follow(game.pair, begin, 0.0, game.latest)
        assert branch.ending is Ending.CAPTURE
        continued = branch.last

    whole = solved(28.0, 0.8)

    assert whole.capture is not None
    time_s = continued.duration * whole.units.time_s
    distance_m = np.interp(time_s, whole.curve.duration_s, whole.curve.distance_m)
    assert continued.is_saddle
    assert time_s < 0.75 * whole.capture.time_s
    assert distance_m > 1000e3
