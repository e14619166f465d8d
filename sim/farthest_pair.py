"""Two motions along one axis that are as far apart at the end as equal measurements allow: linear programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from infoset import SetModel
from infoset.arrays import Flags, Floats, Integers
from infoset.sensor import Sensor

MARGIN = 1e-6
"""Reserve as a share of each limit, for rounding."""
STEPS_A_BLOCK = 8
"""Acceleration is constant over blocks of an eighth of the time to the last common measurement."""


class BoundError(RuntimeError):
    """The linear program of a bound could not be solved."""


class PairProgram:
    """The linear programs of one axis, with its sensors and the steps in which they measure.

    `limits_m` is the greatest distance of the two along the axis at each step with the same measurements,
    `miss_limits_m` that of their predicted misses; infinite where nothing is measured.
    """

    def __init__(
        self,
        model: SetModel,
        sensors: Mapping[str, Sensor],
        due: Mapping[str, Integers],
        times_s: Floats,
        ranges_m: Floats,
        vx_m_s: float,
    ) -> None:
        self.model, self.times_s, self.ranges_m, self.vx_m_s = model, times_s, ranges_m, vx_m_s
        self.arrival_s = float(times_s[-1])
        self.steps = len(ranges_m)
        self.limits_m = np.full(self.steps, np.inf)
        self.miss_limits_m = np.full(self.steps, np.inf)
        for name, sensor in sensors.items():
            band = sensor.band(self.ranges_m[due[name]], -vx_m_s, 2.0 * (1.0 - MARGIN))
            if band is not None:
                limits = self.miss_limits_m if band[0] else self.limits_m
                limits[due[name]] = np.minimum(limits[due[name]], band[1])

    @property
    def is_measured(self) -> Flags:
        """Whether a measurement limits the distance at a step, shape (steps,)."""
        return np.asarray(np.isfinite(np.minimum(self.limits_m, self.miss_limits_m)))

    def farthest(self, last_common_step: int) -> tuple[float, float, Floats, float]:
        """Return the difference of the two motions: offset and velocity at t = 0, acceleration over each step, end.

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
        at_s, count = self.times_s[knots], len(knots)
        blocks = count - 1
        # Units in which all variables are of order one, because the tolerances of the solver are absolute.
        second = self.model.step_s
        metre = 1.0 / max(float(np.median(self.ranges_m)) * 2e-4, 1e-9)
        push = 2.0 * self.model.disturbance_m_s2 * metre
        step = np.diff(at_s)
        rows = np.arange(blocks)
        z, v, u = rows, count + rows, 2 * count + rows
        motion = _sparse(
            (2 * blocks, 2 * count + blocks),
            (rows, z + 1, 1.0),
            (rows, z, -1.0),
            (rows, v, -step / second),
            (rows, u, -0.5 * push * step**2),
            (blocks + rows, v + 1, 1.0),
            (blocks + rows, v, -1.0),
            (blocks + rows, u, -push * step * second),
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
        since = self.times_s[looked] - at_s[block]
        to_go = np.concatenate([np.zeros(len(within)), self.arrival_s - self.times_s[rated]])
        row = np.arange(len(looked))
        entries = [
            (row, block, np.ones(len(looked))),
            (row, count + block, (since + to_go) / second),
            (row, 2 * count + block, push * (0.5 * since**2 + since * to_go)),
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
            raise BoundError(f"label {self.ranges_m[0]:g} m, V_x {self.vx_m_s:g} m/s: {solved.message}")
        pushes = np.clip(np.asarray(solved.x[2 * count :]), -1.0, 1.0)
        acceleration = 2.0 * self.model.disturbance_m_s2 * np.repeat(pushes, np.diff(knots))
        widths = [box.z_m[1] - box.z_m[0], box.vz_m_s[1] - box.vz_m_s[0]]
        offset, velocity = (
            float(np.clip(value / unit, -width, width))
            for value, unit, width in zip((solved.x[0], solved.x[count]), (metre, metre * second), widths, strict=True)
        )
        # The solution violates the limits by up to the solver's tolerances; scaling makes it satisfy them exactly.
        positions, speeds = motion_of(offset, velocity, acceleration, self.times_s)
        misses = positions[:-1] + speeds[:-1] * (self.arrival_s - self.times_s[:-1])
        sizes = np.abs(np.concatenate([positions[:-1], misses]))
        allowed = np.concatenate([limits / metre, miss_limits / metre])
        share = float(np.divide(allowed, sizes, out=np.full(len(sizes), np.inf), where=sizes > 0.0).min())
        share = min(1.0, share)
        offset, velocity, acceleration = share * offset, share * velocity, share * acceleration
        return offset, velocity, acceleration, float(motion_of(offset, velocity, acceleration, self.times_s)[0][-1])

    def _knots(self, last_common_step: int) -> Integers:
        """Return the steps at which blocks of constant acceleration end, with 0 and the arrival."""
        knots = [self.steps]
        while knots[-1] > 0:
            to_go = max(0, last_common_step - knots[-1])
            knots.append(max(0, knots[-1] - 1 - to_go // STEPS_A_BLOCK))
        return np.array(knots[::-1], dtype=np.int64)


def motion_of(
    offset: Floats | float, velocity: Floats | float, acceleration: Floats, times_s: Floats
) -> tuple[Floats, Floats]:
    """Return positions and speeds at times, with constant acceleration between them, shape (..., times).

    `offset` and `velocity` have the shape (...), `acceleration` (..., times - 1).
    """
    step = np.diff(times_s)
    start = np.zeros((*acceleration.shape[:-1], 1))
    changes = np.concatenate([start, np.cumsum(acceleration * step, axis=-1)], axis=-1)
    speeds = np.asarray(velocity)[..., None] + changes
    ways = np.cumsum(speeds[..., :-1] * step + 0.5 * acceleration * step**2, axis=-1)
    return np.asarray(offset)[..., None] + np.concatenate([start, ways], axis=-1), speeds


def _sparse(shape: tuple[int, int], *entries: tuple[Integers, Integers, Floats | float]) -> Any:
    """Return a sparse matrix of (rows, columns, values)."""
    from scipy.sparse import csc_array

    rows = np.concatenate([row for row, _, _ in entries])
    columns = np.concatenate([column for _, column, _ in entries])
    values = np.concatenate([np.broadcast_to(value, row.shape) for row, _, value in entries])
    return csc_array((values, (rows, columns)), shape=shape)
