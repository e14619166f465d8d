"""The check of a solution by duality."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.rendezvous.reachability.conic import ConeProgram, NoSolutionError


def program_with_solution() -> tuple[ConeProgram, np.ndarray, np.ndarray]:
    """A program over a control with |u| <= 1, and its exact solution and multipliers.

    It minimises the first of 40 states, which are linear in the control.
    """
    generator = np.random.default_rng(5)
    response = 100.0 * generator.standard_normal((40, 3))
    cost = np.zeros(43)
    cost[3] = 1.0
    program = ConeProgram(cost).meet(np.hstack([-response, np.eye(40)]), np.zeros(40))
    program.bound(np.hstack([np.eye(3), np.zeros((3, 40))]), np.zeros(3), np.zeros(43), 1.0)
    size = np.linalg.norm(response[0])
    control = -response[0] / size
    multipliers = np.concatenate([-np.eye(40)[0], [size], response[0]])
    return program, np.concatenate([control, response @ control]), multipliers


def test_multipliers_with_a_small_residual_prove_a_solution() -> None:
    program, point, exact = program_with_solution()
    assert program.violation_and_gap(point, exact)[1] < 1e-13
    # Errors of a solver's tolerance, times 43 variables of sizes up to some hundred, are a large
    # gap.
    noisy = exact + 1e-9 * np.random.default_rng(6).standard_normal(len(exact))
    assert program.violation_and_gap(point, noisy)[1] > 1e-7
    program.checked(point, noisy)


@pytest.mark.parametrize("short", [1e-6, 1e-3, 0.5])
def test_point_that_is_not_optimal_is_refused(short: float) -> None:
    program, point, exact = program_with_solution()
    with pytest.raises(NoSolutionError, match="relative gap"):
        program.checked((1.0 - short) * point, exact)
    generator = np.random.default_rng(7)
    with pytest.raises(NoSolutionError):
        program.checked((1.0 - short) * point, exact + generator.standard_normal(len(exact)))
