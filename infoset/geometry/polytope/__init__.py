"""Convex polytopes in R^n with both representations, flat ones included."""

from infoset.geometry.polytope._measures import HIGHS
from infoset.geometry.polytope.errors import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
from infoset.geometry.polytope.operations import polytope_from_support, product
from infoset.geometry.polytope.polytope import Polytope

__all__ = [
    "HIGHS",
    "EmptyPolytopeError",
    "Polytope",
    "UnboundedPolytopeError",
    "UncertainHullError",
    "polytope_from_support",
    "product",
]
