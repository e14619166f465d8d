"""SVG pictures of polygons and predicted misses for notebooks, drawn from arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.svg import ACCENT, NEAR, Plane, evenly, limits, note, shade, side_by_side

MOST_OUTLINES = 9
MOST_INTERVALS = 24


def outlines_svg(outlines: Sequence[Floats], x_title: str, y_title: str, title: str) -> str:
    """Return a picture of convex polygons, each an array of vertices of shape (n, 2) in the units of the axes."""
    shown = [outlines[index] for index in evenly(len(outlines), MOST_OUTLINES)]
    shown = [outline for outline in shown if len(outline)]
    if not shown:
        return note(f"{title}: nothing is left" if outlines else title)
    points = np.concatenate(shown)
    plane = Plane(limits(points[:, 0]), limits(points[:, 1]), x_title, y_title, title)
    for index, outline in enumerate(shown):
        plane.line(outline, shade(index, len(shown)), closed=len(outline) > 2)
    return plane.svg()


def sections_svg(planes: Mapping[str, Sequence[Floats]], title: str) -> str:
    """Return a picture of sections in (omega, alpha) planes, coloured from the nearest (dark) to the farthest.

    `planes` has the vertices (omega, alpha) of each section, rad/s and rad, shape (n, 2), by the text that the title of
    the plane ends with. Planes are side by side.
    """
    return side_by_side(
        [
            outlines_svg([outline * 1e6 for outline in outlines], "rate ω, µrad/s", "angle α, µrad", f"{title}{plane}")
            for plane, outlines in planes.items()
        ]
    )


def predicted_miss_svg(exists: Flags, lower_m: Floats, upper_m: Floats) -> str:
    """Return a picture of the predicted-miss intervals that exist, one bar per engagement; in space one for y and z."""
    known = np.flatnonzero(exists)[:MOST_INTERVALS]
    if not len(known):
        return note("predicted miss: no set is left")
    axes = lower_m.ndim
    ends = np.stack([lower_m[..., known], upper_m[..., known]]).reshape(2, axes, -1).transpose(2, 1, 0).reshape(-1, 2)
    along = ("",) if axes == 1 else (" along y", " along z")
    if len(exists) == 1:
        parts = (
            f"from {least:.4g} to {greatest:.4g} m{axis}" for (least, greatest), axis in zip(ends, along, strict=True)
        )
        title = f"predicted miss {', '.join(parts)}"
    else:
        title = f"predicted miss{' and'.join(along)}, {len(known)} of {len(exists)} engagements"
    y = (-float(len(ends)), 1.0)
    plane = Plane(limits(np.append(ends, 0.0)), y, "predicted miss, m", "", title, 74 + 8 * len(ends))
    plane.line(np.array([[0.0, y[0]], [0.0, y[1]]]), ACCENT, width=1.0)
    for row, (lower, upper) in enumerate(ends):
        plane.line(np.array([[lower, -row], [upper, -row]]), NEAR if len(ends) < 2 else shade(row, len(ends)), width=4)
    return plane.svg()
