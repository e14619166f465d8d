"""Pages of moving craft: paths in views, reachable sets, and curves over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from infoset.arrays import Floats
from infoset.experiments.common.page_document import page
from infoset.experiments.common.units import Unit, time_unit

_SPEEDS = (5, 30, 60, 120)
"""Speeds that the reader can choose, steps a second; chosen: the pages have 100 to 400 steps, which
take from a minute or so down to some seconds.
"""
_FLAT = np.cos(np.radians(4.0))
"""Cosine of the angle between normals, 4 degrees, up to which triangles are one face; chosen.

Rounding turns the normals of tiny triangles by some degrees; with a larger angle, edges of a round
set would be lost.
"""


@dataclass(frozen=True, eq=False)
class Track:
    """A path: points in SI, shape (n, 3), at the times of the page.

    `look` is the index of its line style and mark. A path that ends earlier has fewer points.
    `choice` is the index of the choice with which it is shown; None shows it with every choice.
    """

    name: str
    look: int
    points: Floats
    choice: int | None = None


@dataclass(frozen=True, eq=False)
class Mark:
    """A fixed point in SI: cross, plus or diamond, as no moving point.

    A mark with an empty name is not in the legend.
    """

    name: str
    point: Floats
    kind: str = "cross"


@dataclass(frozen=True, eq=False)
class Sets:
    """A set that changes with time.

    The faces of a set are polygons of shape (k, 3) in space, or (k, 2) in the plane of the view,
    SI. `of_frame` is the index of the set at each of the times of the page.
    """

    name: str
    faces: Sequence[Sequence[Floats]]
    of_frame: Sequence[int]


@dataclass(frozen=True, eq=False)
class View:
    """Paths in space, or in the plane of a horizontal and a vertical axis."""

    caption: str
    axes: tuple[str, str, str]
    unit: Unit
    tracks: Sequence[Track]
    marks: Sequence[Mark] = ()
    plane: tuple[int, int] | None = None
    equal: bool = True
    sets: Sets | None = None


@dataclass(frozen=True, eq=False)
class PageCurve:
    """Values at the times of the page, SI; `look` and `choice` are as in `Track`."""

    name: str
    look: int
    values: Floats
    choice: int | None = None


@dataclass(frozen=True, eq=False)
class Graph:
    """Curves over time.

    `levels` are values of horizontal lines, SI. `band` has the smallest and the largest possible
    value at each time, SI, shape (n, 2). With `stairs` the values are constant between the times.
    """

    caption: str
    title: str
    unit: Unit
    curves: Sequence[PageCurve]
    levels: Sequence[float] = ()
    band: Floats | None = None
    stairs: bool = False


def motion_page(
    heading: str,
    about: Sequence[str],
    time_s: Floats,
    views: Sequence[View],
    graphs: Sequence[Graph] = (),
    choices: Sequence[str] = (),
    own_script: str | None = None,
    own_data: Mapping[str, object] | None = None,
) -> str:
    """Return a page of moving craft as HTML.

    `choices` are names of alternative controls, of which the reader selects one. `own_script` is
    the text of the script that starts the page, if it is not the common one, and `own_data` further
    data for it.
    """
    name, factor = time_unit(float(np.ptp(time_s)))
    data: dict[str, object] = {
        "heading": heading,
        "about": list(about),
        "time_s": time_s,
        "time_unit": name,
        "time_factor": factor,
        "speeds": _SPEEDS,
        "views": views,
        "graphs": graphs,
        "choices": choices,
    }
    if own_data is not None:
        data |= own_data
    scripts = ["motion.js"]
    if not own_script:
        scripts.append("start-motion.js")
    return page(heading, scripts, data, own_script)


def faces_of(points: Floats) -> list[Floats]:
    """Return the faces of the convex hull of points in space.

    Points in a plane, or of a flat set, have their outline as the only face. There is at least one
    point; those of a flat set in space must be its vertices, see `outline`.
    """
    # In space, fewer than four points are always flat.
    if points.shape[1] == 2 or len(points) < 4:
        return [outline(points)]
    try:
        # Points in one place have no size; 1e-300 instead keeps the division defined, and Qhull
        # refuses them. From the first point they are zero: no quotient overflows.
        from_first = points - points[0]
        hull = ConvexHull(from_first / max(float(np.ptp(points, axis=0).max()), 1e-300))
    except QhullError:
        return [outline(points)]

    # Triangles of one plane are one face: their normals are equal up to `_FLAT`.
    # The first three numbers of the equation of a triangle are its normal of length 1, outward.
    faces: list[tuple[Floats, set[int]]] = []
    for simplex, equation in zip(hull.simplices, hull.equations, strict=True):
        mine = next((corners for normal, corners in faces if normal @ equation[:3] > _FLAT), None)
        if mine is None:
            faces.append((equation[:3], set(simplex.tolist())))
        else:
            mine.update(simplex.tolist())

    return [outline(points[sorted(corners)]) for _, corners in faces]


def outline(points: Floats) -> Floats:
    """Return the vertices of a flat convex set in the order in which an outline connects them.

    Of points in a plane, shape (n, 2), the interior ones are left out. All points in space, shape
    (n, 3), are returned, so these must be the vertices: by their angle about their mean.
    """
    if points.shape[1] == 2 and len(points) > 3:
        try:
            # As in `faces_of`; here an axis may have no extent.
            from_first = points - points[0]
            hull = ConvexHull(from_first / np.maximum(np.ptp(points, axis=0), 1e-300))
            return np.asarray(points[hull.vertices])
        except QhullError:
            pass

    centred = points - points.mean(axis=0)
    # The two directions in which the points extend most: those of their plane.
    across = np.linalg.svd(centred, full_matrices=False)[2][:2]
    if len(across) < 2:
        return points
    return np.asarray(points[np.argsort(np.arctan2(centred @ across[1], centred @ across[0]))])
