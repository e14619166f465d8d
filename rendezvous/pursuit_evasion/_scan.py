"""Scan of all directions at one duration for one that keeps the evader farther away.

All values are nondimensional. h(nu) is the distance that a side reaches along nu. The evader keeps
the maximum of h_E - h_P over all nu: a branch of extremals that is not the maximum is not optimal
for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._coupling import across
from infoset.rendezvous.pursuit_evasion._extremal import Response
from infoset.rendezvous.pursuit_evasion._pair import COARSE, ROUGH, Node, Pair, Side

_DIRECTIONS = 120
"""Number of directions of a scan: neighbours are some 20 degrees apart. Chosen: eight random
games have the same captures from 60 to 240; with 30 one with a fold has none (measured)."""
_SEEDS = 2
"""Number of solved directions from which another is turned to. Chosen: of 120 directions of
`geo-pursuit` 72 are solved with one, 73 with two and with four (measured)."""
_MAX_PARTS = 4
"""Largest number of parts of a turn between two directions. Chosen: of 120 directions of
`geo-pursuit` 62 are solved with 1, 73 with 4 and 81 with 16, which takes twice the time (measured).
"""
_SHORT = 1e-7
"""Distance by which the end of another direction may be farther along a direction that is kept:
above the errors of ends, the square of `_CONVERGED` and `COARSE`. From 2.5e-8 to 4e-7 the same
directions of `geo-pursuit` are kept (measured)."""
_GAIN = 1e-6
"""Minimum gain of distance for which another branch replaces a branch: ten times `_SHORT`."""
_LONGEST = 40.0
"""Longest duration, in radians, that is scanned for another branch: some six revolutions; chosen: a
scan takes at least 0.5 s a revolution, and longer ones minutes."""
_MAX_ITERATIONS = 8
"""Twice the iterations of Newton's method between neighbours: with half of them 71 of 73 directions
of `geo-pursuit` are solved, and with twice as many no other (measured)."""
_CONVERGED = 1e-5
"""Largest last correction of Newton's method; the remaining error is about its square."""
_FARTHEST = 0.5
"""Largest correction of Newton's method: beyond it another extremal may be found. Chosen: the scan
of `geo-pursuit` is the same from 0.125 to 2 (measured)."""
_CLIMBS = 4
"""Number of directions from which the distance is climbed; a distance has few maxima. Chosen: that
of `geo-pursuit` has one, which is found with 1 to 8 (measured)."""
_MAX_CLIMBING = 40
"""Largest number of steps of a climb. Chosen: 10 are enough for `geo-pursuit` (measured)."""
_APART = 0.9
"""Cosine of the smallest angle between two starts of a climb, 26 degrees. Chosen: more than the
distance of neighbours; the maxima of `geo-pursuit` are the same from 14 to 53 degrees (measured).
"""
_MIN_STRIDE = 1e-4
"""Smallest step of a climb, rad: Newton's method converges from much farther away."""


@dataclass(frozen=True)
class Scan:
    """Distances h_E - h_P, shape (n,), along directions `nu`, shape (n, 3), at one duration.

    Of the directions `tried`, these are the ones for which both sides' extremals were found.
    `maxima` are local maxima among them, computed exactly, the maximum first.
    """

    nu: Floats
    distance: Floats
    tried: int
    maxima: tuple[Node, ...]


@dataclass(frozen=True)
class End:
    """End of an extremal of one side along `nu`.

    It has the directions across nu and the linear response.
    """

    state: Floats
    nu: Floats
    plane: Floats
    response: Response


def scan(pair: Pair, node: Node) -> Scan:
    """Compute extremals in all directions at the duration of a known extremal.

    120 directions per side, each from a solved neighbour: at least 0.5 s per revolution. A
    reachable set that is not convex has several extremals per direction. A direction counts as not
    found if the end of another one is farther along it: its extremal is then not the farthest.
    """
    grid = directions(_DIRECTIONS)
    grid = grid[np.argsort(-(grid @ node.nu))]
    pursuer = _fan(pair.pursuer, node.pursuer, node.nu, grid, node.duration)
    evader = _fan(pair.evader, node.evader, node.nu, grid, node.duration)

    both = [i for i in range(len(grid)) if i in pursuer and i in evader]
    nu = grid[both]
    distance = np.array([grid[i] @ (evader[i].state - pursuer[i].state)[:3] for i in both])

    peaks: list[Node] = []
    # Climbs that end at one peak differ by rounding, two peaks by more than 1e-3 (chosen).
    for index in _starts(nu, distance):
        peak = _climb(pair, pursuer[both[index]], evader[both[index]], node.duration)
        if peak is not None and all(np.abs(peak.nu - other.nu).max() > 1e-3 for other in peaks):
            peaks.append(peak)
    return Scan(nu, distance, len(grid), tuple(sorted(peaks, key=lambda peak: -peak.distance)))


