"""Two motions along one axis that are as far apart at the end as equal measurements allow: linear programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.model import SetModel
from infoset.sensors import Sensor
from infoset.sim.bound.coasting import Coasting

MARGIN = 1e-6
"""Reserve as a share of each limit, for rounding."""
STEPS_A_BLOCK = 8
"""Acceleration is constant over blocks of an eighth of the time to the last common measurement."""


class BoundError(RuntimeError):
    """The linear program of a bound could not be solved."""


class PairProgram:
    """The linear programs of one lateral axis, with its sensors and the steps in which they measure.

    `limits_m` is the maximum distance of the two along the axis at each step with the same measurements,
    `miss_limits_m` that of their predicted misses w + V_w x/c; infinite where nothing is measured. The difference of
    the two follows the transition matrices of `motion`, without its small parts along the other axes.
    """

    def __init__(
        self, model: SetModel, sensors: Mapping[str, Sensor], due: Mapping[str, Integers], motion: Coasting, axis: int
    ) -> None:
        self.model, self.motion, self.axis = model, motion, axis
        self.steps = len(motion.range_m)
        self.limits_m = np.full(self.steps, np.inf)
        self.miss_limits_m = np.full(self.steps, np.inf)
        for name, sensor in sensors.items():
            measured = due[name]
            speeds_m_s = motion.closing_speed_m_s[measured]
            band = sensor.band(motion.range_m[measured], speeds_m_s, 2.0 * (1.0 - MARGIN))
            if band is not None:
                limits = self.miss_limits_m if band[0] else self.limits_m
                limits[measured] = np.minimum(limits[measured], band[1])

    def is_like(self, other: PairProgram) -> bool:
        """Return whether another program is the same, up to differences of gravity that are negligible."""
        here, there = (
            each.motion.transition[:, each.axis, [each.axis, each.motion.axes + each.axis]] for each in (self, other)
        )
        return self.model == other.model and np.allclose(here, there, rtol=MARGIN, atol=0.0)

    @property
    def is_measured(self) -> Flags:
        """Whether a measurement limits the distance at a step, shape (steps,)."""
        return np.asarray(np.isfinite(np.minimum(self.limits_m, self.miss_limits_m)))

    def farthest(self, last_common_step: int) -> tuple[float, float, Floats]:
        """Return the difference of the two motions: offset and velocity at t = 0, acceleration over each step.

        A linear program in the offset, the velocity and the acceleration at the knots of a time grid that has the steps
        near the last common measurement and longer blocks before. An acceleration that is constant over longer blocks
        is admissible, and measurements within a block are additional inequalities.

        Raises
        ------
        BoundError
            If the solver finds no solution.
        """
        from scipy.optimize import linprog  # takes half a second to load

        box = self.model.bounds
        knots = self._knots(last_common_step)
        count, blocks = len(knots), len(knots) - 1
        # Units in which all variables are of order one, because the tolerances of the solver are absolute.
        second = self.model.step_s
        metre = 1.0 / max(float(np.median(self.motion.range_m)) * 2e-4, 1e-9)
        push = 2.0 * self.model.disturbance_m_s2 * metre
        rows = np.arange(blocks)
        z, v, u = rows, count + rows, 2 * count + rows
        (zz, zv), (vz, vv), (zu, vu) = self._responses(knots[1:], knots[:-1])
        motion = _sparse(
            (2 * blocks, 2 * count + blocks),
            (rows, z + 1, 1.0),
            (rows, z, -zz),
            (rows, v, -zv / second),
            (rows, u, -push * zu),
            (blocks + rows, v + 1, 1.0),
            (blocks + rows, z, -vz * second),
            (blocks + rows, v, -vv),
            (blocks + rows, u, -push * second * vu),
        )
        limits, miss_limits = self.limits_m * metre, self.miss_limits_m * metre
        limits[last_common_step + 1 :] = np.inf
        miss_limits[last_common_step + 1 :] = np.inf
        bounds = np.full(2 * count + blocks, np.inf)
        bounds[:count] = np.append(limits, np.inf)[knots]
        bounds[0] = min(bounds[0], (box.z_m[1] - box.z_m[0]) * metre)
        bounds[count] = (box.vz_m_s[1] - box.vz_m_s[0]) * metre * second
        bounds[2 * count :] = 1.0
        # Measurements within a block, and all predicted misses, as a z + b V + c u of the first knot of the block.
        within, rated = (
            np.setdiff1d(np.flatnonzero(np.isfinite(limits)), knots),
            np.flatnonzero(np.isfinite(miss_limits)),
        )
        looked = np.concatenate([within, rated])
        block = np.searchsorted(knots, looked, side="right") - 1
        to_go = np.concatenate([np.zeros(len(within)), self._to_go_s[rated]])
        (zz, zv), (vz, vv), (zu, vu) = self._responses(looked, knots[block])
        row = np.arange(len(looked))
        entries = [
            (row, block, zz + to_go * vz),
            (row, count + block, (zv + to_go * vv) / second),
            (row, 2 * count + block, push * (zu + to_go * vu)),
        ]
        entries += [(len(looked) + row, column, -factor) for row, column, factor in entries]
        most = np.concatenate([limits[within], miss_limits[rated]])
        cost = np.zeros(2 * count + blocks)
        cost[blocks] = -1.0
        solved = linprog(
            cost,
            A_eq=motion,
            b_eq=np.zeros(2 * blocks),
            A_ub=_sparse((2 * len(looked), 2 * count + blocks), *entries) if len(looked) else None,
            b_ub=np.tile(most, 2) if len(looked) else None,
            bounds=np.column_stack([-bounds, bounds]),
            method="highs-ds",
            options={"presolve": False},
        )
        if solved.status != 0:
            raise BoundError(
                f"label {self.motion.range_m[0]:g} m, V_x {-self.motion.closing_speed_m_s[0]:g} m/s: {solved.message}"
            )
        pushes = np.clip(np.asarray(solved.x[2 * count :]), -1.0, 1.0)
        acceleration = 2.0 * self.model.disturbance_m_s2 * np.repeat(pushes, np.diff(knots))
        widths = [box.z_m[1] - box.z_m[0], box.vz_m_s[1] - box.vz_m_s[0]]
        offset, velocity = (
            float(np.clip(value / unit, -width, width))
            for value, unit, width in zip((solved.x[0], solved.x[count]), (metre, metre * second), widths, strict=True)
        )
        # The solution violates the limits by up to the solver's tolerances; scaling makes it satisfy them exactly.
        axis = np.eye(self.motion.axes - 1)[self.axis]
        difference = self.motion.difference(offset * axis, velocity * axis, axis[:, None] * acceleration)[:, :-1]
        positions, speeds = difference[self.axis], difference[self.motion.axes + self.axis]
        sizes = np.abs(np.concatenate([positions, positions + speeds * self._to_go_s]))
        allowed = np.concatenate([limits / metre, miss_limits / metre])
        share = float(np.divide(allowed, sizes, out=np.full(len(sizes), np.inf), where=sizes > 0.0).min())
        share = min(1.0, share)
        return share * offset, share * velocity, share * acceleration

    @property
    def _to_go_s(self) -> Floats:
        """Return x/c at the steps, s."""
        return np.asarray(self.motion.range_m / self.motion.closing_speed_m_s[:-1])

    def _responses(self, at: Integers, since: Integers) -> tuple[tuple[Floats, Floats], ...]:
        """Return position and velocity along the axis at steps, by those at earlier steps and by an acceleration.

        The first pair are the derivatives of the position with respect to (position, velocity), the second those of the
        velocity; the third are position and velocity by a unit acceleration between the two steps.
        """
        motion, chosen = self.motion, [self.axis, self.motion.axes + self.axis]
        onward = (motion.transition[at][:, chosen] @ motion.back[since])[:, :, chosen]
        grown = motion.pushed[at, :, self.axis] - motion.pushed[since, :, self.axis]
        pushed = np.einsum("nrs,ns->rn", motion.transition[at][:, chosen], grown)
        return (onward[:, 0, 0], onward[:, 0, 1]), (onward[:, 1, 0], onward[:, 1, 1]), (pushed[0], pushed[1])

    def _knots(self, last_common_step: int) -> Integers:
        """Return the steps at which blocks of constant acceleration end, with 0 and the arrival."""
        knots = [self.steps]
        while knots[-1] > 0:
            to_go = max(0, last_common_step - knots[-1])
            knots.append(max(0, knots[-1] - 1 - to_go // STEPS_A_BLOCK))
        return np.array(knots[::-1], dtype=np.int64)


def _sparse(shape: tuple[int, int], *entries: tuple[Integers, Integers, Floats | float]) -> Any:
    """Return a sparse matrix of (rows, columns, values)."""
    from scipy.sparse import csc_array

    rows = np.concatenate([row for row, _, _ in entries])
    columns = np.concatenate([column for _, column, _ in entries])
    values = np.concatenate([np.broadcast_to(value, row.shape) for row, _, value in entries])
    return csc_array((values, (rows, columns)), shape=shape)
