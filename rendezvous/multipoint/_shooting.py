"""Paths under the gravity of one point, by shooting.

Newton's method starts at the coasting orbit, and the targets are moved away from it in steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import allocation_free, compiled
from infoset.rendezvous.dormand_prince import STAGES, step_of
from infoset.rendezvous.multipoint.segments import Nodes, Path, time_gradient
from infoset.rendezvous.relative_motion.linear_motion import even_breaks
from infoset.rendezvous.two_body import coast

R, V, L_R, L_V = 0, 3, 6, 9
"""First rows of the position, the velocity and their costates."""
STEP_RAD = 0.1
"""Turn of a circular orbit in the longest step: errors are then about 1e-12 a revolution."""
SMALLEST_COSTATE = 1e-300
"""A smaller costate limits no step: it stands for zero in a division."""
MAX_PATH_STEPS = 50_000
"""Largest number of steps of a segment: some 800 revolutions."""
MIN_RADIUS = 0.02
"""A trajectory that is at most this far from the centre at the start of a step, relative to the
distance at the start of its block, counts as falling into the centre. Chosen: there the steps are
some 350 times shorter than at the start.
"""
RESIDUAL_TOLERANCE = 1e-11
"""Largest residual of a trajectory, in units of its block: ten times the errors of the steps."""
ON_THE_WAY = 1e-4
"""Largest residual of the trajectories from which others are continued; chosen: they are only
guesses."""
RESIDUAL_ROUNDING = 1e-8
"""Residual below which a residual that no longer decreases is accepted as rounding. Chosen: on long
trajectories rounding can be greater than `RESIDUAL_TOLERANCE`."""
MIN_STEP = 1.0 / 64.0
"""Smallest part of the first residual that a step removes; chosen: a search that needs shorter
steps has failed.
"""
MIN_STEP_FROM_NEAR = 1.0 / 8.0
"""The same for a search that starts from a trajectory of other times; chosen: if that one is not
near, the coasting orbit is the better start."""
_ROUNDS = 12
"""Largest number of rounds of Newton's method, whose digits double in each with new derivatives."""
_FAST = 0.2
"""Ratio of a residual to the one before up to which the same derivatives are used again; chosen."""
_MAX_CORRECTION = 0.5
"""Largest residual, in units of the block, from which Newton's method goes on; chosen: from greater
ones it mostly diverges."""
_FIRST_STEP = 0.3
"""Largest residual that the first step removes; chosen, below `_MAX_CORRECTION`."""


@allocation_free
def _rates(
    _time: float, _y: Floats, z: Floats, _parameters: tuple[()], _dy: Floats, slope: Floats
) -> None:
    """Fill the time derivatives of z, in column 0, and of its variations, in the others.

    r' = v, v' = -r / |r|^3 + lambda_v, lambda_r' = lambda_v / |r|^3 - 3 (r . lambda_v) r / |r|^5,
    lambda_v' = -lambda_r, and the rate of the energy is |lambda_v|^2 / 2. The energy is not varied:
    its row is not written in the other columns, and must be zero there. Rows are those of
    `propagate`; the factors 3 and 15 are of the derivatives of |r|^-3 and |r|^-5.
    """
    r0 = z[0, 0]
    r1 = z[1, 0]
    r2 = z[2, 0]
    l0 = z[9, 0]
    l1 = z[10, 0]
    l2 = z[11, 0]
    squared = r0 * r0 + r1 * r1 + r2 * r2
    third = 1.0 / (squared * np.sqrt(squared))
    fifth = third / squared
    along = r0 * l0 + r1 * l1 + r2 * l2
    slope[12, 0] = 0.5 * (l0 * l0 + l1 * l1 + l2 * l2)

    # Rates that are parts of the state, of all columns.
    for column in range(z.shape[1]):
        for axis in range(3):
            slope[axis, column] = z[3 + axis, column]
            slope[9 + axis, column] = -z[6 + axis, column]
    for axis in range(3):
        slope[3 + axis, 0] = -third * z[axis, 0] + z[9 + axis, 0]
        slope[6 + axis, 0] = third * z[9 + axis, 0] - 3.0 * fifth * along * z[axis, 0]

    # Variations: d and e are the variations of position and of lambda_v.
    for column in range(1, z.shape[1]):
        d0 = z[0, column]
        d1 = z[1, column]
        d2 = z[2, column]
        e0 = z[9, column]
        e1 = z[10, column]
        e2 = z[11, column]
        out = r0 * d0 + r1 * d1 + r2 * d2
        turned = l0 * d0 + l1 * d1 + l2 * d2
        costate = r0 * e0 + r1 * e1 + r2 * e2
        for axis in range(3):
            position = z[axis, 0]
            primer = z[9 + axis, 0]
            slope[3 + axis, column] = (
                3.0 * fifth * out * position - third * z[axis, column] + z[9 + axis, column]
            )
            second = 3.0 * fifth * (along * z[axis, column] + position * turned + primer * out)
            second -= 15.0 * fifth / squared * along * out * position
            first = 3.0 * fifth * costate * position - third * z[9 + axis, column]
            slope[6 + axis, column] = -first - second


