"""Print the radius of the orbit with which the nonlinear columns of Shorikov and Goranov (2021)
were computed.

    python benchmarks/published_radius.py

Least squares on the printed differences, nonlinear minus linear. These hardly depend on the
control, whose digits the paper rounds. Each difference is divided by the rounding of both numbers.
The unknown is the inverse of the radius, to which the differences are nearly proportional. A first
fit, with a loss that limits the effect of misprints, starts from 9000 km; the second leaves out
differences that are then off by more than five roundings.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.optimize import least_squares

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import to_paper
from infoset.experiments.common.input_file import load_problem
from infoset.experiments.reachability.published import (
    PROBLEM,
    flown_controls,
    printed_tables,
    published_motion,
)
from infoset.rendezvous.reachability import minimum_energy, solve

ROUNDING = np.array([0.1, 0.1, 0.1, 0.01, 0.01, 0.01])
"""Largest error of a difference of two rounded states, m and m/s."""
GROSS = 5.0


def main() -> None:
    """Fit and print."""
    rendezvous = load_problem(PROBLEM)
    problem = rendezvous.problem
    controls = flown_controls(rendezvous, minimum_energy(solve(problem).optimal))
    linear = to_paper(problem.run(controls))[:, 1:]
    printed = np.array([table.nonlinear - table.linear for table in printed_tables()])

    def residuals(curvature_1_mm: Floats) -> Floats:
        motion = published_motion(rendezvous.truth.orbit, 1e6 / float(curvature_1_mm[0]))
        pushes = rendezvous.unit_m_s2 * controls
        nonlinear = to_paper(motion.fly(problem.initial, pushes, rendezvous.period_s))[:, 1:]
        return np.asarray((nonlinear - linear - printed) / ROUNDING).ravel()

    rough = least_squares(residuals, [1.0 / 9.0], loss="soft_l1")
    kept = np.abs(rough.fun) <= GROSS
    fit = least_squares(lambda curvature_1_mm: residuals(curvature_1_mm)[kept], rough.x)
    radius_km = 1e3 / fit.x[0]
    relative = np.sqrt(2.0 * fit.cost / (kept.sum() - 1)) / np.linalg.norm(fit.jac) / fit.x[0]
    sys.stdout.write(
        f"radius {radius_km:.2f} +- {radius_km * relative:.2f} km from {kept.sum()} differences\n"
    )
    ends = residuals(np.array([1.0 / 0.09]))
    sys.stdout.write(
        f"radius 90 km: {int((np.abs(ends) <= 1.0).sum())} of {ends.size} within the rounding\n"
    )
    for index in np.flatnonzero(np.abs(ends) > 1.0):
        table, t, component = np.unravel_index(index, printed.shape)
        off = ends[index] * ROUNDING[component]
        sys.stdout.write(f"  table {table + 1}, x{component + 1}({t + 1}): off by {off:.3g}\n")


if __name__ == "__main__":
    main()
