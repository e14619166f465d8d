from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from rendezvous.pursuit_evasion import (
    STATUSES,
    CaptureMap,
    Game,
    PointStatus,
    Verdict,
    capture_map,
    solve,
)

from .conftest import MakeGame

PLACE_DEG = 318.0
"""Where the evader is level with the pursuer."""


def counts(found: CaptureMap) -> Counter[str]:
    return Counter(STATUSES[each].value for each in found.status.ravel())


def test_points_from_neighbours_are_those_solved_from_nothing(slides: MakeGame) -> None:
    columns, rows = np.linspace(-12.0, -3.0, 8), np.array([0.5, 1.5])

    def game_at(phase: float, inclination: float) -> Game:
        return slides(anomaly_deg=PLACE_DEG + phase, inclination_deg=inclination)

    seeded = capture_map(game_at, columns, rows)
    followed = capture_map(game_at, columns, rows, follow_all=True)
    assert set(counts(seeded)) == {"followed", "neighbour"}
    assert counts(seeded)["neighbour"] >= 8
    assert counts(followed) == {"followed": 16}
    assert followed.solved_from_nothing == 16
    np.testing.assert_allclose(seeded.capture_s, followed.capture_s, rtol=1e-7)
    np.testing.assert_allclose(seeded.closing_speed_m_s, followed.closing_speed_m_s, rtol=1e-5)


@pytest.mark.thorough
def test_a_neighbours_answer_that_is_not_the_first_capture_is_replaced(slides: MakeGame) -> None:
    # Ahead of the pursuer an early extremal lives on where the evader has a better branch.
    columns = np.linspace(4.0, 24.0, 11)

    def game_at(phase: float, thrust: float) -> Game:
        return slides(thrust, anomaly_deg=PLACE_DEG + phase)

    found = capture_map(game_at, columns, np.array([18.0]))
    for phase, time_s, status in zip(columns, found.capture_s[0], found.status[0], strict=True):
        cold = solve(game_at(phase, 18.0), change_branch=False)
        if STATUSES[status] in (PointStatus.FOLLOWED, PointStatus.NEIGHBOUR):
            assert cold.capture is not None
            assert time_s == pytest.approx(cold.capture.time_s, rel=1e-6)
        else:
            assert cold.verdict is Verdict.BRANCH_NOT_CERTIFIED


def test_a_wrong_stretch_between_two_right_ends_is_found(low: MakeGame) -> None:
    # Where the evader leads by 0 to 1 degrees there is an early capture, which guesses from the left pass by. The check
    # within the row is beyond it, at 1.7 degrees: it is a surprise beside the row below.
    columns = np.linspace(-0.5, 2.0, 26)
    found = capture_map(low, columns, np.array([0.75, 0.8]))
    for lead, time_s in zip(columns[::3], found.capture_s[1, ::3], strict=True):
        cold = solve(low(lead, 0.8), change_branch=False)
        assert cold.capture is not None
        assert time_s == pytest.approx(cold.capture.time_s, rel=1e-6)
    assert found.capture_s[1].max() > 1.5 * found.capture_s[1].min()


def test_what_is_no_capture_is_masked_and_named(slides: MakeGame) -> None:
    def game_at(thrust: float, phase: float) -> Game:
        if phase < 0.0:
            raise ValueError("no game")
        return slides(thrust)

    told: list[float] = []
    found = capture_map(game_at, np.array([10.0, 20.0, 25.0]), np.array([0.0, -1.0]), progress=told.append)
    assert [STATUSES[each].value for each in found.status[0]] == ["followed", "escapes", "propellant-exhausted"]
    assert [STATUSES[each].value for each in found.status[1]] == ["no-game"] * 3
    assert found.capture_s.mask.tolist() == [[False, True, True], [True, True, True]]
    assert found.count(PointStatus.NO_GAME) == 3
    assert told == [0.5, 1.0]