_step = step_of(_rates)


@allocation_free
def column_size(z: Floats, first: int) -> float:
    """Size of the vector in rows `first` to `first` + 2 of column 0 of z."""
    return float(np.sqrt(z[first, 0] ** 2 + z[first + 1, 0] ** 2 + z[first + 2, 0] ** 2))


@allocation_free
def longest_step(z: Floats) -> float:
    """Longest step from the state and costate in column 0 of z.

    In one step the circular orbit at the present distance turns by 0.1 radians at most; and neither
    the speed, nor the control lambda_v at its present size, nor its rate lambda_r moves the craft
    by more than about 0.1, 0.1^2 / 2 and 0.1^3 / 6 of this distance. Relative errors are about
    1e-12 a revolution.
    """
    radius = column_size(z, R)
    by_turn_or_speed = radius / max(1.0 / np.sqrt(radius), column_size(z, V))
    by_control = np.sqrt(radius / max(column_size(z, L_V), SMALLEST_COSTATE))
    by_control_rate = np.cbrt(radius / max(column_size(z, L_R), SMALLEST_COSTATE))
    return float(STEP_RAD * min(by_turn_or_speed, by_control, by_control_rate))


@compiled
def propagate(z: Floats, duration: float) -> bool:
    """Propagate a state, its costate and the energy, with variations, in place.

    `z`, shape (13, 1 + m), contains (r, v, lambda_r, lambda_v, energy) in column 0, and its
    variations in the others. Lengths and times are such that the gravitational parameter is one.
    Returns whether the trajectory neither falls into the centre nor takes too many steps. The
    energy is not varied. Steps are those of `longest_step`.
    """
    slopes = np.zeros((STAGES, *z.shape))
    z_next = np.zeros(z.shape)
    no_y = np.zeros(0)
    no_slopes = np.zeros((STAGES, 0))
    left = duration
    for _ in range(MAX_PATH_STEPS):
        if not column_size(z, R) > MIN_RADIUS:
            return False
        step = min(left, longest_step(z))
        # No tiny last step, which rounding of `left` would leave. A thousandth, chosen, lengthens
        # the last step by so little that its error stays the same.
        if left - step < 1e-3 * step:
            step = left
        _step(0.0, step, 0, no_y, z, (), no_slopes, slopes, no_y, z_next)
        for i in range(z.shape[0]):
            for j in range(z.shape[1]):
                z[i, j] = z_next[i, j]
        left -= step
        if left <= 0.0:
            return True
    return False


