"""What a notebook shows of results and of single engagements: a small table, and pictures without scripts."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from infoset.svg import ACCENT, NEAR, Plane, limits

if TYPE_CHECKING:
    from sim.record import Record
    from sim.results import Results

LEVELS = (0.1, 0.5, 0.9)
_DECADES = 10.0


def results_html(results: Results) -> str:
    """Return a table of the results of a batch.

    Parameters
    ----------
    results : Results

    Returns
    -------
    str
        HTML.
    """
    known = results.guaranteed_miss_m.compressed()
    name = "guaranteed miss, m" if results.guarantees else "published Φ, no guarantee, m"
    rows = [
        ("miss, m", _quantiles(results.miss_m)),
        ("impulse, m/s", _quantiles(results.impulse_m_s)),
        (name, _quantiles(known)),
    ]
    outcomes = Counter(outcome.value for outcome in results.outcomes)
    said = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items())
    caption = f"{len(results)} engagements: {said}; truth kept {int(results.truth_kept.sum())}/{len(results)}"
    return _table(caption, ("", *(f"{level:.0%}" for level in LEVELS), "greatest"), rows)


def record_html(record: Record) -> str:
    """Return the course of an engagement: what came of it, its predicted miss and its impulses over time.

    Parameters
    ----------
    record : Record

    Returns
    -------
    str
        HTML.
    """
    result, scenario = record.result, record.scenario
    rows = [
        ("scenario", [scenario.name]),
        ("noise, strategy", [f"{record.noise_name}, {record.strategy}"]),
        ("miss", [f"{result.miss_m[0]:.4g} m"]),
        ("impulse", [f"{result.impulse_m_s[0]:.4g} m/s of {scenario.thruster.budget_m_s:g}"]),
        ("truth kept", ["yes" if result.truth_kept[0] else "no"]),
    ]
    caption = f"{result.outcomes[0].value}: {len(record.steps)} steps, seed {record.seed}, run {record.run}"
    return _table(caption, (), rows) + _miss_svg(record) + _impulse_svg(record)


def _miss_svg(record: Record) -> str:
    """The predicted-miss interval over time: linear to ten metres, a step a decade beyond."""
    known = [(step.time_s, *step.predicted_miss_m) for step in record.steps if step.predicted_miss_m is not None]
    if not known:
        return ""
    times, lower, upper = np.array(known).T
    size = np.abs(np.concatenate([lower, upper])) / _DECADES
    bent = np.sign(np.concatenate([lower, upper])) * np.where(size > 1.0, 1.0 + np.log10(np.maximum(size, 1.0)), size)
    low, high = np.split(bent, 2)
    span, powers = limits(bent), range(1, 1 + int(np.abs(bent).max()))
    marks = [(float(sign * power), f"{sign * 10**power:g}") for power in powers for sign in (-1, 1)] + [(0.0, "0")]
    plane = Plane(limits(times, 0.02), span, "time t, s", "m", "predicted miss, with no more impulses", levels=marks)
    around = np.concatenate([np.stack([times, low], axis=1), np.stack([times, high], axis=1)[::-1]])
    plane.line(around, NEAR, closed=True)
    return plane.svg()


def _impulse_svg(record: Record) -> str:
    greatest = record.scenario.thruster.greatest_impulse_m_s
    times = np.array([step.time_s for step in record.steps])
    plane = Plane(
        limits(times, 0.02), (-1.1 * greatest, 1.1 * greatest), "time t, s", "impulse k, m/s", "impulses", 170
    )
    for step in record.steps:
        if step.impulse_m_s != 0.0:
            plane.line(np.array([[step.time_s, 0.0], [step.time_s, step.impulse_m_s]]), ACCENT)
    return plane.svg()


def _quantiles(values: np.ndarray) -> Sequence[str]:
    if not len(values):
        return ["-"] * (len(LEVELS) + 1)
    return [f"{each:.4g}" for each in (*np.quantile(values, LEVELS), values.max())]


def _table(caption: str, heads: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> str:
    top = "".join(f'<th scope="col">{html.escape(each)}</th>' for each in heads)
    body = "".join(
        f'<tr><th scope="row">{html.escape(name)}</th>'
        + "".join(f"<td>{html.escape(each)}</td>" for each in cells)
        + "</tr>"
        for name, cells in rows
    )
    return f"<table><caption>{html.escape(caption)}</caption>{f'<tr>{top}</tr>' if top else ''}{body}</table>"
