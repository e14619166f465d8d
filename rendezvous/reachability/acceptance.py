"""What plans of the remaining periods must prove beyond the constraints of their problem.

Theorem 6 of `docs/guaranteed-rendezvous.md` keeps the plan before if a new one does not prove it.
The rows of a safe plan, and of one that keeps constraints between impulses, are those of some
intervals with bounds that depend on the plan. So the drifts and the coasts of each new plan are
certified; so are the distances that nonlinear motion was assumed for.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from infoset.rendezvous.reachability.coasting import Coasting, UnboundedCoastError
from infoset.rendezvous.reachability.drift import DriftCertificate, drift_certificate
from infoset.rendezvous.reachability.guided import Acceptance
from infoset.rendezvous.reachability.independent_parts import ProblemPart
from infoset.rendezvous.reachability.nonlinear import NonlinearPlan
from infoset.rendezvous.reachability.outputs import AffinePlan
from infoset.rendezvous.reachability.within_periods import PathLimits


def keeps_drifts(certificate: DriftCertificate, keep_out_m: float) -> Acceptance:
    """Return the condition that all drifts of a new plan stay outside a ball about the target.

    The engines may fail after the same impulses as in the `certificate` of the plan before the
    flight, whose directions are tried first. After the last of them every plan is accepted.
    """
    coasting = certificate.tube.coasting
    later = [_later_coasts(coasting, time) for time in range(coasting.impulses)]

    def accepts(plan: AffinePlan, time: int) -> bool:
        if time >= len(later):
            return True
        normals = certificate.normals[time:]
        try:
            distances = later[time].tube(plan).certain_distances(normals)
            if distances.min() >= keep_out_m:
                return True
            renewed = drift_certificate(plan, later[time], normals)
        except UnboundedCoastError:
            return False
        return renewed.least_distance >= keep_out_m

    return accepts


def keeps_distances(found: NonlinearPlan, coasting: Coasting) -> Acceptance:
    """Return the condition that a new plan stays within the distances assumed for gravity.

    `found` is the plan before the flight, and `coasting` that of `nonlinear_plan`.
    """
    periods = len(found.assumed)
    # The remainder of gravity is among the accelerations that are given to the tube.
    flight = replace(coasting, impulses=periods, periods=1, semi_major_axis_m=None)
    later = [_later_coasts(flight, time) for time in range(periods)]

    def accepts(plan: AffinePlan, time: int) -> bool:
        rest = later[time]
        accelerations = coasting.acceleration_m_s2 + found.accelerations[time:, None]
        tube = rest.tube_under(plan, np.broadcast_to(accelerations, rest.starts_s.shape))
        # As before the flight, a smaller bound excludes a first exit.
        return bool((tube.radii.max(axis=1) < found.assumed[time:]).all())

    return accepts


def keeps_limits(limits: PathLimits, part: ProblemPart) -> Acceptance:
    """Return the condition that a new plan of a part keeps constraints between impulses.

    Each constraint that acts on the states of the part acts on no other part.
    """
    periods = limits.flight.impulses
    acting = limits.normals[:, part.states].any(axis=1)
    later = [
        PathLimits(
            _later_coasts(limits.flight, time),
            limits.normals[acting],
            limits.offsets[time:, acting],
        )
        for time in range(periods)
    ]

    def accepts(plan: AffinePlan, time: int) -> bool:
        rest = later[time]
        try:
            tube = rest.flight.tube(plan, part)
        except UnboundedCoastError:
            return False
        return bool((rest.excess(tube) <= 0.0).all())

    return accepts


def _later_coasts(coasting: Coasting, time: int) -> Coasting:
    """Return the coasts after the impulses from a period on, whose start is then t = 0."""
    orbit = coasting.orbit
    anomaly = float(orbit.true_anomaly(coasting.period_s * time))
    turned = replace(orbit, true_anomaly_rad=anomaly)
    return replace(coasting, orbit=turned, impulses=coasting.impulses - time)
