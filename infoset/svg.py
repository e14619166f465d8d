"""Small SVG pictures for the representation of objects in notebooks."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np

from infoset.arrays import Floats

Limits = tuple[float, float]

WIDTH, HEIGHT = 420, 270
INK, QUIET, GRID, NEAR, FAR, ACCENT = "#1a1a1a", "#545b66", "#dfe3e8", "#08306b", "#3f86bf", "#b3200f"

_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 12, 26, 40


class Plane:
    """A plane with axes, to which lines are added.

    Parameters
    ----------
    x_title, y_title, title : str
        Names of the axes, with units, and the text above the plane.
    levels : sequence of (float, str), or None
        Ticks of the y axis and their labels; None chooses round values.
    """

    def __init__(
        self,
        x: Limits,
        y: Limits,
        x_title: str,
        y_title: str,
        title: str,
        height: int = HEIGHT,
        levels: Sequence[tuple[float, str]] | None = None,
    ) -> None:
        self._x, self._y, self._height = x, y, height
        self._title = title
        self._parts: list[str] = []
        for value in ticks(*x):
            at = self._across(value)
            self._add(f'<path d="M{at:.1f} {_TOP}V{height - _BOTTOM}" stroke="{GRID}"/>')
            self._text(_tick(value), at, height - _BOTTOM + 14, "middle", QUIET)
        round_levels = [(value, _tick(value)) for value in ticks(*y)] if y_title else []
        for value, name in round_levels if levels is None else levels:
            at = self._up(value)
            self._add(f'<path d="M{_LEFT} {at:.1f}H{WIDTH - _RIGHT}" stroke="{GRID}"/>')
            self._text(name, _LEFT - 5, at + 4, "end", QUIET)
        middle = (_TOP + height - _BOTTOM) / 2
        self._text(x_title, (_LEFT + WIDTH - _RIGHT) / 2, height - 8, "middle", INK)
        self._text(y_title, 12, middle, "middle", INK, f' transform="rotate(-90 12 {middle:.1f})"')
        self._text(title, _LEFT, 16, "start", INK, ' font-weight="bold"')

    def line(self, points: Floats, colour: str, *, closed: bool = False, width: float = 1.4) -> None:
        """Draw a line through points, shape (n, 2); fill a closed one lightly, and draw a single point as a dot."""
        pixels = [(self._across(x), self._up(y)) for x, y in points.tolist()]
        if len(pixels) == 1:
            self._add(f'<circle cx="{pixels[0][0]:.1f}" cy="{pixels[0][1]:.1f}" r="3" fill="{colour}"/>')
            return
        path = "L".join(f"{x:.1f} {y:.1f}" for x, y in pixels)
        end, fill = ("Z", f'fill="{colour}" fill-opacity=".08"') if closed else ("", 'fill="none"')
        self._add(f'<path d="M{path}{end}" {fill} stroke="{colour}" stroke-width="{width}" stroke-linejoin="round"/>')

    def svg(self) -> str:
        """Return the picture."""
        inside = "".join(self._parts)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{self._height}" '
            f'viewBox="0 0 {WIDTH} {self._height}" role="img" font-family="sans-serif" font-size="11">'
            f"<title>{html.escape(self._title)}</title>"
            f'<rect width="{WIDTH}" height="{self._height}" fill="#ffffff"/>{inside}</svg>'
        )

    def _across(self, value: float) -> float:
        return _LEFT + (value - self._x[0]) / (self._x[1] - self._x[0]) * (WIDTH - _LEFT - _RIGHT)

    def _up(self, value: float) -> float:
        room = self._height - _TOP - _BOTTOM
        return self._height - _BOTTOM - (value - self._y[0]) / (self._y[1] - self._y[0]) * room

    def _add(self, part: str) -> None:
        self._parts.append(part)

    def _text(self, text: str, x: float, y: float, anchor: str, colour: str, more: str = "") -> None:
        if text:
            escaped = html.escape(text)
            self._add(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}"{more}>{escaped}</text>')


def side_by_side(pictures: Sequence[str]) -> str:
    """Return pictures of the same size as one picture."""
    if len(pictures) == 1:
        return pictures[0]
    placed = [picture.replace("<svg ", f'<svg x="{i * WIDTH}" ', 1) for i, picture in enumerate(pictures)]
    size = f'width="{WIDTH * len(pictures)}" height="{HEIGHT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">{"".join(placed)}</svg>'


def note(text: str) -> str:
    """Return a picture that contains only a text."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="34" role="img" font-family="sans-serif" '
        f'font-size="12"><rect width="{WIDTH}" height="34" fill="#ffffff"/>'
        f'<text x="8" y="21" fill="{INK}">{html.escape(text)}</text></svg>'
    )


def limits(values: Floats, margin: float = 0.06) -> Limits:
    """Return limits of nonzero width, slightly wider than the values: by `margin` of their width on each side."""
    low, high = float(values.min()), float(values.max())
    room = margin * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


def shade(index: int, count: int) -> str:
    """Return the colour of item `index` in a sequence of `count` items, from dark to light."""
    share = index / max(count - 1, 1)
    pairs = ((int(NEAR[at : at + 2], 16), int(FAR[at : at + 2], 16)) for at in (1, 3, 5))
    return "#" + "".join(f"{round((1.0 - share) * near + share * far):02x}" for near, far in pairs)


def ticks(low: float, high: float, about: int = 5) -> list[float]:
    """Return approximately `about` round values between two limits."""
    rough = (high - low) / about
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 0.999 * rough)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [multiple * step for multiple in range(first, last + 1)]


def _tick(value: float) -> str:
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")


def evenly(count: int, most: int) -> Sequence[int]:
    """Return at most `most` evenly spaced indices of a sequence, both ends included."""
    return range(count) if count <= most else sorted({round(index) for index in np.linspace(0, count - 1, most)})