@dataclass(frozen=True, eq=False)
class Block:
    """Visits up to the next rendezvous, from a known state.

    `goal`, shape (k, 6), contains the states of the targets.
    """

    start_s: float
    start_state: Floats
    time_s: Floats
    goal: Floats
    rendezvous: bool
    gravitational_parameter_m3_s2: float

    @cached_property
    def units(self) -> tuple[float, float]:
        """Units of length and time in which mu is one; the length is the distance at the start."""
        length = float(np.linalg.norm(self.start_state[:3]))
        return length, float(np.sqrt(length**3 / self.gravitational_parameter_m3_s2))

    @cached_property
    def value_units(self) -> Floats:
        """Units of a state and its costate, shape (12,)."""
        length, duration = self.units
        return length / np.repeat([1.0, duration, duration**3, duration**2], 3)

    @cached_property
    def durations(self) -> Floats:
        """Durations of the segments, shape (k,), in units of the block."""
        return np.diff(self.time_s, prepend=self.start_s) / self.units[1]


def blocks_of(
    start_s: float, start_state: Floats, nodes: Nodes, gravitational_parameter_m3_s2: float
) -> list[Block]:
    """Split visits after every rendezvous: the next ones start from a known state.

    The last block ends at the last node, also if that is a flyby.
    """
    blocks = []
    first = 0
    for node in range(len(nodes.arrive_s)):
        if nodes.rendezvous[node] or node == len(nodes.arrive_s) - 1:
            times = nodes.arrive_s[first : node + 1]
            goal = nodes.arrive[first : node + 1]
            is_met = bool(nodes.rendezvous[node])
            blocks.append(
                Block(start_s, start_state, times, goal, is_met, gravitational_parameter_m3_s2)
            )
            start_s = float(nodes.leave_s[node])
            start_state = nodes.leave[node]
            first = node + 1
    return blocks


@dataclass(frozen=True, eq=False)
class Shot:
    """Trajectory of a block, given by its `unknowns` in units of the block.

    They are lambda at the start, then the jumps at all nodes but the last.
    """

    block: Block
    unknowns: Floats

    def along(self, time_s: Floats) -> Floats:
        """Return states and costates, SI, shape (k, 12), at k times.

        The times, s, do not decrease, and begin no earlier than the block. At a node but the last,
        the costate is that after its jump.
        """
        block = self.block
        _, unit_s = block.units
        z = _initial(block, self.unknowns[:6])
        now = block.start_s
        node = 0
        values = np.empty((len(time_s), 12))
        for row, time in enumerate(time_s):
            while node < len(block.time_s) - 1 and block.time_s[node] <= time:
                _advance(z, (block.time_s[node] - now) / unit_s)
                self._jump(z, node)
                now = block.time_s[node]
                node = node + 1
            _advance(z, (time - now) / unit_s)
            now = time
            values[row] = z[:12, 0]
        return values * block.value_units

    def segments(self) -> tuple[Floats, Floats, float]:
        """Return states and costates at the ends of segments, shape (k, 12), and the energy: SI."""
        block = self.block
        count = len(block.time_s)
        z = _initial(block, self.unknowns[:6])
        starts = np.empty((count, 12))
        ends = np.empty((count, 12))
        for node in range(count):
            starts[node] = z[:12, 0]
            _advance(z, block.durations[node])
            ends[node] = z[:12, 0]
            if node < count - 1:
                self._jump(z, node)
        length, duration = block.units
        return (
            starts * block.value_units,
            ends * block.value_units,
            float(z[12, 0]) * length**2 / duration**3,
        )

    def _jump(self, z: Floats, node: int) -> None:
        """Subtract the jump at a node, costate before minus costate after, from lambda_r."""
        z[6:9, 0] -= self.unknowns[6 + 3 * node : 9 + 3 * node]


