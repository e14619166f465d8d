"""Convex polytopes in R^n with both representations, flat ones included."""

from infoset.polytope._relative_interior import HIGHS, RelativeInterior, null_space_basis, relative_interior
from infoset.polytope._shadow import shadow
from infoset.polytope.errors import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
from infoset.polytope.operations import cut, intersection, linear_image, minkowski_sum, product, projection
from infoset.polytope.polytope import Polytope

__all__ = [
    "HIGHS",
    "EmptyPolytopeError",
    "Polytope",
    "RelativeInterior",
    "UnboundedPolytopeError",
    "UncertainHullError",
    "cut",
    "intersection",
    "linear_image",
    "minkowski_sum",
    "null_space_basis",
    "product",
    "projection",
    "relative_interior",
    "shadow",
]
