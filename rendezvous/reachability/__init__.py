"""Rendezvous by reachable sets: all optimal controls of a linear system with bounded states.

A problem is built from a motion. Its solution contains the sets of states and the set of optimal
controls. Controls are selected from this set and simulated.
"""

from infoset.rendezvous.reachability.acceptance import (
    keeps_distances,
    keeps_drifts,
    keeps_limits,
)
from infoset.rendezvous.reachability.answer import (
    AnsweredPlan,
    LateConstraintError,
    MirrorBound,
    Multipliers,
    answered_plan,
    information_radius,
    lower_bound,
    multipliers,
)
from infoset.rendezvous.reachability.backward import backward_bounds
from infoset.rendezvous.reachability.bounded_errors import ErrorBounds, with_errors
from infoset.rendezvous.reachability.closed_loop import ClosedLoopFlight, replan
from infoset.rendezvous.reachability.coasting import Coasting, CoastTube, UnboundedCoastError
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.drift import (
    DriftCertificate,
    PassiveSafety,
    UnsafeDriftsError,
    drift_certificate,
    safe_plan,
)
from infoset.rendezvous.reachability.guaranteed import NoRobustPlanError, affine_plan
from infoset.rendezvous.reachability.guided import (
    Acceptance,
    Cuts,
    GuidedCraft,
    GuidedFlight,
    LinearTruth,
    TrueMotion,
    guided_flight,
)
from infoset.rendezvous.reachability.independent_parts import (
    ProblemPart,
    independent_parts,
    part_of_plan,
    plan_of_parts,
    whole_problem,
)
from infoset.rendezvous.reachability.line_of_sight import (
    SightSensor,
    SightTruth,
    sighted_plan,
)
from infoset.rendezvous.reachability.motion import (
    IMPULSE,
    MotionModel,
    NonlinearMotion,
    between_impulses,
    between_periods,
    discretised,
    impulsive,
    motion_of,
)
from infoset.rendezvous.reachability.nonlinear import (
    NonlinearPlan,
    nonlinear_plan,
    with_acceleration,
)
from infoset.rendezvous.reachability.norm_limit import NormFaces, acting_controls, norm_faces
from infoset.rendezvous.reachability.optimum import EmptyTubeError
from infoset.rendezvous.reachability.outputs import (
    AffinePlan,
    ErrorSet,
    OutputProblem,
    PathRows,
    Ranges,
)
from infoset.rendezvous.reachability.plan_flights import (
    Move,
    PlanFlights,
    ReplannedFlights,
    ReplannedPart,
    ReplannedPlan,
    fly_plan,
    fly_replanned,
    linear_motion,
)
from infoset.rendezvous.reachability.problem import (
    MAX_PERIODS,
    InadmissibleStartError,
    ReachabilityProblem,
    ThrustShape,
)
from infoset.rendezvous.reachability.robust import feedback_plan, tightened
from infoset.rendezvous.reachability.selection import (
    ControlEffort,
    analytic_centre,
    chebyshev_centre,
    effort,
    minimum_delta_v,
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    nearest,
    samples,
    vertices,
)
from infoset.rendezvous.reachability.sets import (
    ReachableSets,
    SetKind,
    ThinSetError,
    TooManyVerticesError,
    VertexCounts,
)
from infoset.rendezvous.reachability.solve import (
    OptimalControls,
    Route,
    Solution,
    min_periods,
    optimal_controls,
    solve,
)
from infoset.rendezvous.reachability.within_periods import (
    PathLimits,
    answers_within,
    plan_within,
)

__all__ = [
    "IMPULSE",
    "MAX_PERIODS",
    "Acceptance",
    "AffinePlan",
    "AnsweredPlan",
    "ClosedLoopFlight",
    "CoastTube",
    "Coasting",
    "ControlEffort",
    "Cuts",
    "DriftCertificate",
    "EmptyTubeError",
    "ErrorBounds",
    "ErrorSet",
    "GuidedCraft",
    "GuidedFlight",
    "InadmissibleStartError",
    "LateConstraintError",
    "LinearTruth",
    "MirrorBound",
    "MotionModel",
    "Move",
    "Multipliers",
    "NoRobustPlanError",
    "NoSolutionError",
    "NonlinearMotion",
    "NonlinearPlan",
    "NormFaces",
    "OptimalControls",
    "OutputProblem",
    "PassiveSafety",
    "PathLimits",
    "PathRows",
    "PlanFlights",
    "ProblemPart",
    "Ranges",
    "ReachabilityProblem",
    "ReachableSets",
    "ReplannedFlights",
    "ReplannedPart",
    "ReplannedPlan",
    "Route",
    "SetKind",
    "SightSensor",
    "SightTruth",
    "Solution",
    "ThinSetError",
    "ThrustShape",
    "TooManyVerticesError",
    "TrueMotion",
    "UnboundedCoastError",
    "UnsafeDriftsError",
    "VertexCounts",
    "acting_controls",
    "affine_plan",
    "analytic_centre",
    "answered_plan",
    "answers_within",
    "backward_bounds",
    "between_impulses",
    "between_periods",
    "chebyshev_centre",
    "discretised",
    "drift_certificate",
    "effort",
    "feedback_plan",
    "fly_plan",
    "fly_replanned",
    "guided_flight",
    "impulsive",
    "independent_parts",
    "information_radius",
    "keeps_distances",
    "keeps_drifts",
    "keeps_limits",
    "linear_motion",
    "lower_bound",
    "min_periods",
    "minimum_delta_v",
    "minimum_energy",
    "minimum_l1",
    "minimum_norms",
    "minimum_peak",
    "motion_of",
    "multipliers",
    "nearest",
    "nonlinear_plan",
    "norm_faces",
    "optimal_controls",
    "part_of_plan",
    "plan_of_parts",
    "plan_within",
    "replan",
    "safe_plan",
    "samples",
    "sighted_plan",
    "solve",
    "tightened",
    "vertices",
    "whole_problem",
    "with_acceleration",
    "with_errors",
]
