"""Numbers of Shorikov and Goranov (2021): rendezvous through reachable sets, tables 1 to 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from itertools import pairwise

import numpy as np

from experiments.common.hill_axes import from_paper, to_paper
from experiments.common.published_number import Progress, PublishedNumber, Reference, Reproduction
from experiments.reachability.file import load_rendezvous
from experiments.reachability.printed_tables import PROBLEM, Comparison, PrintedTable, Row, compare_published, corrected
from experiments.reachability.report import fly_members
from infoset.arrays import Floats
from rendezvous.reachability import NonlinearMotion, ReachabilityProblem, solve
from rendezvous.relative_motion import EllipticOrbit

PAPER = "reachability"
TITLE = "Shorikov and Goranov (2021), rendezvous through reachable sets"
REMARKS = (
    "The paper does not print its orbit, period and acceleration; they were identified from its tables.",
    "Table 1 is the control of least energy. The paper does not say which optimal controls tables 2 and 3 are. Table 3 "
    "is compared with the nearest optimal control, the controls of table 2 with those that its linear states imply. "
    "Table 2 is near the least sum of absolute values but differs from it.",
    "Linear states of tables 2 and 3 are those of the printed controls, with misprints corrected (the four of table 2 "
    "by the values that its states imply); their tolerance includes the rounding of these controls.",
    "The nonlinear columns are those of another model: (1) about a circular orbit of radius 90 km, where the orbit of "
    "the linear columns has 9000 km at perigee, with the same rate. Ours are those of the same controls on the orbit "
    "of the linear columns. The verdicts contain 90 km exactly, not a fitted radius.",
)
PUBLISHED_RADIUS_M = 90e3
"""Radius of the orbit of the nonlinear columns: 9000 km, the radius at perigee, with two digits lost."""
_REFERENCE = Reference(PAPER)
_CONTROL_ROUNDING = 0.5e-4
_STATE_ROUNDING = np.array([0.05, 0.05, 0.05, 0.005, 0.005, 0.005])
_CONTRADICTED = ((1, 1), (1, 2), (2, 1), (2, 2))
"""(t, component) of the controls of table 2 that its states contradict."""
_PROVED = (
    (1, "nonlinear x1", 2),
    (1, "nonlinear x1", 3),
    (3, "linear x3", 2),
    (3, "nonlinear x6", 4),
)
"""(table, quantity, t) of misprints that follow from all other positions of the table."""
_NOTES = {
    "misprint": "the states of the table follow from the other value",
    "contradicted": (
        "the states follow from 0.0000 within their rounding, and the printed controls lead past zero by 11 and 18 m. "
        "A tenth of them fits worse than zero"
    ),
    "nonlinear": (
        "does not follow from (1) on the orbit of the linear columns: the difference exists already after the first "
        "period, 4.6 m where 0.1 m is right. Other model: (1) about a circular orbit of radius 90 km, not 9000 km"
    ),
    "norm": (
        "not the norm of the printed x(4), which is 73.78, 75.59 and 75.23 in tables 1 to 3. Tried: the other model, "
        "with exact and with printed controls (table 1: 73.74 and 73.21), and the positions alone"
    ),
    "proved": (
        "every control within the rounding of the printed one that leads to the other printed positions of the table "
        "leads to the right value, in the other model if the number is nonlinear"
    ),
}


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    rendezvous = load_rendezvous(PROBLEM)
    as_published = replace(rendezvous, truth=published_motion(rendezvous.truth.orbit))
    problem = rendezvous.problem
    solution = solve(problem)
    progress(0.5)
    comparisons = compare_published(rendezvous, solution)
    first, second, third = comparisons
    shown = (first.ours.controls, _implied(problem, second.table), third.ours.controls)
    flown, names = flown_controls(problem, comparisons), [each.table.ours for each in comparisons]
    own, other = (fly_members(each, names, flown) for each in (rendezvous, as_published))
    numbers = []
    for comparison, controls, *models in zip(comparisons, shown, own, other, strict=True):
        ours, published = (replace(comparison, ours=replace(member, controls=controls)).rows for member in models)
        numbers += [_number(row, value, problem) for row, (*_, value) in zip(ours, published, strict=True)]
    progress(1.0)
    return Reproduction(PAPER, TITLE, ((rendezvous.name, rendezvous.hash),), tuple(numbers), REMARKS)


def published_motion(orbit: EllipticOrbit, radius_m: float = PUBLISHED_RADIUS_M) -> NonlinearMotion:
    """Return the motion of the nonlinear columns: about a circle of `radius_m`, with the rate of `orbit` at t = 0.

    Equation (1) with e = 0 and w^2 radius^3 in place of the gravitational parameter.
    """
    rate_rad_s = orbit.semi_latus_rate_rad_s * (1.0 + orbit.eccentricity * np.cos(orbit.true_anomaly_rad)) ** 2
    return NonlinearMotion(EllipticOrbit(float(rate_rad_s)), radius_m)


def flown_controls(problem: ReachabilityProblem, comparisons: Sequence[Comparison]) -> Floats:
    """Return the controls to which the states of tables 1 to 3 belong, in Hill's axes, shape (3, 4, 3).

    Table 1: the control of least energy, which is an independent computation. Tables 2 and 3: the printed controls with
    corrections; controls of table 2 that its states contradict are those that the states imply.
    """
    first, second, third = comparisons
    controls, implied = to_paper(second.printed.controls), to_paper(_implied(problem, second.table))
    for t, component in _CONTRADICTED:
        controls[t, component - 1] = implied[t, component - 1]
    return np.array([first.ours.controls, from_paper(controls), third.printed.controls])


def _implied(problem: ReachabilityProblem, table: PrintedTable) -> Floats:
    """Return the controls that the linear states of a table imply, in Hill's axes, shape (4, 3)."""
    states = np.vstack([to_paper(problem.initial), corrected(table, "linear x")])
    pairs = pairwise(from_paper(states))
    return np.array([_inverse(problem) @ (after - problem.transition[0] @ before) for before, after in pairs])


def _inverse(problem: ReachabilityProblem) -> Floats:
    return np.asarray(np.linalg.pinv(problem.control[0] / problem.state_bounds[:, None]) / problem.state_bounds)


def _number(row: Row, published: float, problem: ReachabilityProblem) -> PublishedNumber:
    """Return a number of a row of ours; `published` is that of the motion as published."""
    table, _, quantity, t, printed, correction, ours = row
    component = int(quantity[-1]) if quantity[-1].isdigit() else 0
    text = _digits(printed, quantity, component)
    right = None if correction is None else _digits(correction, quantity, component)
    note = "" if right is None else _NOTES["proved" if (table, quantity, t) in _PROVED else "misprint"]
    beyond, other = 0.0, None
    if quantity.startswith("u") and table == 2:
        beyond = _implied_rounding(problem, t, component)
        if (t, component) in _CONTRADICTED:
            right, note = _digits(0.0, quantity, component), _NOTES["contradicted"]
    elif component and quantity[0] != "u" and table != 1:
        beyond = _state_rounding(problem, t, component)
    if quantity.startswith("nonlinear"):
        other = published
        note = note or _NOTES["nonlinear" if component else "norm"]
    unit = "" if quantity.startswith("u") or component == 0 else " (m)" if component <= 3 else " (m/s)"
    name = f"{quantity}({t})" if component else f"nonlinear, norm of x({t})"
    return _REFERENCE.number(
        f"table {table}",
        f"{name}{unit}",
        text,
        ours + 0.0,
        other=other,
        corrected=right,
        unexplained=component == 0,
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
