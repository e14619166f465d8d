"""Capture time as a function of two parameters; points are computed from their neighbours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from rendezvous._arrays import Floats, Places
from rendezvous.pursuit_evasion._pair import Node
from rendezvous.pursuit_evasion.game import Game, Units, scaled_game
from rendezvous.pursuit_evasion.solution import Verdict
from rendezvous.pursuit_evasion.solver import solve

CHECKED_EVERY = 50
"""Distance between points of a row that are solved from scratch; shifted from row to row."""

_GOLDEN, _SURPRISE = 0.618, 0.05
_PRECISE, _CLOSE = 1e-10, 1e-6
_EXTRAPOLATIONS = {1: np.array([1.0]), 2: np.array([2.0, -1.0]), 3: np.array([3.0, -3.0, 1.0])}
_SAME = 1e-6


class PointStatus(Enum):
    """Status of a point of a map."""

    FOLLOWED = "followed"
    """Solved from scratch: no earlier capture on its branch."""
    NEIGHBOUR = "neighbour"
    """A local saddle found from a neighbour; earlier captures are not excluded."""
    NOT_CERTIFIED = "not-certified"
    ESCAPES = "escapes"
    PROPELLANT_EXHAUSTED = "propellant-exhausted"
    NO_GAME = "no-game"
    """The parameters define no game, for example equal positions."""


STATUSES = tuple(PointStatus)


@dataclass(frozen=True)
class CaptureMap:
    """Capture times over a grid of `columns`, shape (nx,), and `rows`, shape (ny,), in the units of the two parameters.

    `capture_s` and `closing_speed_m_s`, shape (ny, nx), are masked where there is no capture, or none that is
    certified. `status`, shape (ny, nx), contains indices in `STATUSES`. `solved_from_nothing` is the number of points
    solved from scratch.
    """

    columns: Floats
    rows: Floats
    capture_s: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]
    status: Places
    closing_speed_m_s: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]
    solved_from_nothing: int

    def count(self, status: PointStatus) -> int:
        """Return the number of points with a `status`."""
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
    """Solve a game at each point of a grid of `columns`, shape (nx,), and `rows`, shape (ny,).

    `game_at` returns the game of a column's and a row's value, and raises ValueError if there is no game. `follow_all`
    solves all points from scratch, with a change of branch at folds: 20 ms to seconds per point. `progress` is called
    with the fraction done.

    In a row a point is computed from the three previous points, in 1 to 2 ms. One point in 50 is solved from scratch,
    and also the last point before a new start of the row, and points whose time differs from the extrapolation of the
    previous rows. If a result differs from the previous one, the neighbours are also solved from scratch, and their
    neighbours, until the results agree.
    """
    grid = _Grid(game_at, np.asarray(columns, dtype=np.float64), np.asarray(rows, dtype=np.float64))
    for j in range(len(rows)):
        games = [grid.game(j, i) for i in range(len(columns))]
        points, wrong = _row(games, follow_all, int(_GOLDEN * CHECKED_EVERY * j))
        for i, point in enumerate(points):
            grid.put(j, i, point)
        about_wrong = [point for i in wrong for point in grid.about(j, i)]
        grid.settle([*about_wrong, *((k, i) for i in grid.surprises(j) for k in (j, j - 1))])
        if progress is not None:
            progress((j + 1) / len(rows))
    return grid.map()


class _Grid:
    """The points solved so far."""

    def __init__(self, game_at: Callable[[float, float], Game], columns: Floats, rows: Floats) -> None:
        self._game_at, self._columns, self._rows = game_at, columns, rows
        shape = (len(rows), len(columns))
        self._status = np.full(shape, STATUSES.index(PointStatus.NO_GAME))
        self._time, self._closing = np.zeros(shape), np.zeros(shape)
        self._hidden = np.ones(shape, dtype=bool)
        self._afresh = 0

    def game(self, j: int, i: int) -> Game | None:
        try:
            return self._game_at(float(self._columns[i]), float(self._rows[j]))
        except ValueError:
            return None

    def put(self, j: int, i: int, point: _Point) -> None:
        self._afresh += point.status is not PointStatus.NEIGHBOUR
        self._status[j, i] = STATUSES.index(point.status)
        self._hidden[j, i] = point.node is None or point.units is None
        if point.node is not None and point.units is not None:
            self._time[j, i] = point.node.duration * point.units.time_s
            self._closing[j, i] = point.node.closing * point.units.speed_m_s

    def surprises(self, j: int) -> list[int]:
        """Return the columns at which a row differs from the extrapolation of the one or two rows before."""
        if j == 0:
            return []
        now, expected = self._time[j], self._time[j - 1].copy()
        known = ~self._hidden[j - 1]
        if j > 1:
            two = known & ~self._hidden[j - 2]
            expected[two] += self._time[j - 1][two] - self._time[j - 2][two]
        unlike = np.where(self._hidden[j], known, ~known | (np.abs(now - expected) > _SURPRISE * now))
        return [int(i) for i in np.flatnonzero(unlike)]

    def about(self, j: int, i: int) -> list[tuple[int, int]]:
        """Return the four neighbours of a point."""
        neighbours = ((j - 1, i), (j + 1, i), (j, i - 1), (j, i + 1))
        return [(k, h) for k, h in neighbours if 0 <= k < len(self._rows) and 0 <= h < len(self._columns)]

    def settle(self, doubted: list[tuple[int, int]]) -> None:
        """Solve points that were computed from neighbours from scratch; if a result changes, also their neighbours."""
        while doubted:
            j, i = doubted.pop()
            if STATUSES[self._status[j, i]] is not PointStatus.NEIGHBOUR:
                continue
            before_s = self._time[j, i]
            self.put(j, i, _from_nothing(self.game(j, i), change_branch=False))
            if self._hidden[j, i] or abs(self._time[j, i] - before_s) > _SAME * before_s:
                doubted += self.about(j, i)

    def map(self) -> CaptureMap:
        return CaptureMap(
            self._columns,
            self._rows,
            np.ma.MaskedArray(self._time, self._hidden),
            self._status,
            np.ma.MaskedArray(self._closing, self._hidden),
            self._afresh,
        )


def _row(games: list[Game | None], follow_all: bool, offset: int) -> tuple[list[_Point], list[int]]:
    """Solve a row, and return the indices of points where a neighbour's answer was not the first capture."""
    points: list[_Point] = []
    wrong: list[int] = []
    every = min(CHECKED_EVERY, len(games))

    def check() -> None:
        if points and points[-1].status is PointStatus.NEIGHBOUR:
            seeded, points[-1] = points[-1].node, _from_nothing(games[len(points) - 1], follow_all)
            node = points[-1].node
            if node is None or seeded is None or not abs(node.duration - seeded.duration) < _SAME * node.duration:
                wrong.append(len(points) - 1)

    for i, game in enumerate(games):
        seeded = None if follow_all or game is None else _seeded(game, points)
        if seeded is None:
            # The sequence of seeded points ends here: check its last point.
            check()
        points.append(_from_nothing(game, follow_all) if seeded is None else seeded)
        if (i + offset) % every == 0 or i == len(games) - 1:
            check()
    return points, wrong


