"""Differences of two motions along one axis with equal measurements, and the farthest one.

The difference of two motions with the same impulses, pulled back to t = 0, is a vector s of offset
and velocity. To first order, the differences with equal measurements are (Theorem 5a of
docs/guarantee-bound.md)

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
"""Reserve as a share of each limit, for rounding in flights of the two motions. Chosen: it lowers a
bound by less than a millionth (measured), and the errors in simulated pairs stay within their
bounds (test_pair_flight).
"""
POSITION, PREDICTED_MISS = 0, 1
"""Columns of the strips of a step: limits of the differences of the positions w, and of the
predicted misses w + V_w x/c.
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
    """Segments [-1, 1] (x, y) whose sum is a set, in the order of their angles in [0, pi).

    Each segment has a number in the order in which segments were made. Cuts remove segments or
    parts of them, and make a new segment of the parts. The kernels below change the arrays; of `x`,
    `y`, `number` and `share` the first `count` values are in use, of `first_part` the first `made`
    + 1, with the numbers of segments in the sum and of segments ever made.

    Parameters
    ----------
    x, y : ndarray
        The rest of each segment of the sum, in the order of the angles.
    number, share : ndarray
        Number of the whole segment, and the share of it that is left, in the same order.
    first_part : ndarray
        Index of the first part of each segment ever made, by its number.
    part, part_share : ndarray
        For each part: the number of the segment that it comes from, and its share of this segment,
        negative if it is reversed.
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
    """Return the index of the first segment whose angle is not less than that of a direction.

    The angle of the direction (x, y) is in [0, pi). The index is `count` if all angles are less.
    """
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
    """Insert a whole segment at an index and return the number of segments.

    The index must be the place of its angle among the others.
    """
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
    """Add a segment to the sum, and return the number of segments and a sign.

    The stored segment is the sign times (x, y), so that its angle is in [0, pi). Its number is
    `made`, which the caller then increases by one, also for a segment of length zero, which is not
    stored.
    """
    sign = 1.0
    if y < 0.0 or (y == 0.0 and x < 0.0):
        sign = -1.0
    segments.first_part[made + 1] = segments.first_part[made]
    if x != 0.0 or y != 0.0:
        place = find_place(segments, count, sign * x, sign * y)
        count = insert_segment(segments, count, place, sign * x, sign * y, made)
    return count, sign


class Strip(NamedTuple):
    """Normal of a strip abs(normal s) <= limit, and direction of its border, in [0, pi).

    The two have the same length.
    """

    normal_x: float
    normal_y: float
    border_x: float
    border_y: float


class Removed(NamedTuple):
    """Sum of what a cut removed.

    Parameters
    ----------
    parts : int
        Number of all parts so far, also of earlier segments.
    length : float
        Component of the sum along the border, times the length of the border's direction.
    """

    parts: int
    length: float


@allocation_free
def strip_of(normal_x: float, normal_y: float) -> Strip:
    """Return the strip with a normal."""
    border_x = -normal_y
    border_y = normal_x
    if border_y < 0.0 or (border_y == 0.0 and border_x < 0.0):
        border_x = -border_x
        border_y = -border_y
    return Strip(normal_x, normal_y, border_x, border_y)


@allocation_free
def remove_part(
    segments: Segments, i: int, sign: float, to_remove: float, strip: Strip, removed: Removed
) -> tuple[float, Removed]:
    """Remove a segment, or the part of it with the height `to_remove`, which is positive.

    Return the height that is still to be removed, not positive if the segment was enough, and the
    sum of what was removed. `sign` is the sign of the segment in this sum. The removed part is
    noted in `segments.part`. The share is exactly 1 for a whole segment, so that exactly nothing of
    it is left (`remove_whole_segments`).
    """
    height = abs(strip.normal_x * segments.x[i] + strip.normal_y * segments.y[i])
    share = 1.0 if height <= to_remove else to_remove / height
    along = strip.border_x * segments.x[i] + strip.border_y * segments.y[i]
    segments.part[removed.parts] = segments.number[i]
    segments.part_share[removed.parts] = sign * share * segments.share[i]

    left = 1.0 - share
    segments.x[i] *= left
    segments.y[i] *= left
    segments.share[i] *= left
    return to_remove - height, Removed(removed.parts + 1, removed.length + sign * share * along)


@allocation_free
def remove_whole_segments(segments: Segments, count: int) -> int:
    """Close the gaps of segments of which nothing is left, and return the number of the others.

    The share that is left of a whole segment is exactly zero (`remove_part`).
    """
    kept = 0
    for i in range(count):
        if segments.share[i] == 0.0:
            continue
        segments.x[kept] = segments.x[i]
        segments.y[kept] = segments.y[i]
        segments.number[kept] = segments.number[i]
        segments.share[kept] = segments.share[i]
        kept += 1
    return kept


@allocation_free
def cut_by_strip(
    segments: Segments, count: int, made: int, normal_x: float, normal_y: float, limit: float
) -> tuple[int, int]:
    """Cut the sum by abs(normal s) <= limit; return its number of segments, and of all ever made.

    The limit is not negative. If the whole sum is within it, nothing changes.

    Lemma 20a: the corner is the vertex where abs(normal s) is greatest. On each side of it segments
    are removed, the last one in part, until each side has lost half of the excess of the corner
    over the limit. The new segment along the border is the sum of the removed parts. Their signs
    follow from the order of the segments: the sign of a height is rounding if a segment is parallel
    to the border. Cost: O(count).
    """
    height = 0.0
    for i in range(count):
        height += abs(normal_x * segments.x[i] + normal_y * segments.y[i])
    excess = height - limit
    if not excess > 0.0:
        return count, made

    # Segments with a smaller angle than the border are before the corner.
    strip = strip_of(normal_x, normal_y)
    corner = find_place(segments, count, strip.border_x, strip.border_y)

    removed = Removed(segments.first_part[made], 0.0)
    for side in range(2):
        to_remove = 0.5 * excess
        for step in range(count):
            if to_remove <= 0.0:
                break
            # Away from the corner; past the end of the list the edges are reversed segments.
            i = (corner + step) % count if side == 0 else (corner - 1 - step) % count
            sign = 1.0 if (i >= corner) == (side == 0) else -1.0
            # The other side may have removed the whole segment.
            if segments.share[i] > 0.0:
                to_remove, removed = remove_part(segments, i, sign, to_remove, strip, removed)

    place = 0
    for i in range(corner):
        if segments.share[i] > 0.0:
            place += 1
    count = remove_whole_segments(segments, count)

    segments.first_part[made + 1] = removed.parts
    border_square = strip.border_x * strip.border_x + strip.border_y * strip.border_y
    length = removed.length / border_square
    if length > 0.0:
        x = length * strip.border_x
        y = length * strip.border_y
        count = insert_segment(segments, count, place, x, y, made)
    return count, made + 1


@allocation_free
def write_shares(
    segments: Segments, count: int, made: int, towards: Floats, shares: Floats
) -> None:
    """Write the shares of the segments ever made in the member of the sum farthest along `towards`.

    They are in [-1, 1] up to rounding. `shares`, shape (made,), is zero before. The signs of the
    segments of the sum are passed down to the parts of each, the youngest first.
    """
    for i in range(count):
        along = towards[0] * segments.x[i] + towards[1] * segments.y[i]
        shares[segments.number[i]] = segments.share[i] if along >= 0.0 else -segments.share[i]
    for number in range(made - 1, -1, -1):
        for part in range(segments.first_part[number], segments.first_part[number + 1]):
            shares[segments.part[part]] += shares[number] * segments.part_share[part]


@allocation_free
def within_one(value: float) -> float:
    """Return a number limited to [-1, 1]: a sum of shares exceeds it by rounding."""
    return min(1.0, max(-1.0, value))


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
    # Each width, acceleration and cut makes at most one segment. A strip removes at most two
    # segments in part, and each segment is removed as a whole at most once.
    made_at_most = 2 + steps + common * strips
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
    signs = np.empty(made_at_most)
    number_of_push = np.empty(common, dtype=np.int64)

    # Distance by the accelerations from each step on, which no later measurement limits.
    later = np.zeros(steps + 1)
    for k in range(steps - 1, -1, -1):
        later[k] = later[k + 1] + abs(towards[0] * pushes[k, 0] + towards[1] * pushes[k, 1])

    # S_0: the segments 0 and 1 are the offset and the velocity.
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

        # The accelerations after the last common step are not limited: `later` contains them.
        if k + 1 < common:
            count, signs[made] = add_segment(segments, count, made, pushes[k, 0], pushes[k, 1])
            number_of_push[k] = made
            made += 1

    shares = np.zeros(made)
    write_shares(segments, count, made, towards, shares)
    start = np.empty(2)
    for i in range(2):
        start[i] = within_one(signs[i] * shares[i])
    chosen = np.empty(steps)
    for k in range(steps):
        if k + 1 < common:
            number = number_of_push[k]
            chosen[k] = within_one(signs[number] * shares[number])
        else:
            along = towards[0] * pushes[k, 0] + towards[1] * pushes[k, 1]
            chosen[k] = 1.0 if along >= 0.0 else -1.0
    return FarthestDifference(farthest, start, chosen)


class DifferenceMember(NamedTuple):
    """A difference along one axis: at t = 0, and the acceleration over each step."""

    offset_m: float
    velocity_m_s: float
    acceleration_m_s2: Floats


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
        # Rows and columns of the position and the velocity along the axis.
        own = [axis, motion.axes + axis]
        transition = motion.transition[:, own][:, :, own]
        positions = transition[:, 0]
        speeds = transition[:, 1]
        to_go_s = motion.range_m / motion.closing_speed_m_s[:-1]
        # Two starts differ by at most the width of the box, two accelerations by twice the bound.
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
            # Two motions can have equal measurements if they differ by at most two error bounds.
            band = sensor.band(motion.range_m[measured], speeds_m_s, 2.0 * (1.0 - MARGIN))
            if band is not None:
                column = PREDICTED_MISS if band[0] else POSITION
                self.limits_m[measured, column] = np.minimum(
                    self.limits_m[measured, column], band[1]
                )

    def farthest_m(self) -> Floats:
        """Return the maximum distances at the arrival, shape (steps + 1,).

        The measurements are equal in the first 0, 1, ..., all steps.
        """
        return self._farthest(self.limits_m, len(self.limits_m)).farthest

    def member(self, limits_m: Floats, common_steps: int) -> DifferenceMember:
        """Return the farthest difference with equal measurements in the first steps.

        `limits_m` replaces the attribute; an infinite limit leaves a measurement out.
        """
        found = self._farthest(limits_m, common_steps)
        offset_m, velocity_m_s = (found.start * self._widths).tolist()
        return DifferenceMember(offset_m, velocity_m_s, found.pushes * self._acceleration_m_s2)

    def _farthest(self, limits_m: Floats, common_steps: int) -> FarthestDifference:
        return farthest_difference(
            self._widths, self._pushes, self._normals, limits_m, self._towards, common_steps
        )
