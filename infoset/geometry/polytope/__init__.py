"""Convex polytopes in R^n with both representations, flat ones included."""

from infoset.geometry.polytope._affine_hull import (
    HIGHS,
    EmptyPolytopeError,
    RelativeInterior,
    UnboundedPolytopeError,
    UncertainHullError,
    null_space_basis,
    relative_interior,
)
from infoset.geometry.polytope.operations import polytope_from_support, product
from infoset.geometry.polytope.polytope import Polytope

__all__ = [
    "HIGHS",
    "EmptyPolytopeError",
    "Polytope",
    "RelativeInterior",
    "UnboundedPolytopeError",
    "UncertainHullError",
    "null_space_basis",
    "polytope_from_support",
    "product",
    "relative_interior",
]