@dataclass(frozen=True, eq=False)
class ShotPath(Path):
    """A path of trajectories that were shot, one for each block, and of the stays between them."""

    shots: tuple[Shot, ...]

    @classmethod
    def of(cls, nodes: Nodes, shots: tuple[Shot, ...]) -> ShotPath:
        """Return the path of trajectories through `nodes`."""
        starts, ends, costs = zip(*(shot.segments() for shot in shots), strict=True)
        start = np.concatenate(starts)
        end = np.concatenate(ends)
        before = end[:, 6:]
        after = np.vstack([start[1:, 6:], np.zeros(6)])
        return cls(
            nodes,
            sum(costs),
            np.concatenate([[shots[0].block.start_s], nodes.leave_s[:-1]]),
            start[:, :6],
            end[:, :6],
            before,
            after,
            start[0, 6:],
            time_gradient(nodes, end[:, :6], before, after),
            shots,
        )

    def breaks(self) -> Floats:
        """Return times, s, not decreasing: radians of circular orbits at starts of segments."""
        mu = self.shots[0].block.gravitational_parameter_m3_s2
        radians = np.sqrt(mu / np.linalg.norm(self.start_states[:, :3], axis=1) ** 3) * (
            self.nodes.arrive_s - self.starts_s
        )
        return np.concatenate([*map(even_breaks, self.starts_s, self.nodes.arrive_s, radians)])

    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates, shapes (k, 6), at k times from the start to the last node."""
        times = np.asarray(time_s, dtype=np.float64)
        values = np.zeros((len(times), 12))
        # A time belongs to the last block that starts before it or at it: the stay after a block
        # belongs to this block.
        starts_s = [shot.block.start_s for shot in self.shots]
        which = np.searchsorted(starts_s, times, side="right") - 1
        for index, shot in enumerate(self.shots):
            rows = np.flatnonzero(which == index)
            end = float(shot.block.time_s[-1])
            # `Shot.along` needs times that do not decrease.
            rows = rows[np.argsort(times[rows], kind="stable")]
            # The path ends at the last node, without a stay.
            stays = (times[rows] >= end) & (index < len(self.shots) - 1)
            values[rows[~stays]] = shot.along(times[rows[~stays]])
            rows = rows[stays]
            met = np.broadcast_to(shot.block.goal[-1], (len(rows), 6))
            values[rows, :6] = coast(
                met, times[rows] - end, shot.block.gravitational_parameter_m3_s2
            )
        return values[:, :6], values[:, 6:]


def shoot(block: Block, near: Floats | None = None) -> Shot | None:
    """Return the trajectory of a block by Newton's method, or None if it fails.

    The residual is reduced in steps. The initial unknowns are `near`, of other times; if Newton's
    method fails from them, or they are None, those of the coasting orbit.
    """
    # Without lambda and jumps the chaser coasts: six numbers, and three for each node but the last.
    coasting = np.zeros(3 + 3 * len(block.time_s))
    initials = [] if near is None else [(near, MIN_STEP_FROM_NEAR)]
    for initial, min_step in (*initials, (coasting, MIN_STEP)):
        unknowns = _follow(block, initial, min_step)
        if unknowns is not None:
            return Shot(block, unknowns)
    return None


def _initial(block: Block, costate: Floats, variations: int = 0) -> Floats:
    """Return an array for the state, costate and energy of a block, with variations.

    Column 0 has the values at the start of the block. The columns of the variations are zero: the
    caller sets the derivatives.
    """
    z = np.zeros((13, 1 + variations))
    z[:12, 0] = np.concatenate([block.start_state / block.value_units[:6], costate])
    return z


def _advance(z: Floats, duration: float) -> None:
    if duration > 0.0 and not propagate(z, duration):
        raise ValueError("a trajectory falls into the centre")


def _residual(block: Block, unknowns: Floats, slopes: Floats | None = None) -> Floats | None:
    """Return the residual at the nodes, or None if there is no trajectory.

    If `slopes` is given, the derivatives are filled into it; without a trajectory some of them.
    """
    goals = block.goal / block.value_units[:6]
    size = len(unknowns)
    last = len(block.time_s) - 1
    z = _initial(block, unknowns[:6], size)
    # The first six unknowns are lambda at the start. A jump is an unknown of the node where it is.
    z[6:12, 1:7] = np.eye(6)
    residual = np.empty(size)
    for node, duration in enumerate(block.durations):
        known = 1 if slopes is None else 7 + 3 * node  # columns of later jumps are zero
        varied = z[:, :known].copy()
        if duration > 0.0 and not propagate(varied, duration):
            return None
        z[:, :known] = varied
        rows = slice(3 * node, 3 * node + 3)
        jump = slice(6 + 3 * node, 9 + 3 * node)
        residual[rows] = z[:3, 0] - goals[node, :3]
        if slopes is not None:
            slopes[rows] = z[:3, 1:]
        if node < last:
            z[6:9, 0] -= unknowns[jump]
            z[6:9, 7 + 3 * node : 10 + 3 * node] -= np.eye(3)

    # At the last node, the velocity of a rendezvous is given; lambda_v of a flyby is zero.
    if block.rendezvous:
        residual[-3:] = z[V : V + 3, 0] - goals[last, 3:]
    else:
        residual[-3:] = z[L_V : L_V + 3, 0]
    if slopes is not None:
        slopes[-3:] = z[V : V + 3, 1:] if block.rendezvous else z[L_V : L_V + 3, 1:]
        if not np.isfinite(slopes).all():
            return None
    return residual if np.isfinite(residual).all() else None


def _follow(block: Block, initial: Floats, min_step: float) -> Floats | None:
    """Continue unknowns to a residual of zero; None if that fails.

    The residual is reduced in proportion, in steps that are halved until Newton's method converges;
    a step below `min_step`, a share of the first residual, has failed.
    """
    slopes = np.empty((len(initial), len(initial)))
    first = _residual(block, initial, slopes)
    if first is None:
        return None
    unknowns = initial
    done = 0.0  # share of the first residual that is removed
    step = _FIRST_STEP / max(float(np.abs(first).max()), _FIRST_STEP)

    while True:
        # Derivative of the unknowns by the share.
        ahead = _solved(slopes, -first)
        if ahead is None:
            return None
        while True:
            share = min(done + step, 1.0)
            solved = _newton(
                block,
                unknowns + (share - done) * ahead,
                share,
                (1.0 - share) * first,
                slopes.copy(),  # a shorter step begins with the same derivatives
            )
            if solved is not None:
                break
            step *= 0.5
            if step < min_step:
                return None

        unknowns, rounds = solved
        if share == 1.0:
            return unknowns
        done = share
        # Longer steps after fast convergence; the numbers of rounds and both factors are chosen.
        if rounds <= 2:
            step *= 2.0
        elif rounds <= 4:
            step *= 1.5
        if _residual(block, unknowns, slopes) is None:
            return None


def _newton(
    block: Block, unknowns: Floats, share: float, goal: Floats, slopes: Floats
) -> tuple[Floats, int] | None:
    """Return unknowns with a residual `goal` by Newton's method, and the number of rounds.

    `share` is that of the first residual which is removed at `goal`: at 1 the result is final.
    `slopes` are derivatives near by, which are computed again, in place, if the convergence is
    slow. The result is None without convergence.
    """
    enough = RESIDUAL_TOLERANCE if share == 1.0 else ON_THE_WAY
    before = np.inf
    fresh = False
    for rounds in range(_ROUNDS):
        residual = _residual(block, unknowns)
        if residual is None:
            return None
        size = float(np.abs(residual - goal).max())
        # With new derivatives a residual above rounding falls to less than 0.3 of the one before.
        is_rounding = fresh and size <= RESIDUAL_ROUNDING and size > 0.3 * before
        if size <= enough or is_rounding:
            return unknowns, rounds
        # A residual that more than doubles diverges; chosen.
        if size > _MAX_CORRECTION or size > 2.0 * before:
            return None
        # Never in the first round, in which `before` is infinite.
        fresh = size > _FAST * before
        if fresh and _residual(block, unknowns, slopes) is None:
            return None
        move = _solved(slopes, residual - goal)
        if move is None:
            return None
        unknowns = unknowns - move
        before = size
    return None


def _solved(matrix: Floats, right: Floats) -> Floats | None:
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return None
