"""Convex polytopes in R^n with both representations, flat ones included."""

from rendezvous.polytope.errors import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
from rendezvous.polytope.operations import cut, intersection, linear_image, minkowski_sum, product, projection
from rendezvous.polytope.polytope import Polytope
from rendezvous.polytope.shadow import shadow

__all__ = [
    "EmptyPolytopeError",
    "Polytope",
    "UnboundedPolytopeError",
    "UncertainHullError",
    "cut",
    "intersection",
    "linear_image",
    "minkowski_sum",
    "product",
    "projection",
    "shadow",
]
