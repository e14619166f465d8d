"""Convex polytopes in R^n with both representations, flat ones included."""

from infoset.polytope._affine_hull import (
    HIGHS,
    EmptyPolytopeError,
    RelativeInterior,
    UnboundedPolytopeError,
    UncertainHullError,
    null_space_basis,
    relative_interior,
)
from infoset.polytope.operations import cut, intersection, linear_image, minkowski_sum, product, projection, shadow
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