def _from_nothing(game: Game | None, change_branch: bool) -> _Point:
    if game is None:
        return _Point(PointStatus.NO_GAME)
    solution = solve(game, change_branch=change_branch)
    if solution.capture is not None and solution.verdict is Verdict.CAPTURED:
        return _Point(PointStatus.FOLLOWED, solution.units, solution.capture.extremal)
    is_over = solution.verdict in (Verdict.ESCAPES, Verdict.PROPELLANT_EXHAUSTED)
    return _Point(PointStatus(solution.verdict.value) if is_over else PointStatus.NOT_CERTIFIED)


def _seeded(game: Game, points: list[_Point]) -> _Point | None:
    """Solve a game from the one, two or three before it."""
    if not points or points[-1].node is None:
        return None
    known: list[Floats] = []
    for point in reversed(points[-3:]):
        if point.node is None:
            break
        known.append(np.append(point.node.vector, point.node.duration))
    guess = np.tensordot(_EXTRAPOLATIONS[len(known)], known, axes=1)
    scaled = scaled_game(game)
    node = scaled.pair.solve(
        guess[:15],
        float(guess[15]),
        scaled.radius,
        time_free=True,
        tolerance=_PRECISE,
        close=_CLOSE,
        latest=scaled.latest,
    )
    if node is None or not node.is_saddle or node.closing <= 0.0:
        return None
    return _Point(PointStatus.NEIGHBOUR, scaled.units, node)
