"""What a notebook shows of sets and of predicted misses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoset.svg import ACCENT, NEAR, Plane, evenly, limits, note, shade

if TYPE_CHECKING:
    from infoset.information_set_view import Section
    from infoset.predicted_miss import PredictedMiss

Floats = NDArray[np.float64]

MOST_OUTLINES = 9
MOST_INTERVALS = 24


def outlines_svg(outlines: Sequence[Floats], x_title: str, y_title: str, title: str) -> str:
    """Return a picture of convex polygons.

    Parameters
    ----------
    outlines : sequence of ndarray, shape (n, 2)
    x_title, y_title : str
        With their units.
    title : str

    Returns
    -------
    str
        SVG.
    """
    shown = [outlines[index] for index in evenly(len(outlines), MOST_OUTLINES)]
    shown = [each for each in shown if len(each)]
    if not shown:
        return note(f"{title}: nothing is left" if outlines else title)
    points = np.concatenate(shown)
    plane = Plane(limits(points[:, 0]), limits(points[:, 1]), x_title, y_title, title)
    for index, outline in enumerate(shown):
        plane.line(outline, shade(index, len(shown)), closed=len(outline) > 2)
    return plane.svg()


def sections_svg(sections: Sequence[Section], title: str) -> str:
    """Return a picture of sections in the (omega, alpha) plane, from the nearest (dark) to the farthest.

    Parameters
    ----------
    sections : sequence of Section
    title : str

    Returns
    -------
    str
        SVG.
    """
    chosen = [sections[index] for index in evenly(len(sections), MOST_OUTLINES)]
    outlines = [section.omega_alpha.polygon() * 1e6 for section in chosen]
    return outlines_svg(outlines, "rate ω, µrad/s", "angle α, µrad", title)


def predicted_miss_svg(miss: PredictedMiss) -> str:
    """Return a picture of predicted-miss intervals, one bar an engagement.

    Parameters
    ----------
    miss : PredictedMiss

    Returns
    -------
    str
        SVG.
    """
    known = np.flatnonzero(miss.exists)[:MOST_INTERVALS]
    if not len(known):
        return note("predicted miss: no set is left")
    ends = np.stack([miss.lower_m[known], miss.upper_m[known]], axis=1)
    if len(miss.exists) == 1:
        title = f"predicted miss from {ends[0, 0]:.4g} to {ends[0, 1]:.4g} m"
    else:
        title = f"predicted miss, {len(known)} of {len(miss.exists)} engagements"
    y = (-float(len(known)), 1.0)
    plane = Plane(limits(np.append(ends, 0.0)), y, "predicted miss, m", "", title, 74 + 8 * len(known))
    plane.line(np.array([[0.0, y[0]], [0.0, y[1]]]), ACCENT, width=1.0)
    for row, (lower, upper) in enumerate(ends):
        plane.line(
            np.array([[lower, -row], [upper, -row]]), NEAR if len(known) < 2 else shade(row, len(known)), width=4
        )
    return plane.svg()
