"""Print the guarantees at the last impulse of flights with the set of possible states on board.

    python -m benchmarks.guaranteed_flights [uniform] [bounds] [hidden] [greedy]

The problem and the errors are those of `tests/rendezvous/reachability/test_guided.py`, whose
function compares each promise with the true state. The table is in `docs/guaranteed-rendezvous.md`.
"""

from __future__ import annotations

import sys

import numpy as np

from infoset.rendezvous.reachability import affine_plan
from tests.rendezvous.reachability.arch_rendezvous import arch
from tests.rendezvous.reachability.test_guided import (
    GreedyTruth,
    check_flight,
    extreme_truth,
    hidden_truth,
    uniform_truth,
)

ERRORS = {
    "uniform": (uniform_truth, 200),
    "bounds": (extreme_truth, 150),
    "hidden": (hidden_truth, 16),
    "greedy": (GreedyTruth, 150),
}


def main() -> None:
    """Fly and print a line for each kind of errors."""
    plan = affine_plan(arch(10, 10.0, 6.0), 3)
    for name in sys.argv[1:] or ERRORS:
        make, flights = ERRORS[name]
        last = [
            check_flight(plan, make(plan.problem, np.random.default_rng(seed)))
            for seed in range(flights)
        ]
        print(f"{name}: {flights} flights, median {np.median(last):.3f}, most {max(last):.3f}")


if __name__ == "__main__":
    main()
