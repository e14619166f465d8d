"""SVG pictures of polygons and predicted misses for notebooks, drawn from arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from infoset.svg import ACCENT, NEAR, Plane, evenly, limits, note, shade

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_OUTLINES = 9
MOST_INTERVALS = 24


def outlines_svg(outlines: Sequence[Floats], x_title: str, y_title: str, title: str) -> str:
    """Return a picture of convex polygons.

    Parameters
    ----------
    outlines : sequence of ndarray, shape (n, 2)
        Vertices of the polygons, in the units of the axes.
    x_title, y_title : str
        Names of the axes, with units.
    title : str
        Text above the picture.
    """
    shown = [outlines[index] for index in evenly(len(outlines), MOST_OUTLINES)]
    shown = [outline for outline in shown if len(outline)]
    if not shown:
        return note(f"{title}: nothing is left" if outlines else title)
    points = np.concatenate(shown)
    plane = Plane(limits(points[:, 0]), limits(points[:, 1]), x_title, y_title, title)
    for index, outline in enumerate(shown):
        plane.line(outline, shade(index, len(shown)), closed=len(outline) > 2)
    return plane.svg()


def sections_svg(outlines: Sequence[Floats], title: str) -> str:
    """Return a picture of sections in the (omega, alpha) plane, coloured from the nearest (dark) to the farthest.

    Parameters
    ----------
    outlines : sequence of ndarray, shape (n, 2)
        Vertices (omega, alpha) of each section, rad/s and rad.
    title : str
        Text above the picture.
    """
    return outlines_svg([outline * 1e6 for outline in outlines], "rate ω, µrad/s", "angle α, µrad", title)


def predicted_miss_svg(exists: Flags, lower_m: Floats, upper_m: Floats) -> str:
    """Return a picture of the predicted-miss intervals that exist, one bar per engagement."""
    known = np.flatnonzero(exists)[:MOST_INTERVALS]
    if not len(known):
        return note("predicted miss: no set is left")
    ends = np.stack([lower_m[known], upper_m[known]], axis=1)
    if len(exists) == 1:
        title = f"predicted miss from {ends[0, 0]:.4g} to {ends[0, 1]:.4g} m"
    else:
        title = f"predicted miss, {len(known)} of {len(exists)} engagements"
    y = (-float(len(known)), 1.0)
    plane = Plane(limits(np.append(ends, 0.0)), y, "predicted miss, m", "", title, 74 + 8 * len(known))
    plane.line(np.array([[0.0, y[0]], [0.0, y[1]]]), ACCENT, width=1.0)
    for row, (lower, upper) in enumerate(ends):
        plane.line(
            np.array([[lower, -row], [upper, -row]]), NEAR if len(known) < 2 else shade(row, len(known)), width=4
        )
    return plane.svg()
