"""The strategy that leaves the least effort to later impulses."""

from __future__ import annotations

import math

import numpy as np

from infoset._compile import entry
from infoset.arrays import Floats
from infoset.guidance.authority import correctable_later_m
from infoset.guidance.situation import Situation
from infoset.guidance.symmetric_impulse import range_at_impulse

PARTS = 4
"""Parts into which the labels between two sections are divided: the deciding time to go is often
between sections.

Chosen: the misses of asteroid-1997, with 29 sections, are the same from 1 to 16, in 0.6 to 1.6
times the time (measured).
"""
MIN_AUTHORITY_M = 1e-9
"""Minimum divisor of an effort: after the last impulse the authority is zero. Chosen: far below all
misses, so that the effort is then far above 1. Misses are the same from 1e-12 to 1e-3 (measured).
"""
NO_DEMAND_M = 1e200
"""An excluded label has the interval from this to minus this: it never decides, and neither does a
label between it and a feasible section. Its product with a share, at most 1e9, is finite.
"""
TRIALS = 60
"""Maximum number of trials of an impulse, a guard: bisections alone end after 44 of them, by
`IMPULSE_TOLERANCE`."""
IMPULSE_TOLERANCE = 1e-13
"""Change of a trial, in units of the maximum impulse, at which the search ends: some roundings.
The miss of a flight of ten seconds is the same to 1e-8 from 1e-15 to 1e-8 (measured)."""


class LeastEffort:
    """Minimise the maximum share of what later impulses can correct, over all possible times to go.

    Notes
    -----
    A hypothesis is a label of the set, with the time to go tau and the interval [l, h] of possible
    misses. Its *authority* A is the miss that later impulses can correct: the sum of mu2 tau_j over
    them, as many as schedule, cut-off and budget allow, divided by 1 + eta, the maximum ratio of
    true and nominal closing speed. The *reference* ref is the miss that no strategy can prevent
    (`unavoidable_m`). The *effort* rho is the share of the authority that the hypothesis needs
    after the impulse u, if its worst miss is to become ref:

        rho(u) = (max(h - u tau, u tau - l) - ref) / A .

    The impulse minimises the maximum rho of all hypotheses. If this is more than 1, it minimises
    the maximum excess max(h - u tau, u tau - l) - A instead. After the last impulse A is zero, and
    the excess is the miss. An impulse that keeps all excesses below a bound that later impulses can
    keep too guarantees this bound, and effort costs no more impulses than this asks.

    U_s makes the extreme misses of all hypotheses opposite, as if all were equally urgent. If the
    range is unknown, one extreme may belong to a hypothesis with 20 s to go, for which later
    impulses can correct kilometres, and the other one to the truth, 3 s away. If range and closing
    speed are known, there is one hypothesis, and U_s is optimal.

    Limits: the authority does not contain a budget that an adversary can drain, nor the widening of
    the set by large impulses at a very uncertain speed. docs/strategies.md has the derivation and
    the measurements.
    """

    name = "least-effort"

    def start(self, shape: tuple[int, int]) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> Floats:
        """Return the impulses with the minimax effort, m/s."""
        view = situation.information
        e = situation.closing_speed_m_s
        most = situation.thruster.max_impulse_m_s
        ranges_m = view.ranges_m
        feasible = view.feasible
        pending = situation.pending_m(ranges_m / e)
        minimum, maximum = view.predicted_miss_by_section_m()
        lower = _between(np.where(feasible, minimum - pending, NO_DEMAND_M))
        upper = _between(np.where(feasible, maximum - pending, -NO_DEMAND_M))

        ranges = _between(ranges_m)
        # vx is negative: x decreases.
        fastest = max(e, *(-vx for vx in view.model.bounds.vx_m_s)) / e
        authority = correctable_later_m(situation, ranges) / fastest
        to_go_s = range_at_impulse(ranges, e, situation.lead_s) / e

        share = 1.0 / np.maximum(authority, MIN_AUTHORITY_M)
        reference = unavoidable_m(situation)[:, None, None]
        impulse, effort = balanced(
            (upper - reference) * share, (-lower - reference) * share, to_go_s * share, most
        )
        if (effort > 1.0).any():
            urgent, _ = balanced(upper - authority, -lower - authority, to_go_s, most)
            impulse = np.where(effort > 1.0, urgent, impulse)
        return impulse


