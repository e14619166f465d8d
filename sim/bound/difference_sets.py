"""The set of differences of two motions along one axis with equal measurements, and its farthest
member.

The difference of two motions with the same impulses, pulled back to t = 0, is a vector s of offset
and velocity. To first order, the differences with equal measurements are (Theorem 5a of
docs/guarantee.md)

    S_0 = box,    S_(k+1) = (S_k cut by the strips of step k) + [-1, 1] g_k.

These sets are sums of segments [-1, 1] a_i. Their farthest member has one sign for each segment,
and each segment keeps the numbers of the segments that it consists of: the start and the
accelerations of the member.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from infoset._compile import ZERO, allocation_free, compiled
from infoset.arrays import Floats, Integers
from infoset.model import SetModel
from infoset.sensors import Sensor
from infoset.sim.bound.coasting import Coasting

MARGIN = 1e-6
"""Reserve as a share of each limit, for rounding in flights of the two motions."""
POSITION, PREDICTED_MISS = 0, 1
"""Columns of the strips of a step: limits of the difference of the positions w, and of that of w +
V_w x/c.
"""


class FarthestDifference(NamedTuple):
    """The member of a set of differences that is farthest at the arrival.

    Parameters
    ----------
    farthest : ndarray, shape (common + 1,)
        Maximum at the arrival of the differences whose measurements are equal in the first 0, 1,
        ..., common steps.
    start : ndarray, shape (2,)
        Offset and velocity of the last of these maxima, in units of their widths, in [-1, 1].
    pushes : ndarray, shape (steps,)
        Its accelerations over each step, in units of their maximum, in [-1, 1].
    """

    farthest: Floats
    start: Floats
    pushes: Floats


class Segments(NamedTuple):
    """Segments [-1, 1] (x, y) whose sum is a set, in the order of their angles from 0 to pi, and
    their origin.

    Parameters
    ----------
    x, y : ndarray
        What is left of each segment of the sum.
    number, share : ndarray
        Number of the segment that it was, in the order in which segments were made, and the share
        of it that is left.
    first_part : ndarray
        First of the parts of each segment ever made, by its number.
    part, part_share : ndarray
        Number of the segment of each part, and the share of it that is the part, negative if it is
        reversed.
    """

    x: Floats
    y: Floats
    number: Integers
    share: Floats
    first_part: Integers
    part: Integers
    part_share: Floats


@allocation_free
def find_place(segments: Segments, count: int, x: float, y: float) -> int:
    """Return the index of the first segment whose angle is not less than that of a direction."""
    low = 0
    high = count
    while low < high:
        middle = (low + high) // 2
        if segments.x[middle] * y - segments.y[middle] * x > 0.0:
            low = middle + 1
        else:
            high = middle
    return low


@allocation_free
def insert_segment(
    segments: Segments, count: int, place: int, x: float, y: float, number: int
) -> int:
    """Insert a whole segment at an index and return the number of segments."""
    for i in range(count, place, -1):
        segments.x[i] = segments.x[i - 1]
        segments.y[i] = segments.y[i - 1]
        segments.number[i] = segments.number[i - 1]
        segments.share[i] = segments.share[i - 1]
    segments.x[place] = x
    segments.y[place] = y
    segments.number[place] = number
    segments.share[place] = 1.0
    return count + 1


@allocation_free
def add_segment(segments: Segments, count: int, made: int, x: float, y: float) -> tuple[int, float]:
    """Add a segment to the sum; return the number of segments and the sign of its direction from 0
    to pi.
    """
    sign = 1.0
    if y < 0.0 or (y == 0.0 and x < 0.0):
        sign = -1.0
    segments.first_part[made + 1] = segments.first_part[made]
    if x != 0.0 or y != 0.0:
        place = find_place(segments, count, sign * x, sign * y)
        count = insert_segment(segments, count, place, sign * x, sign * y, made)
    return count, sign


@allocation_free
def cut_by_strip(
    segments: Segments, count: int, made: int, normal_x: float, normal_y: float, limit: float
) -> tuple[int, int]:
    """Cut the sum by abs(normal s) <= limit; return the number of its segments and of those made so
    far.

    Lemma 20a: the corner is the vertex where abs(normal s) is greatest. On each side of it segments
    are removed, the last one in part, until each side has lost half of the excess of the corner
    over the limit. The new segment along the border is the sum of what was removed. Its signs
    follow from the order of the segments, because that of a height is rounded if a segment is
    parallel to the border. Cost: O(count).
    """
    height = 0.0
    for i in range(count):
        height += abs(normal_x * segments.x[i] + normal_y * segments.y[i])
    excess = height - limit
    if not excess > 0.0:
        return count, made

    border_x = -normal_y
    border_y = normal_x
    if border_y < 0.0 or (border_y == 0.0 and border_x < 0.0):
        border_x = -border_x
        border_y = -border_y
    corner = find_place(segments, count, border_x, border_y)

    length = 0.0
    parts = segments.first_part[made]
    for side in range(2):
        to_remove = 0.5 * excess
        for step in range(count):
            if to_remove <= 0.0:
                break
            if side == 0:
                i = (corner + step) % count
                sign = 1.0 if i >= corner else -1.0
            else:
                i = (corner - 1 - step) % count
                sign = 1.0 if i < corner else -1.0
            if segments.share[i] == 0.0:
                continue

            lost = abs(normal_x * segments.x[i] + normal_y * segments.y[i])
            removed = 1.0 if lost <= to_remove else to_remove / lost
            to_remove -= lost
            length += sign * removed * (border_x * segments.x[i] + border_y * segments.y[i])
            segments.part[parts] = segments.number[i]
            segments.part_share[parts] = sign * removed * segments.share[i]
            parts += 1
            left = 1.0 - removed
            segments.x[i] *= left
            segments.y[i] *= left
            segments.share[i] *= left

    kept = 0
    place = 0
    for i in range(count):
        if segments.share[i] == 0.0:
            continue
        segments.x[kept] = segments.x[i]
        segments.y[kept] = segments.y[i]
        segments.number[kept] = segments.number[i]
        segments.share[kept] = segments.share[i]
        kept += 1
        if i < corner:
            place = kept
    segments.first_part[made + 1] = parts
    length /= border_x * border_x + border_y * border_y
    if length > 0.0:
        kept = insert_segment(segments, kept, place, length * border_x, length * border_y, made)
    return kept, made + 1


@compiled
def farthest_difference(
    widths: Floats, pushes: Floats, normals: Floats, limits: Floats, towards: Floats, common: int
) -> FarthestDifference:
    """Return the farthest differences with equal measurements in the first steps.

    Parameters
    ----------
    widths : ndarray, shape (2,)
        Maximum offset and velocity of a difference at t = 0.
    pushes : ndarray, shape (steps, 2)
        Segments g_k of the accelerations over each step.
    normals : ndarray, shape (steps, n, 2)
        Normals of the strips of each step.
    limits : ndarray, shape (steps, n)
        Limits of abs(normal s); a strip whose limit is infinite does not cut.
    towards : ndarray, shape (2,)
        Derivative of the distance at the arrival with respect to s.
    common : int
        Number of steps whose strips cut.
    """
    steps, strips = limits.shape
    made_at_most = 2 + steps + common * strips
    # A strip removes at most two segments in part, and each segment is removed as a whole once.
    parts_at_most = made_at_most + 2 * common * strips
    segments = Segments(
        np.empty(made_at_most),
        np.empty(made_at_most),
        np.empty(made_at_most, dtype=np.int64),
        np.empty(made_at_most),
        np.zeros(made_at_most + 1, dtype=np.int64),
        np.empty(parts_at_most, dtype=np.int64),
        np.empty(parts_at_most),
    )
    later = np.zeros(steps + 1)
    for k in range(steps - 1, -1, -1):
        later[k] = later[k + 1] + abs(towards[0] * pushes[k, 0] + towards[1] * pushes[k, 1])

    signs = np.empty(made_at_most)
    number_of_push = np.empty(common, dtype=np.int64)
    count = ZERO
    made = ZERO
    for i in range(2):
        width_x = widths[0] if i == 0 else 0.0
        width_y = widths[1] if i == 1 else 0.0
        count, signs[made] = add_segment(segments, count, made, width_x, width_y)
        made += 1
    farthest = np.empty(common + 1)
    farthest[0] = abs(towards[0] * widths[0]) + abs(towards[1] * widths[1]) + later[0]
    for k in range(common):
        for strip in range(strips):
            if limits[k, strip] < np.inf:
                normal = normals[k, strip]
                count, made = cut_by_strip(
                    segments, count, made, normal[0], normal[1], limits[k, strip]
                )
        farthest[k + 1] = later[k]
        for i in range(count):
            farthest[k + 1] += abs(towards[0] * segments.x[i] + towards[1] * segments.y[i])
        if k + 1 < common:
            count, signs[made] = add_segment(segments, count, made, pushes[k, 0], pushes[k, 1])
            number_of_push[k] = made
            made += 1

    # The signs of the segments of the sum, passed down to the parts of each, the youngest one
    # first.
    values = np.zeros(made)
    for i in range(count):
        along = towards[0] * segments.x[i] + towards[1] * segments.y[i]
        values[segments.number[i]] = segments.share[i] if along >= 0.0 else -segments.share[i]
    for number in range(made - 1, -1, -1):
        for part in range(segments.first_part[number], segments.first_part[number + 1]):
            values[segments.part[part]] += values[number] * segments.part_share[part]

    start = np.empty(2)
    for i in range(2):
        start[i] = min(1.0, max(-1.0, signs[i] * values[i]))
    chosen = np.empty(steps)
    for k in range(steps):
        if k + 1 < common:
            number = number_of_push[k]
            chosen[k] = min(1.0, max(-1.0, signs[number] * values[number]))
        else:
            chosen[k] = (
                1.0 if towards[0] * pushes[k, 0] + towards[1] * pushes[k, 1] >= 0.0 else -1.0
            )
    return FarthestDifference(farthest, start, chosen)


class AxisDifferences:
    """The sets of differences along one lateral axis.

    The difference follows the transition matrices of `motion`, without its small parts along the
    other axes.

    Attributes
    ----------
    limits_m : ndarray, shape (steps, 2)
        Maximum differences of the positions and of the predicted misses at each step with the same
        measurements; infinite where nothing is measured.
    """

    def __init__(
        self,
        model: SetModel,
        sensors: Mapping[str, Sensor],
        due: Mapping[str, Integers],
        motion: Coasting,
        axis: int,
    ) -> None:
        box = model.bounds
        own = [axis, motion.axes + axis]
        transition = motion.transition[:, own][:, :, own]
        positions = transition[:, 0]
        speeds = transition[:, 1]
        to_go_s = motion.range_m / motion.closing_speed_m_s[:-1]
        self._widths = np.array([np.ptp(box.z_m), np.ptp(box.vz_m_s)])
        self._pushes = 2.0 * model.disturbance_m_s2 * np.diff(motion.pushed[:, own, axis], axis=0)
        self._normals = np.stack(
            [positions[:-1], positions[:-1] + to_go_s[:, None] * speeds[:-1]], axis=1
        )
        self._towards = np.ascontiguousarray(positions[-1])
        self._acceleration_m_s2 = 2.0 * model.disturbance_m_s2

        self.limits_m = np.full((len(to_go_s), 2), np.inf)
        for name, sensor in sensors.items():
            measured = due[name]
            speeds_m_s = motion.closing_speed_m_s[measured]
            band = sensor.band(motion.range_m[measured], speeds_m_s, 2.0 * (1.0 - MARGIN))
            if band is not None:
                column = PREDICTED_MISS if band[0] else POSITION
                self.limits_m[measured, column] = np.minimum(
                    self.limits_m[measured, column], band[1]
                )

    def farthest_m(self) -> Floats:
        """Return the maximum distances at the arrival with equal measurements in the first 0, 1,
        ..., all steps.
        """
        return self._farthest(self.limits_m, len(self.limits_m)).farthest

    def member(self, limits_m: Floats, common_steps: int) -> tuple[float, float, Floats]:
        """Return the farthest difference with equal measurements in the first steps.

        `limits_m` replaces the attribute; an infinite limit leaves a measurement out. The
        difference is an offset and a velocity at t = 0, and the acceleration over each step.
        """
        found = self._farthest(limits_m, common_steps)
        offset_m, velocity_m_s = (found.start * self._widths).tolist()
        return offset_m, velocity_m_s, found.pushes * self._acceleration_m_s2

    def _farthest(self, limits_m: Floats, common_steps: int) -> FarthestDifference:
        return farthest_difference(
            self._widths, self._pushes, self._normals, limits_m, self._towards, common_steps
        )
