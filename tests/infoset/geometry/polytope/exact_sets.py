"""Exact sets of half-spaces, for judges of random kinds."""

from __future__ import annotations

from contextlib import suppress
from math import lcm

import numpy as np

from infoset.arrays import Floats
from tests.rationals import Fraction

with suppress(ModuleNotFoundError):  # tests that need it are skipped
    import ppl


def polyhedron(rows: Floats, limits: Floats) -> ppl.C_Polyhedron:
    """Return {x: rows x <= limits} as a polyhedron of PPL, which may be unbounded."""
    found = ppl.C_Polyhedron(rows.shape[1], "universe")
    for row in np.column_stack([rows, limits]):
        values = [Fraction(float(value)) for value in row]
        divisor = lcm(*(int(value.denominator) for value in values))
        *normal, limit = (int(value * divisor) for value in values)
        terms = (entry * ppl.Variable(i) for i, entry in enumerate(normal))
        found.add_constraint(sum(terms, start=ppl.Linear_Expression(0)) <= limit)
    return found