def unavoidable_m(situation: Situation) -> Floats:
    """Return the reference of `LeastEffort`: a miss that errors of the angles can force, m.

    The shape is (C,). It is zero with a schedule.

    Two motions that differ by the sum of the error bounds at the first image, at the least initial
    range x0, and at the range e tau look alike until then. They arrive
    2 e tau (h(e tau) + h(x0))/(1 - e tau/x0) apart, less if the first image and the bounds of the
    velocity are nearer. Half of it, less what the impulses after tau can correct, is a miss of one
    of the two.
    """
    whole = situation.information.model
    reference_m = np.zeros(len(whole.axes))
    if situation.later_times_s is not None:
        return reference_m

    thruster = situation.thruster
    e = situation.closing_speed_m_s
    x0 = whole.bounds.x_m[0]
    # Times to go tau of last steps in which the motions look alike, at ranges e tau below x0; and
    # what full impulses at the steps after each of them correct, whatever budget is left.
    to_go_s: Floats = whole.step_s * np.arange(1.0, math.ceil(x0 / (e * whole.step_s)))
    correctable_m = thruster.max_impulse_m_s * (np.cumsum(to_go_s) - to_go_s)
    for axis, model in enumerate(map(whole.axis, whole.axes)):
        box = model.seen_bounds
        h = model.angle_sensor.error_bound
        apart_m = e * to_go_s * (h(e * to_go_s) + h(x0)) / (1.0 - e * to_go_s / x0)
        # Half of the most that they can arrive apart: the lesser of what the first image and what
        # the box of positions allow, plus what the velocities allow.
        widest_m = 0.5 * (min(np.ptp(box.z_m), 2.0 * h(x0) * x0) + np.ptp(box.vz_m_s) * x0 / e)
        reference_m[axis] = (np.minimum(apart_m, widest_m) - correctable_m).max(initial=0.0)
    return reference_m


def _between(values: Floats) -> Floats:
    """Return values of sections with `PARTS` - 1 interpolated ones between neighbours.

    The shape of the sections is (..., B, S).
    """
    between = np.empty((*values.shape[:-1], PARTS * (values.shape[-1] - 1) + 1))
    between[..., -1] = values[..., -1]
    # A part at a time is faster than all parts in one short inner axis. The last section has no
    # neighbour after it, and is written before.
    for part in range(PARTS):
        share = part / PARTS
        between[..., part:-1:PARTS] = values[..., :-1] * (1.0 - share) + values[..., 1:] * share
    return between


def balanced(falling: Floats, rising: Floats, slopes: Floats, most: float) -> tuple[Floats, Floats]:
    """Return the u, abs(u) <= most, with the minimax of two families of lines, and this value.

    The families are falling - slopes u and rising + slopes u. `falling` and `rising` have the shape
    (C, B, S), `slopes`, not negative, (B, S), and the results (C, B).
    """
    at, value = np.zeros((2, *falling.shape[:2]))
    for axis in range(len(at)):
        balance_all(falling[axis], rising[axis], slopes, float(most), at[axis], value[axis])
    return at, value


@entry
def balance_all(
    falling: Floats, rising: Floats, slopes: Floats, most: float, at: Floats, value: Floats
) -> None:
    """Write the results of `balanced` for one axis.

    At the minimum the maximum falling and rising lines are equal, or it is an end. The next trial
    is the intersection of the two lines that are largest now, or the middle of the interval that is
    left.
    """
    for b in range(len(at)):
        low = -most
        high = most
        u = 0.0
        for _ in range(TRIALS):
            fall = -math.inf
            rise = -math.inf
            fall_slope = 0.0
            rise_slope = 0.0
            for s in range(falling.shape[1]):
                slope = slopes[b, s]
                if falling[b, s] - slope * u > fall:
                    fall = falling[b, s] - slope * u
                    fall_slope = slope
                if rising[b, s] + slope * u > rise:
                    rise = rising[b, s] + slope * u
                    rise_slope = slope
            at[b] = u
            value[b] = max(fall, rise)
            if fall == rise or low == high:
                break

            # Falling lines decide: the minimum is at a greater u.
            if fall > rise:
                low = u
            else:
                high = u
            # Two lines without a slope do not meet: `low` is not within the interval, and its
            # middle is taken.
            slope = fall_slope + rise_slope
            u = u + (fall - rise) / slope if slope > 0.0 else low
            if not low < u < high:
                u = 0.5 * (low + high)
            if abs(u - at[b]) <= IMPULSE_TOLERANCE * most:
                break