def greater(pair: Pair, node: Node) -> Node | None:
    """Return an extremal of the same duration that keeps the evader farther away, or None.

    Durations of more than six revolutions are not scanned, because that would take minutes.
    """
    if node.duration > _LONGEST:
        return None
    maxima = scan(pair, node).maxima
    if not maxima or not maxima[0].distance > node.distance + _GAIN:
        return None
    return maxima[0]


def directions(count: int) -> Floats:
    """Return unit vectors spread over the sphere (a Fibonacci lattice), shape (count, 3)."""
    i = np.arange(count)
    z = 1.0 - (2.0 * i + 1.0) / count
    angle = i * np.pi * (3.0 - np.sqrt(5.0))
    across_axis = np.sqrt(1.0 - z * z)
    return np.stack([across_axis * np.cos(angle), across_axis * np.sin(angle), z], axis=1)


def _fan(side: Side, state: Floats, nu: Floats, grid: Floats, duration: float) -> dict[int, End]:
    """Find the end states of one side for directions of a grid, by their rows.

    `state` is the end state along nu. The grid is sorted from nu outward, so that a direction has
    solved neighbours when its turn comes.
    """
    first = end_along(side, state, nu, duration)
    solved: dict[int, End] = {}
    if first is None:
        return solved
    for i, toward in enumerate(grid):
        seeds = [first, *solved.values()]
        for j in np.argsort([-(seed.nu @ toward) for seed in seeds])[:_SEEDS]:
            end = _turn(side, seeds[j], toward, duration)
            if end is not None:
                solved[i] = end
                break

    # Keep a direction only if no other end is farther along it.
    ends = np.array([first.state[:3], *(end.state[:3] for end in solved.values())])
    reach = grid @ ends.T
    return {
        i: end for i, end in solved.items() if end.nu @ end.state[:3] >= reach[i].max() - _SHORT
    }


def _turn(side: Side, seed: End, toward: Floats, duration: float) -> End | None:
    """Turn an extremal into a direction in one step or, if that fails, in four.

    The four parts of the chord from `seed.nu` to `toward` are equal, not those of the angle.
    """
    parts = 1
    while parts <= _MAX_PARTS:
        here = seed
        for part in range(1, parts + 1):
            nu = seed.nu + (toward - seed.nu) * (part / parts)
            nu = nu / np.linalg.norm(nu)
            guess = here.state + here.response.by_nu @ (here.plane @ (nu - here.nu))
            end = end_along(side, guess, nu, duration)
            if end is None:
                break
            here = end
        else:
            return here
        parts *= 4
    return None


def end_along(side: Side, state: Floats, nu: Floats, duration: float) -> End | None:
    """Return the end of the extremal of one side along nu, near a guess.

    It is None if Newton's method does not converge, or the extremal has a conjugate point.
    """
    plane = across(nu)
    before = np.inf
    for _ in range(_MAX_ITERATIONS):
        response = side.respond(state, nu, plane, duration, COARSE)
        if response is None:
            return None
        # A correction that more than doubles diverges; chosen.
        correction = float(np.abs(response.rho).max())
        if not correction < min(_FARTHEST, 2.0 * before):
            return None
        state = state + response.rho
        before = correction
        if correction < _CONVERGED:
            return End(state, nu, plane, response) if response.regular else None
    return None


def _starts(nu: Floats, values: Floats) -> list[int]:
    """Return some directions of great value, none near another."""
    chosen: list[int] = []
    for i in np.argsort(-values):
        if len(chosen) == _CLIMBS:
            break
        if all(nu[i] @ nu[j] < _APART for j in chosen):
            chosen.append(int(i))
    return chosen


def _climb(pair: Pair, pursuer: End, evader: End, duration: float) -> Node | None:
    """Climb h_E - h_P, whose gradient is r_E - r_P, and finish with Newton's method.

    A stride is an angle, rad, along the normalised gradient; a gradient below 1e-3 gives shorter
    ones. The first stride and its factors after a rise and after a fall are chosen. The result is
    None if no stride rises, or there are too many.
    """
    stride = 0.2
    for _ in range(_MAX_CLIMBING):
        rise = (evader.state - pursuer.state)[:3]
        value = float(evader.nu @ rise)
        # The error that remains is about the square of the last correction: far below `_GAIN`.
        peak = pair.solve(
            np.concatenate([pursuer.state, evader.state, evader.nu]),
            duration,
            value,
            time_free=False,
            tolerance=COARSE,
            close=ROUGH * 1e-2,
        )
        if peak is not None and peak.is_saddle and peak.distance >= value:
            return peak

        slope = rise - value * evader.nu
        while stride > _MIN_STRIDE:
            nu = evader.nu + stride * slope / max(float(np.linalg.norm(slope)), 1e-3)
            nu = nu / np.linalg.norm(nu)
            p = _turn(pair.pursuer, pursuer, nu, duration)
            e = _turn(pair.evader, evader, nu, duration)
            if p is not None and e is not None and nu @ (e.state - p.state)[:3] > value:
                pursuer = p
                evader = e
                stride *= 1.5
                break
            stride *= 0.3
        else:
            return None
    return None
