"""Convex polytopes in R^n with both representations, flat ones included."""

from infoset.geometry.polytope._measures import HIGHS, largest_ball
from infoset.geometry.polytope.errors import EmptyPolytopeError, SolverError, UnboundedPolytopeError
from infoset.geometry.polytope.nearest import nearest_pair
from infoset.geometry.polytope.operations import polytope_from_support, product
from infoset.geometry.polytope.polytope import Polytope

__all__ = [
    "HIGHS",
    "EmptyPolytopeError",
    "Polytope",
    "SolverError",
    "UnboundedPolytopeError",
    "largest_ball",
    "nearest_pair",
    "polytope_from_support",
    "product",
]
