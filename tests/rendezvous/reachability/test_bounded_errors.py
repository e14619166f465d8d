"""A rendezvous with bounded errors: its goal and its constraints for all errors."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.rendezvous.reachability import with_errors
from tests.rendezvous.reachability.bounded_approach import approach, errors, problem


def test_goal_is_the_box_and_free_components_do_not_count() -> None:
    free = with_errors(approach(), errors(), np.zeros(6), np.repeat([2.0, np.inf], 3))

    np.testing.assert_array_equal(free.goal, 0.5 * np.eye(3, 6))


def test_state_after_an_impulse_has_the_execution_error_too() -> None:
    rows = problem().path
    assert rows is not None
    after = (rows.times == 0) & (rows.states[:, 4] == 1.0) & (rows.controls[:, 1] == 1.0)

    # 5 m/s less 1 mm/s and 1 % of 4 m/s.
    assert rows.upper[after] == pytest.approx([5.0 - 1e-3 - 0.04])
    assert rows.lower[after] == pytest.approx([-5.0 + 1e-3 + 0.04])
