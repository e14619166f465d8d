"""HTML of results and of single engagements for notebooks: a small table, and pictures without scripts."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from infoset.arrays import Floats
from infoset.svg import ACCENT, NEAR, Plane, limits

LEVELS = (0.1, 0.5, 0.9)
_DECADES = 10.0


def results_html(
    samples: Mapping[str, Floats], outcomes: Sequence[str], truths_kept: int, hits: int | None = None
) -> str:
    """Return a table of the results of a batch as HTML.

    `samples` are known values by title, unit included; each is a row with its quantiles. `truths_kept` is the number of
    engagements whose true state was inside its section at every step, `hits` that of hits, None if the body has no
    size.
    """
    counts = ", ".join(f"{count} {outcome}" for outcome, count in Counter(outcomes).items())
    kept = f"true state inside the set at every step: {truths_kept} of {len(outcomes)}"
    hit = "" if hits is None else f"; {hits} hit"
    caption = f"{len(outcomes)} engagements: {counts}{hit}; {kept}"
    rows = [(title, _quantiles(values)) for title, values in samples.items()]
    return _table(caption, ("", *(f"{level:.0%}" for level in LEVELS), "greatest"), rows)


def course_html(
    caption: str,
    facts: Mapping[str, str],
    time_s: Floats,
    impulses_m_s: Mapping[str, Floats],
    greatest_impulse_m_s: float,
    miss_time_s: Floats,
    misses_m: Mapping[str, Floats],
) -> str:
    """Return the course of one engagement as HTML: facts, predicted miss and impulses over time.

    `impulses_m_s`, shape (steps,), and the least and greatest predicted misses `misses_m`, shape (n, 2), are by
    direction: an empty text in a plane, ``" along y"`` and ``" along z"`` in space. `miss_time_s`, shape (n,), are the
    times at which a predicted miss exists.
    """
    table = _table(caption, (), [(name, [text]) for name, text in facts.items()])
    misses = [_miss_svg(miss_time_s, miss_m, along) for along, miss_m in misses_m.items() if len(miss_time_s)]
    impulses = [_impulse_svg(time_s, each, greatest_impulse_m_s, along) for along, each in impulses_m_s.items()]
    return "".join([table, *misses, *impulses])


def _miss_svg(time_s: Floats, miss_m: Floats, along: str) -> str:
    """Draw the predicted-miss interval over time: linear up to 10 m, one unit per decade beyond."""
    scaled = miss_m / _DECADES
    size = np.abs(scaled)
    bent = np.sign(scaled) * np.where(size > 1.0, 1.0 + np.log10(np.maximum(size, 1.0)), size)
    powers = range(1, 1 + int(np.abs(bent).max()))
    marks = [(float(sign * power), f"{sign * 10**power:g}") for power in powers for sign in (-1, 1)] + [(0.0, "0")]
    plane = Plane(
        limits(time_s, 0.02),
        limits(bent),
        "time t, s",
        "m",
        f"predicted miss{along} without further impulses",
        levels=marks,
    )
    low, high = bent.T
    around = np.concatenate([np.stack([time_s, low], axis=1), np.stack([time_s, high], axis=1)[::-1]])
    plane.line(around, NEAR, closed=True)
    return plane.svg()


def _impulse_svg(time_s: Floats, impulse_m_s: Floats, greatest_m_s: float, along: str) -> str:
    span = (-1.1 * greatest_m_s, 1.1 * greatest_m_s)
    plane = Plane(limits(time_s, 0.02), span, "time t, s", "impulse k, m/s", f"impulses{along}", 170)
    for time, impulse in zip(time_s.tolist(), impulse_m_s.tolist(), strict=True):
        if impulse != 0.0:
            plane.line(np.array([[time, 0.0], [time, impulse]]), ACCENT)
    return plane.svg()


def _quantiles(values: np.ndarray) -> Sequence[str]:
    if not len(values):
        return ["-"] * (len(LEVELS) + 1)
    return [f"{value:.4g}" for value in (*np.quantile(values, LEVELS), values.max())]


def _table(caption: str, heads: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> str:
    top = "".join(f'<th scope="col">{html.escape(head)}</th>' for head in heads)
    body = "".join(
        f'<tr><th scope="row">{html.escape(name)}</th>'
        + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells)
        + "</tr>"
        for name, cells in rows
    )
    return f"<table><caption>{html.escape(caption)}</caption>{f'<tr>{top}</tr>' if top else ''}{body}</table>"
