"""Dot pictures in text: Braille characters of two by four dots, or full stops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ACROSS, UP = 2, 4
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_BLANK_BRAILLE = 0x2800


class Dots:
    """A plane of dots.

    Parameters
    ----------
    columns, rows : int
        Size in characters.
    x, y : tuple of float
        Limits of the plane.
    """

    def __init__(
        self, columns: int, rows: int, x: tuple[float, float], y: tuple[float, float], *, braille: bool = True
    ) -> None:
        self._size = np.array([columns * ACROSS, rows * UP])
        self._low = np.array([x[0], y[0]])
        self._scale = (self._size - 1) / np.maximum([x[1] - x[0], y[1] - y[0]], np.finfo(float).tiny)
        self._dots = np.zeros((rows * UP, columns * ACROSS), dtype=bool)
        self._letters: dict[tuple[int, int], str] = {}
        self._braille = braille

    def outline(self, points: Floats, *, closed: bool = True) -> None:
        """Draw lines through points of shape (n, 2)."""
        places = self._places(points)
        ends = np.roll(places, -1, axis=0) if closed else places[1:]
        for begin, end in zip(places, ends, strict=False):
            steps = int(np.clip(np.abs(end - begin).max(), 1.0, 4.0 * self._size.max()))
            line = np.rint(begin + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - begin)).astype(np.int64)
            across, up = line[((line >= 0) & (line < self._size)).all(axis=1)].T
            self._dots[self._size[1] - 1 - up, across] = True

    def letter(self, point: tuple[float, float], letter: str) -> None:
        """Put a letter at a point, on top of the dots."""
        across, up = np.clip(np.rint(self._places(np.array([point]))[0]), 0, self._size - 1).astype(int).tolist()
        self._letters[(int(self._size[1] - 1 - up) // UP, across // ACROSS)] = letter

    def lines(self) -> list[str]:
        """Return the rows of text."""
        rows, columns = self._dots.shape[0] // UP, self._dots.shape[1] // ACROSS
        cells = self._dots.reshape(rows, UP, columns, ACROSS).transpose(0, 2, 1, 3)
        codes = (cells * _BITS).sum(axis=(2, 3))
        if self._braille:
            text = [[chr(_BLANK_BRAILLE + code) if code else " " for code in row] for row in codes.tolist()]
        else:
            text = [["." if code else " " for code in row] for row in codes.tolist()]
        for (row, column), letter in self._letters.items():
            text[row][column] = letter
        return ["".join(row) for row in text]

    def _places(self, points: Floats) -> Floats:
        return np.asarray(np.clip((points - self._low) * self._scale, -1e9, 1e9))
