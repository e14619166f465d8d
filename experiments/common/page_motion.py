"""What pages of craft in motion show: paths in views, sets they lead through, and curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from experiments.common.display_units import Unit, time_unit
from experiments.common.page_document import page

Floats = NDArray[np.float64]

_SPEEDS = (5, 30, 60, 120)
_FLAT = np.cos(np.radians(4.0))


@dataclass(frozen=True, eq=False)
class Track:
    """A path.

    Parameters
    ----------
    name : str
    look : int
        Which of the looks of lines and marks.
    points : ndarray, shape (n, 3)
        At the page's times, SI; a path that ends sooner has fewer.
    choice : int or None
        Which of the page's choices it belongs to; None belongs to all.
    """

    name: str
    look: int
    points: Floats
    choice: int | None = None


@dataclass(frozen=True, eq=False)
class Mark:
    """A point: its name (empty to leave it out of the legend), its place (3,) in SI, and a cross, square or diamond."""

    name: str
    point: Floats
    kind: str = "cross"


@dataclass(frozen=True, eq=False)
class Sets:
    """Sets that a view shows, one at a time clearly.

    Parameters
    ----------
    name : str
    faces : sequence of sequence of ndarray
        Of each set its faces, polygons of shape (k, 3) in space or (k, 2) in a view's plane, SI.
    of_frame : sequence of int
        Which set belongs to each of the page's times.
    """

    name: str
    faces: Sequence[Sequence[Floats]]
    of_frame: Sequence[int]


@dataclass(frozen=True, eq=False)
class View:
    """Paths seen in space or in a plane.

    Parameters
    ----------
    caption : str
    axes : tuple of str
        Names of the three axes, without units.
    unit : tuple
    tracks : sequence of Track
    marks : sequence of Mark
    plane : tuple of int, or None
        Which axes go across and up; None is space.
    equal : bool
        Whether a unit is as long along every axis.
    sets : Sets or None
    """

    caption: str
    axes: tuple[str, str, str]
    unit: Unit
    tracks: Sequence[Track]
    marks: Sequence[Mark] = ()
    plane: tuple[int, int] | None = None
    equal: bool = True
    sets: Sets | None = None


@dataclass(frozen=True, eq=False)
class Curve:
    """Values at the page's times, SI; name, look and choice are a track's."""

    name: str
    look: int
    values: Floats
    choice: int | None = None


@dataclass(frozen=True, eq=False)
class Graph:
    """Curves over time.

    Parameters
    ----------
    caption, title : str
        Over the graph, and beside its axis.
    unit : tuple
    curves : sequence of Curve
    levels : sequence of float
        Lines at these values, SI.
    band : ndarray, shape (n, 2), or None
        Least and greatest values that there can be.
    stairs : bool
        Whether values stay until the next one.
    """

    caption: str
    title: str
    unit: Unit
    curves: Sequence[Curve]
    levels: Sequence[float] = ()
    band: Floats | None = None
    stairs: bool = False


@dataclass(frozen=True)
class Choices:
    """Names to choose among, and what to call the choice."""

    name: str = ""
    names: tuple[str, ...] = ()


def motion_page(
    heading: str,
    about: Sequence[str],
    time_s: Floats,
    views: Sequence[View],
    graphs: Sequence[Graph],
    choices: Choices = Choices(),
) -> str:
    """Return a page of craft in motion.

    Parameters
    ----------
    heading : str
    about : sequence of str
        Lines under the heading.
    time_s : ndarray, shape (n,)
        The moments that the page can show.
    views : sequence of View
    graphs : sequence of Graph
    choices : Choices

    Returns
    -------
    str
        HTML.
    """
    data = motion_data(heading, about, time_s, views, graphs, choices)
    return page(heading, ["motion.js", "start-motion.js"], data)


def motion_data(
    heading: str,
    about: Sequence[str],
    time_s: Floats,
    views: Sequence[View],
    graphs: Sequence[Graph],
    choices: Choices = Choices(),
) -> dict[str, object]:
    """Return what the scripts of a page of craft in motion draw; parameters are those of `motion_page`."""
    name, factor = time_unit(float(np.ptp(time_s)))
    return {
        "heading": heading,
        "about": list(about),
        "time_s": time_s.tolist(),
        "time_unit": name,
        "time_factor": factor,
        "speeds": list(_SPEEDS),
        "views": [_view_data(each) for each in views],
        "graphs": [_graph_data(each) for each in graphs],
        "choices_name": choices.name,
        "choices": list(choices.names),
    }


def faces_of(points: Floats) -> list[Floats]:
    """Return the faces of the convex hull of points in space, or its outline in a plane; of a flat set itself.

    Parameters
    ----------
    points : ndarray, shape (n, 2) or (n, 3)

    Returns
    -------
    list of ndarray, shape (k, 2) or (k, 3)
        Polygons.
    """
    if points.shape[1] == 2 or len(points) < 4:
        return [_around(points)]
    try:
        hull = ConvexHull(points / max(float(np.ptp(points, axis=0).max()), 1e-300))
    except QhullError:
        return [_around(points)]
    # Triangles of one plane are one face: equal normals, to a few degrees where facets are tiny.
    faces: list[tuple[Floats, set[int]]] = []
    for simplex, equation in zip(hull.simplices, hull.equations, strict=True):
        mine = next((corners for normal, corners in faces if normal @ equation[:3] > _FLAT), None)
        if mine is None:
            faces.append((equation[:3], set(simplex.tolist())))
        else:
            mine.update(simplex.tolist())
    return [_around(points[sorted(corners)]) for _, corners in faces]


def _around(points: Floats) -> Floats:
    """Points of a flat convex set in the order round it, those inside left out in a plane."""
    if points.shape[1] == 2 and len(points) > 3:
        try:
            return np.asarray(points[ConvexHull(points / np.maximum(np.ptp(points, axis=0), 1e-300)).vertices])
        except QhullError:
            pass
    centred = points - points.mean(axis=0)
    across = np.linalg.svd(centred, full_matrices=False)[2][:2]
    if len(across) < 2:
        return points
    return np.asarray(points[np.argsort(np.arctan2(centred @ across[1], centred @ across[0]))])


def _view_data(view: View) -> dict[str, object]:
    name, factor = view.unit
    return {
        "caption": view.caption,
        "axes": [f"{each}, {name}" for each in view.axes],
        "factor": factor,
        "plane": view.plane,
        "equal": view.equal,
        "tracks": [
            {"name": each.name, "look": each.look, "points": each.points.tolist(), "choice": each.choice}
            for each in view.tracks
        ],
        "marks": [{"name": each.name, "point": each.point.tolist(), "kind": each.kind} for each in view.marks],
        "sets": None if view.sets is None else [[face.tolist() for face in faces] for faces in view.sets.faces],
        "sets_name": "" if view.sets is None else view.sets.name,
        "set_of_frame": [] if view.sets is None else list(view.sets.of_frame),
    }


def _graph_data(graph: Graph) -> dict[str, object]:
    return {
        "caption": graph.caption,
        "title": graph.title,
        "unit": graph.unit[0],
        "factor": graph.unit[1],
        "curves": [
            {"name": each.name, "look": each.look, "values": each.values.tolist(), "choice": each.choice}
            for each in graph.curves
        ],
        "levels": list(graph.levels),
        "stairs": graph.stairs,
        "band": None if graph.band is None else graph.band.tolist(),
    }
