"""Capture time over two parameters, each point a first guess for the next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from rendezvous.pursuit_evasion._capture import horizon_s
from rendezvous.pursuit_evasion._pair import Node
from rendezvous.pursuit_evasion.game import Game
from rendezvous.pursuit_evasion.solution import Verdict
from rendezvous.pursuit_evasion.solver import solve
from rendezvous.pursuit_evasion.units import Units, scaled_pair, units_of

Floats = NDArray[np.float64]

CHECKED_EVERY = 50
"""Points of a row from one that is solved from nothing to the next."""

_PRECISE, _CLOSE = 1e-10, 1e-6
_EXTRAPOLATIONS = {1: np.array([1.0]), 2: np.array([2.0, -1.0]), 3: np.array([3.0, -3.0, 1.0])}
_SAME = 1e-6


class PointStatus(Enum):
    """What is known of a point of a map."""

    FOLLOWED = "followed"
    """Solved from nothing: no earlier capture on its branch."""
    NEIGHBOUR = "neighbour"
    """A local saddle found from a neighbour, whose row agrees with points that are followed before and after it."""
    NOT_CERTIFIED = "not-certified"
    ESCAPES = "escapes"
    PROPELLANT_EXHAUSTED = "propellant-exhausted"
    NO_GAME = "no-game"
    """The parameters are no game: the same position, for one."""


STATUSES = tuple(PointStatus)


@dataclass(frozen=True)
class CaptureMap:
    """Capture times over a grid.

    Parameters
    ----------
    columns, rows : ndarray, shape (nx,) and (ny,)
        Values of the two parameters.
    capture_s : masked array, shape (ny, nx)
        Masked where there is no capture, or none that is certified.
    status : ndarray of int, shape (ny, nx)
        Places in `STATUSES`.
    closing_speed_m_s : masked array, shape (ny, nx)
    solved_from_nothing : int
        How many points were.
    """

    columns: Floats
    rows: Floats
    capture_s: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]
    status: NDArray[np.int64]
    closing_speed_m_s: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]
    solved_from_nothing: int

    def count(self, status: PointStatus) -> int:
        """Return how many points have a status.

        Parameters
        ----------
        status : PointStatus

        Returns
        -------
        int
        """
        return int((self.status == STATUSES.index(status)).sum())


@dataclass(frozen=True)
class _Point:
    status: PointStatus
    units: Units | None = None
    node: Node | None = None


def capture_map(
    game_at: Callable[[float, float], Game],
    columns: Floats,
    rows: Floats,
    *,
    follow_all: bool = False,
    progress: Callable[[float], None] | None = None,
) -> CaptureMap:
    """Solve a game at each point of a grid.

    Parameters
    ----------
    game_at : callable
        The game of a column's and a row's value; a ValueError says that there is none.
    columns : ndarray, shape (nx,)
    rows : ndarray, shape (ny,)
    follow_all : bool, optional
        Whether to solve each point from nothing, with a change of branch where one folds: 20 ms to seconds each.
    progress : callable, optional
        Told the fraction done.

    Returns
    -------
    CaptureMap

    Notes
    -----
    Along a row a point starts from the three before it: 1 to 2 ms. Every 50th point, and the last before the row has to
    start anew, are solved from nothing; where that is another answer, so are the points since the last such check.
    """
    shape = (len(rows), len(columns))
    status = np.zeros(shape, dtype=np.int64)
    time, closing = np.zeros(shape), np.zeros(shape)
    hidden = np.ones(shape, dtype=bool)
    afresh = 0
    for j, y in enumerate(rows):
        games = [_game(game_at, float(x), float(y)) for x in columns]
        points, count = _row(games, follow_all)
        afresh += count
        for i, point in enumerate(points):
            status[j, i] = STATUSES.index(point.status)
            if point.node is not None and point.units is not None:
                time[j, i] = point.node.duration * point.units.time_s
                closing[j, i] = point.node.closing * point.units.speed_m_s
                hidden[j, i] = False
        if progress is not None:
            progress((j + 1) / len(rows))
    return CaptureMap(
        np.asarray(columns, dtype=np.float64),
        np.asarray(rows, dtype=np.float64),
        np.ma.MaskedArray(time, hidden),
        status,
        np.ma.MaskedArray(closing, hidden),
        afresh,
    )


def _game(game_at: Callable[[float, float], Game], x: float, y: float) -> Game | None:
    try:
        return game_at(x, y)
    except ValueError:
        return None


def _row(games: list[Game | None], follow_all: bool) -> tuple[list[_Point], int]:
    """Solve a row, and return how many of its points were solved from nothing."""
    points: list[_Point] = []
    afresh, unchecked = 0, 0
    for i, game in enumerate(games):
        seeded = None if follow_all or game is None else _seeded(game, points)
        if seeded is None:
            # The stretch before ends here: its last point has to stand for it.
            afresh += _check(games, points, unchecked, follow_all)
            points.append(_from_nothing(game, follow_all))
            afresh += 1
            unchecked = i + 1
            continue
        points.append(seeded)
        if i % CHECKED_EVERY == 0 or i == len(games) - 1:
            afresh += _check(games, points, unchecked, follow_all)
            unchecked = i + 1
    return points, afresh


def _check(games: list[Game | None], points: list[_Point], first: int, follow_all: bool) -> int:
    """Solve the last point from nothing, and where that is another answer, all since `first`; return how many were."""
    last = len(points) - 1
    if last < first:
        return 0
    seeded, points[last] = points[last], _from_nothing(games[last], follow_all)
    if _agree(points[last], seeded):
        return 1
    for k in range(first, last):
        points[k] = _from_nothing(games[k], follow_all)
    return 1 + last - first


def _from_nothing(game: Game | None, change_branch: bool) -> _Point:
    if game is None:
        return _Point(PointStatus.NO_GAME)
    solution = solve(game, change_branch=change_branch)
    if solution.capture is not None and solution.verdict is Verdict.CAPTURED:
        return _Point(PointStatus.FOLLOWED, solution.units, solution.capture.extremal)
    return _Point(
        {
            Verdict.ESCAPES: PointStatus.ESCAPES,
            Verdict.PROPELLANT_EXHAUSTED: PointStatus.PROPELLANT_EXHAUSTED,
        }.get(solution.verdict, PointStatus.NOT_CERTIFIED)
    )


def _seeded(game: Game, points: list[_Point]) -> _Point | None:
    """Solve a game from the one, two or three before it."""
    if not points or points[-1].node is None:
        return None
    units = units_of(game)
    known: list[Floats] = []
    for point in reversed(points[-3:]):
        if point.node is None:
            break
        known.append(np.append(point.node.vector, point.node.duration))
    guess = np.tensordot(_EXTRAPOLATIONS[len(known)], known, axes=1)
    found = scaled_pair(game, units).solve(
        guess[:15],
        float(guess[15]),
        game.capture_radius_m / units.length_m,
        time_free=True,
        tolerance=_PRECISE,
        close=_CLOSE,
        latest=horizon_s(game) / units.time_s,
    )
    if found is None or not found.is_saddle or found.closing <= 0.0:
        return None
    return _Point(PointStatus.NEIGHBOUR, units, found)


def _agree(first: _Point, second: _Point) -> bool:
    if first.node is None or second.node is None:
        return False
    return abs(first.node.duration - second.node.duration) < _SAME * first.node.duration
