"""Drawing of convex sets of the plane and of space on axes of matplotlib.

matplotlib is imported only by the functions that draw.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from infoset.arrays import Floats, Integers
from infoset.limits import shown

FACE_OPACITY = 0.3
"""Opacity of the facets of a set of space, unless the style has another.

Chosen by eye: the edges behind two facets stay visible.
"""
EDGE_NAMES = {"edgecolor", "ec", "color"}
"""Names of matplotlib for the colour of the edges of patches."""
COLLECTION_NAMES = {
    "edgecolor": "edgecolors",
    "ec": "edgecolors",
    "facecolor": "facecolors",
    "fc": "facecolors",
}
"""Other names of the colours of collections; with `shade` only these two are taken."""
OF_PATCHES = {"closed", "fill"}
"""Options that matplotlib's patches have, and its collections do not."""


def draw_polygons(ax: Any, rings: Sequence[Floats], style: dict[str, Any]) -> list[Any]:
    """Draw polygons with rings of vertices, shape (k, 2), on 2-D axes.

    Return an artist for each ring that has vertices.

    The edges have the colour of the face, unless the style has another, so that a segment and a set
    that is thinner than a pixel are visible; a point is a dot. `style` has the options of
    matplotlib's `fill`.
    """
    axes = axes_of(ax, 2)
    artists = []
    for ring in rings:
        if len(ring) == 1:
            artists.append(_draw_point(axes, ring[0], style))
        elif len(ring) > 1:
            (patch,) = axes.fill(*ring.T, **style)
            if patch.get_fill() and not EDGE_NAMES & style.keys():
                _colour_edges_as_face(patch)
            artists.append(patch)
    return artists


def draw_facets(ax: Any, rings: Sequence[Floats], style: dict[str, Any]) -> list[Any]:
    """Draw polygons with rings of vertices, shape (k, 3), on 3-D axes.

    Return one artist, or none without polygons.

    A ring may be a segment; a single ring of one vertex is a dot. `style` has the options of
    matplotlib's `Poly3DCollection`. The edges and the transparent faces have the colour `color`, or
    the next colour of the axes, unless `alpha`, `facecolor` or `edgecolor` are given.
    """
    axes = axes_of(ax, 3)
    if not rings:
        return []

    look = {COLLECTION_NAMES.get(name, name): value for name, value in style.items()}
    colour = look.pop("color", None)
    if colour is None and "facecolors" not in look:
        colour = _next_colour(axes)
    if len(rings[0]) == 1:
        return [_draw_point(axes, rings[0][0], look | {"color": colour})]

    if "facecolors" not in look:
        look["facecolors"] = colour if "alpha" in look else (colour, FACE_OPACITY)
    if "edgecolors" not in look:
        look["edgecolors"] = look["facecolors"] if colour is None else colour

    facets = import_module("mpl_toolkits.mplot3d.art3d").Poly3DCollection(rings, **look)
    has_data = axes.has_data()
    axes.add_collection3d(facets, autolim=False)
    axes.auto_scale_xyz(*np.vstack(rings).T, had_data=has_data)
    return [facets]


def limits_of(axes: Any, dimensions: int) -> tuple[Floats, Floats]:
    """Fix the limits of axes; return the minimum and the maximum coordinates, (2,) or (3,) each."""
    lower = np.empty(dimensions)
    upper = np.empty(dimensions)
    for k, axis in enumerate("xyz"[:dimensions]):
        ends = getattr(axes, f"get_{axis}lim")()
        getattr(axes, f"set_{axis}lim")(ends)
        lower[k], upper[k] = sorted(ends)
    return lower, upper


def ring_order(points: Floats) -> Integers:
    """Return the order of the vertices, shape (k, n), around a convex polygon of R^n.

    The polygon may be a segment or a point.
    """
    if len(points) < 3:
        return np.arange(len(points))

    # In these coordinates the polygon is as wide as it is long; an affine map keeps the order. The
    # first two columns belong to the plane of the polygon, the others to rounding.
    steps = points - points.mean(axis=0)
    coordinates = np.linalg.svd(steps, full_matrices=False)[0]
    return np.argsort(np.arctan2(coordinates[:, 1], coordinates[:, 0]))


def _colour_edges_as_face(patch: Any) -> None:
    """Give the edges of a patch the colour of its face.

    The hatching, which matplotlib gives the colour of the edges, keeps its own.
    """
    hatching = patch.get_hatchcolor()
    patch.set_edgecolor(patch.get_facecolor())
    patch.set_hatchcolor(hatching)


def _draw_point(axes: Any, point: Floats, style: dict[str, Any]) -> Any:
    """Draw a set of one point as a dot, with the style of a polygon."""
    look = {name: value for name, value in style.items() if name not in OF_PATCHES}
    if not style.get("fill", True):
        look["facecolor"] = "none"
    return axes.scatter(*point[:, None], **look)


def _next_colour(axes: Any) -> Any:
    """Return the next colour of the cycle of the axes, which collections do not take themselves."""
    (line,) = axes.plot([], [], [])
    line.remove()
    return line.get_color()


def axes_of(ax: Any, space: int) -> Any:
    """Return axes for sets of R^2 or R^3.

    They are `ax` if it is given, else the present axes of pyplot, or new ones if these do not fit.

    Raises
    ------
    TypeError, ValueError
        If `ax` is not axes, or has another number of dimensions.
    """
    if ax is not None:
        if not isinstance(ax, import_module("matplotlib.axes").Axes):
            raise TypeError(f"ax must be axes of matplotlib: got {shown(ax)}")
        if _dimensions(ax) != space:
            raise ValueError(
                f"a set of R^{space} is drawn on axes of {space} dimensions: got {shown(ax)}"
            )
        return ax

    pyplot = import_module("matplotlib.pyplot")
    figure = pyplot.gcf()
    if figure.axes:
        if _dimensions(figure.gca()) == space:
            return figure.gca()
        figure = pyplot.figure()
    return figure.add_subplot(projection="3d" if space == 3 else None)


def _dimensions(axes: Any) -> int:
    """Return the number of dimensions of axes."""
    return 3 if axes.name == "3d" else 2
