"""The terminal replay of an engagement: its sets, its predicted miss and its numbers, step by step."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from rich.columns import Columns
from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from experiments.interception.course import kept_steps, outcome_title, record_titles
from infoset.arrays import Floats
from sim import Record, StepRecord

MOMENTS_IN_PRINT = 5
ROWS = 14

_SECTIONS = 5
_LEAST_COLUMNS, _MOST_COLUMNS = 24, 64
_DECADE_M = 10.0

ACROSS, UP = 2, 4
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_BLANK_BRAILLE = 0x2800


def play(records: Sequence[Record], console: Console, steps_per_s: float) -> None:
    """Play engagements in a terminal; print a few times of them if the output is no terminal."""
    longest = max(records, key=lambda record: len(record.steps))
    steps = kept_steps(longest)
    if not console.is_terminal:
        chosen = np.unique(np.linspace(0, len(steps) - 1, MOMENTS_IN_PRINT).round().astype(int))
        for number in chosen.tolist():
            console.print(frame(records, steps[number], console))
        return
    with Live(frame(records, 0, console), console=console, auto_refresh=False) as live:
        began_s = time.monotonic()
        for number, step in enumerate(steps[1:], 1):
            # A slow terminal delays one frame only: times are counted from the start.
            time.sleep(max(0.0, began_s + number / steps_per_s - time.monotonic()))
            live.update(frame(records, step, console), refresh=True)


def frame(records: Sequence[Record], step: int, console: Console) -> Group:
    """Return one step of engagements, side by side if the terminal is wide enough; the last step if it has ended."""
    braille = "utf" in console.encoding.lower()
    least = _LEAST_COLUMNS * max(len(record.steps[0].axes) for record in records)
    beside = len(records) if console.width >= len(records) * (least + 6) else 1
    columns = int(np.clip(console.width // beside - 6, _LEAST_COLUMNS, _MOST_COLUMNS))
    shown = [
        Panel(
            Group(
                *(Text(line) for line in _planes(_step_of(record, step), columns, braille)),
                Text(),
                *(Text(line) for line in _bars(record, _step_of(record, step), columns)),
                _numbers(record, min(step, len(record.steps) - 1)),
            ),
            title=Text(title),
            width=columns + 4,
        )
        for record, title in zip(records, record_titles(records), strict=True)
    ]
    return Group(Columns(shown))


def _step_of(record: Record, step: int) -> StepRecord:
    return record.steps[min(step, len(record.steps) - 1)]


def _planes(step: StepRecord, columns: int, braille: bool) -> list[str]:
    """Return the (omega, alpha) plane of z, or those of y and z side by side, with the limits of each below."""
    if len(step.axes) == 1:
        dots, limits = _plane(step, "z", columns, braille)
        return [*dots, *(text[:columns] for text in limits)]
    width = columns // 2 - 1
    (left, of_y), (right, of_z) = (_plane(step, name, width, braille) for name in step.axes)
    heads = [f"{'y':^{width}}  {'z':^{width}}"]
    limits = [f"{name} {text}"[:columns] for name, texts in (("y", of_y), ("z", of_z)) for text in texts]
    return [*heads, *(f"{y:<{width}}  {z}" for y, z in zip(left, right, strict=True)), *limits]


def _plane(step: StepRecord, name: str, columns: int, braille: bool) -> tuple[list[str], list[str]]:
    """Sections in the (omega, alpha) plane of an axis, with X for the true state, and the limits of the plane."""
    axis = step.axes[name]
    last = len(step.sections) - 1
    places = {round(each) for each in np.linspace(0, last, _SECTIONS).tolist()} if step.sections else set()
    shown = [step.sections[place] for place in sorted(places)]
    polygons = [section.omega_alpha_y if name == "y" else section.omega_alpha for section in shown]
    outlines = [polygon.polygon() for polygon in polygons if polygon is not None]
    truth = (axis.true_rate_rad_s, axis.true_angle_rad)
    points = np.concatenate([np.array([truth]), *outlines])
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.maximum(0.05 * (high - low), 1e-12 + 1e-6 * np.abs(high))
    low, high = low - room, high + room
    dots = Dots(columns, ROWS, (low[0], high[0]), (low[1], high[1]), braille=braille)
    for outline in outlines:
        dots.outline(outline, closed=len(outline) > 2)
    dots.letter(truth, "X")
    rate = f"rate {low[0] * 1e6:.4g} .. {high[0] * 1e6:.4g} µrad/s"
    angle = f"angle {low[1] * 1e3:.4g} .. {high[1] * 1e3:.4g} mrad"
    return dots.lines(), [rate, angle]


def _bars(record: Record, step: StepRecord, columns: int) -> list[str]:
    if step.predicted_miss_m is None:
        return ["the set is empty".center(columns)]
    known = [axis.predicted_miss_m for each in record.steps for axis in each.axes.values()]
    greatest = max((abs(end) for miss in known if miss is not None for end in miss), default=_DECADE_M)
    if len(step.axes) == 1:
        return [_bar(step.predicted_miss_m, greatest, columns)]
    return [
        f"{name} {_bar(axis.predicted_miss_m, greatest, columns - 2)}"
        for name, axis in step.axes.items()
        if axis.predicted_miss_m is not None
    ]


def _bar(miss_m: tuple[float, float], greatest_m: float, columns: int) -> str:
    """The predicted-miss interval on a line with zero in the middle, logarithmic beyond ten metres."""

    def place(metres: float) -> int:
        share = _bent(metres) / max(_bent(greatest_m), 1.0)
        return round((0.5 + 0.5 * share) * (columns - 1))

    lower, upper = map(place, miss_m)
    line = [" "] * columns
    line[lower : upper + 1] = "=" * (upper - lower + 1)
    line[place(0.0)] = "|" if line[place(0.0)] == " " else "+"
    return "".join(line)


def _bent(metres: float) -> float:
    size = abs(metres) / _DECADE_M
    return float(np.sign(metres) * (size if size <= 1.0 else 1.0 + np.log10(size)))


def _numbers(record: Record, index: int) -> Table:
    step = record.steps[index]
    spent = sum(abs(each.impulse_m_s) for each in record.steps[: index + 1])
    spatial = len(step.axes) > 1
    misses = {f"predicted miss {name}" if spatial else "predicted miss": axis for name, axis in step.axes.items()}
    table = Table(box=None, show_header=False, pad_edge=False)
    rows = (
        ("time", f"{step.time_s:g} s"),
        ("true range", f"{step.true_range_m / 1e3:.6g} km"),
        *(
            (title, "none" if (miss := axis.predicted_miss_m) is None else f"{miss[0]:.5g} .. {miss[1]:.5g} m")
            for title, axis in misses.items()
        ),
        ("impulse", f"{step.impulse_m_s:.4g} m/s"),
        *((f"  along {name}", f"{axis.impulse_m_s:.4g} m/s") for name, axis in step.axes.items() if spatial),
        ("budget left", f"{max(record.scenario.thruster.budget_m_s - spent, 0.0):.5g} m/s"),
        ("sections", str(len(step.sections))),
        ("at the end", outcome_title(record)),
    )
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table


class Dots:
    """A plane of dots; its size is in characters."""

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
