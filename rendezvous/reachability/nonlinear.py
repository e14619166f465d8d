"""Guarantees for nonlinear motion: the remainder of gravity is an unknown acceleration.

Theorem 7 of `docs/guaranteed-rendezvous.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.coasting import RADIUS_RESERVE, Coasting, UnboundedCoastError
from infoset.rendezvous.reachability.guaranteed import affine_plan
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem
from infoset.rendezvous.relative_motion import TschaunerHempel

_PANELS = 16
"""Parts of a period in which the effect of an acceleration is bounded: the effect on the position
is 0.2 % too large for straight motion."""
_MAX_ROUNDS = 8
"""Maximum number of rounds, each with larger assumed distances; most plans end after one or two."""


@dataclass(frozen=True, eq=False)
class NonlinearPlan:
    """A plan whose guarantee, ranges and constraints hold for the nonlinear motion.

    Parameters
    ----------
    plan : AffinePlan
        The plan; its problem has the remainder of gravity as a further disturbance.
    assumed : ndarray, shape (T,)
        Distances from the target in each period for which the remainder is bounded, m.
    radii : ndarray, shape (T,)
        The certain bounds of the distances, smaller than the assumed ones, m.
    accelerations : ndarray, shape (T,)
        The bounds of the remainder, m/s^2.
    """

    plan: AffinePlan
    assumed: Floats
    radii: Floats
    accelerations: Floats


def nonlinear_plan(
    problem: OutputProblem,
    coasting: Coasting,
    solve: Callable[[OutputProblem], AffinePlan] = affine_plan,
) -> NonlinearPlan:
    """Return a plan whose certificates hold for the motion about a central body.

    The problem has states in m and m/s in Hill's axes and impulses in m/s at the starts of the
    periods; its disturbance contains the effect of `coasting.acceleration_m_s2`, but must not
    contain the remainder of gravity. `coasting` has the orbit, the semi-major axis, the period and
    the intervals of the flight; its numbers of impulses and of periods are not used. `solve`
    returns a plan for a problem with the remainder, for example one that `safe_plan` finds.

    Raises
    ------
    ValueError
        If the semi-major axis is missing.
    UnboundedCoastError
        If no bound of the distance is proved.
    NoRobustPlanError, NoSolutionError
        As `solve`.
    """
    if coasting.semi_major_axis_m is None:
        raise ValueError("nonlinear motion needs the semi-major axis of the orbit")
    # The same periods twice: as linear motion, whose tube is given its accelerations, and with the
    # size of the orbit, for the remainder of gravity.
    flight = replace(coasting, impulses=problem.periods, periods=1, semi_major_axis_m=None)
    gravity = replace(coasting, impulses=problem.periods, periods=1)

    # The first distances are those of a plan without the remainder.
    assumed = RADIUS_RESERVE * flight.tube(solve(problem)).radii.max(axis=1)
    for _ in range(_MAX_ROUNDS):
        distances = np.broadcast_to(assumed[:, None], gravity.starts_s.shape)
        remainder = gravity.remainder(distances).max(axis=1)
        if not np.isfinite(remainder).all():
            break
        plan = solve(with_acceleration(problem, coasting, remainder))
        accelerations = coasting.acceleration_m_s2 + remainder[:, None]
        tube = flight.tube_under(plan, np.broadcast_to(accelerations, flight.starts_s.shape))
        radii = tube.radii.max(axis=1)
        # A bound that is smaller than the assumed one excludes a first exit.
        if (radii < assumed).all():
            return NonlinearPlan(plan, assumed, radii, remainder)
        assumed = RADIUS_RESERVE * np.maximum(assumed, radii)
    raise UnboundedCoastError(
        "nonlinear motion is not proved to stay near the target; reduce the errors or the distance"
    )


def with_acceleration(
    problem: OutputProblem, coasting: Coasting, accelerations: Floats
) -> OutputProblem:
    """Return the problem with an unknown acceleration, any function of time, as a disturbance.

    `accelerations`, shape (T,), are bounds of its magnitude in each period, m/s^2. The states at
    the end of a period are in a box, whose half-widths are bounded by parts of the period.
    """
    periods = problem.periods
    starts = coasting.period_s * np.arange(periods)[:, None]
    part = coasting.period_s / _PANELS
    begins = starts + part * np.arange(_PANELS)
    motion = TschaunerHempel(coasting.orbit)
    gramians = motion.gramian(begins, begins + part)
    to_end = motion.transition(begins + part, starts + coasting.period_s)
    squares = np.einsum("tpij,tpjk,tpik->tpi", to_end, gramians, to_end)
    # By the inequality of Cauchy and Schwarz in each part.
    widths = np.sqrt(part * np.maximum(squares, 0.0)).sum(axis=1)

    added = accelerations[:, None, None] * widths[:, :, None] * np.eye(6)
    if problem.disturbance is not None:
        added = np.concatenate([problem.disturbance, added], axis=2)
    return replace(problem, disturbance=added)
