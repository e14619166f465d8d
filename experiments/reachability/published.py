"""Numbers of Shorikov and Goranov (2021): rendezvous through reachable sets, tables 1 to 3."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from itertools import pairwise

import numpy as np

from experiments.common.hill_axes import from_paper, to_paper
from experiments.common.published_number import Progress, PublishedNumber, Reference, Reproduction
from experiments.reachability.file import Rendezvous, load_rendezvous
from experiments.reachability.printed_tables import PROBLEM, Comparison, Row, compare_published, corrected
from experiments.reachability.report import fly_members
from infoset.arrays import Floats
from rendezvous.reachability import ReachabilityProblem, solve

PAPER = "reachability"
TITLE = "Shorikov and Goranov (2021), rendezvous through reachable sets"
REMARKS = (
    "The paper does not print its orbit, period and acceleration; they were identified from its tables.",
    "Table 1 is the control of least energy. The paper does not say which optimal controls tables 2 and 3 are. Table 3 "
    "is compared with the nearest optimal control, the controls of table 2 with those that its linear states imply. "
    "Table 2 is near the least sum of absolute values but differs from it.",
    "Linear states of tables 2 and 3 are those of the printed controls, with misprints corrected (the four of table 2 "
    "by the values that its states imply); their tolerance includes the rounding of these controls.",
)
_REFERENCE = Reference(PAPER)
_CONTROL_ROUNDING = 0.5e-4
_STATE_ROUNDING = np.array([0.05, 0.05, 0.05, 0.005, 0.005, 0.005])
_NONLINEAR_MISS = "1.668028"
"""The miss of table 1, from an independent integration of (1)."""
_OFF = ((3, 2, 3),)
"""(table, t, component) of linear states that do not follow from the controls."""
_CONTRADICTED = ((1, 1), (1, 2), (2, 1), (2, 2))
"""(t, component) of the controls of table 2 that its states contradict."""
_NOTES = {
    "misprint": "the states of the table follow from the other value",
    "contradicted": (
        "the states follow from 0.0000 within their rounding, and the printed controls lead past zero by 11 and 18 m. "
        "A tenth of them fits worse than zero"
    ),
    "nonlinear": (
        "does not follow from (1). Tried: (1) integrated to 1e-12 on the orbit of the linear columns, from the printed "
        "and from exact controls; the difference exists already after the first period, 4.6 m where 0.1 m is right"
    ),
    "off": (
        "the state of the printed controls differs by more than their rounding. Tried: the controls as printed, the "
        "corrected ones, and the nearest optimal control"
    ),
}


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    rendezvous = load_rendezvous(PROBLEM)
    solution = solve(rendezvous.problem)
    progress(0.5)
    first, second, third = compare_published(rendezvous, solution)
    # Table 1 is compared with an independent computation, the others with the states of their controls.
    compared = (
        first,
        _implied(rendezvous, second),
        replace(third, ours=replace(third.printed, controls=third.ours.controls)),
    )
    numbers = [_number(row, comparison, rendezvous.problem) for comparison in compared for row in comparison.rows]
    progress(1.0)
    return Reproduction(PAPER, TITLE, ((rendezvous.name, rendezvous.hash),), tuple(numbers), REMARKS)


def _implied(rendezvous: Rendezvous, comparison: Comparison) -> Comparison:
    """Return table 2 with the controls that its states imply, and the states of its corrected controls."""
    problem, table = rendezvous.problem, comparison.table
    states = np.vstack([to_paper(problem.initial), table.linear])
    for quantity, t, component, value in table.misprints:
        if quantity == "linear x":
            states[t, component - 1] = value
    pairs = pairwise(from_paper(states))
    implied = to_paper([_inverse(problem) @ (after - problem.transition[0] @ before) for before, after in pairs])
    controls = to_paper(corrected(table))
    for t, component in _CONTRADICTED:
        controls[t, component - 1] = implied[t][component - 1]
    (member,) = fly_members(rendezvous, [comparison.ours.name], from_paper(controls)[None])
    return replace(comparison, ours=replace(member, controls=from_paper(implied)))


def _inverse(problem: ReachabilityProblem) -> Floats:
    return np.asarray(np.linalg.pinv(problem.control[0] / problem.state_bounds[:, None]) / problem.state_bounds)


def _number(row: Row, comparison: Comparison, problem: ReachabilityProblem) -> PublishedNumber:
    table, _, quantity, t, printed, correction, ours = row
    component = int(quantity[-1]) if quantity[-1].isdigit() else 0
    text = _digits(printed, quantity, component)
    right = None if correction is None else _digits(correction, quantity, component)
    note = "" if right is None else _NOTES["misprint"]
    beyond, unexplained = 0.0, False
    if quantity.startswith("u") and table == 2:
        beyond = _implied_rounding(problem, t, component)
        if (t, component) in _CONTRADICTED:
            right, note = _digits(0.0, quantity, component), _NOTES["contradicted"]
    elif quantity.startswith("linear") and table != 1:
        beyond = _state_rounding(problem, t, component)
        if (table, t, component) in _OFF:
            unexplained, note = True, _NOTES["off"]
    elif quantity.startswith("nonlinear"):
        unexplained, note = True, _NOTES["nonlinear"]
        if table == 1 and component == 0:
            right = _NONLINEAR_MISS
    unit = "" if quantity.startswith("u") or component == 0 else " (m)" if component <= 3 else " (m/s)"
    name = f"{quantity}({t})" if component else f"nonlinear, norm of x({t})"
    return _REFERENCE.number(
        f"table {table}",
        f"{name}{unit}",
        text,
        ours + 0.0,
        corrected=right,
        unexplained=unexplained,
        beyond=beyond,
        note=note,
    )


def _digits(value: float, quantity: str, component: int) -> str:
    """Return a number with the decimals of the tables, including trailing zeros."""
    least = 4 if quantity.startswith("u") else 1 if 1 <= component <= 3 else 2
    exponent = Decimal(repr(value)).as_tuple().exponent
    assert isinstance(exponent, int)
    return f"{value:.{max(least, -exponent)}f}"


def _implied_rounding(problem: ReachabilityProblem, t: int, component: int) -> float:
    """Return the effect of the rounding of the states before and after a control on the control that they imply."""
    known = np.zeros(6)
    before = known if t == 0 else np.abs(problem.transition[0]) @ _STATE_ROUNDING
    after = known if t + 1 == problem.periods else _STATE_ROUNDING
    return float(np.abs(to_paper(np.abs(_inverse(problem)) @ (before + after)))[component - 1])


def _state_rounding(problem: ReachabilityProblem, t: int, component: int) -> float:
    """Return the effect of the rounding of the controls until t on a state."""
    total = np.zeros(6)
    for power in range(t):
        total += np.abs(np.linalg.matrix_power(problem.transition[0], power) @ problem.control[0]).sum(axis=1)
    return float(_CONTROL_ROUNDING * np.abs(to_paper(total))[component - 1])
