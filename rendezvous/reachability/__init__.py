"""Rendezvous through reachable sets: every optimal control of a linear system under constraints on its states."""

from rendezvous.reachability.block_sets import SetKind
from rendezvous.reachability.closed_loop import Flight, replan
from rendezvous.reachability.discretisation import MotionModel, between_periods, discretised, motion_of
from rendezvous.reachability.exact_sets import Budget, TooLargeError
from rendezvous.reachability.nonlinear import NonlinearMotion
from rendezvous.reachability.optimal_controls import OptimalControls
from rendezvous.reachability.optimum import EmptyTubeError
from rendezvous.reachability.problem import InadmissibleStartError, ReachabilityProblem, ThrustShape
from rendezvous.reachability.reachable_sets import ReachableSets, SetCounts
from rendezvous.reachability.solve import Route, Solution, least_periods, solve

__all__ = [
    "Budget",
    "EmptyTubeError",
    "Flight",
    "InadmissibleStartError",
    "MotionModel",
    "NonlinearMotion",
    "OptimalControls",
    "ReachabilityProblem",
    "ReachableSets",
    "Route",
    "SetCounts",
    "SetKind",
    "Solution",
    "ThrustShape",
    "TooLargeError",
    "between_periods",
    "discretised",
    "least_periods",
    "motion_of",
    "replan",
    "solve",
]
