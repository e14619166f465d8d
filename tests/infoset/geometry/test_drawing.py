"""Drawn sets: the artists on the axes, and the pixels of the picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from infoset import ConvexPolygons, Polytope, Zonotope
from infoset.geometry.drawing import ring_order

# Functions and not constants: kernels are compiled when tests run, not when they are collected.


@cache
def cube() -> Polytope:
    return Polytope.from_box([0, 0, 0], [1, 1, 1])


@cache
def square() -> ConvexPolygons:
    return ConvexPolygons.from_box([0, 0], [2, 1])


@pytest.fixture(autouse=True)
def plain_style() -> Iterator[None]:
    """Matplotlib's own style, and no figure that is left over."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.use("Agg")
        yield
        plt.close("all")


def axes_of(space: int) -> Any:
    return plt.figure().add_subplot(projection="3d" if space == 3 else None)


def painted(figure: Figure) -> int:
    """Number of pixels that are not white."""
    figure.canvas.draw()
    pixels: Any = figure.canvas
    return int((np.asarray(pixels.buffer_rgba())[..., :3] < 255).any(axis=-1).sum())


@pytest.mark.parametrize("kind", [ConvexPolygons, Polytope])
def test_set_of_the_plane_is_one_patch_of_its_vertices(kind: Any) -> None:
    ax = axes_of(2)

    (patch,) = kind.from_box([0, 1], [2, 5]).plot(ax, facecolor="red", alpha=0.5, label="box")

    assert list(ax.patches) == [patch]
    assert {tuple(corner) for corner in patch.get_xy().tolist()} == {(0, 1), (2, 1), (2, 5), (0, 5)}
    assert patch.get_facecolor() == patch.get_edgecolor() == to_rgba("red", 0.5)
    assert patch.get_label() == "box"


def test_batch_is_drawn_member_by_member_without_the_empty_ones() -> None:
    ax = axes_of(2)
    batch = ConvexPolygons.stack([square(), ConvexPolygons.empty(), square().translate([3, 0])])

    first, second = batch.plot(ax)

    assert first.get_xy().max() == 2.0
    assert second.get_xy().max() == 5.0
    assert first.get_facecolor() != second.get_facecolor()


@pytest.mark.parametrize(
    "empty", [ConvexPolygons.empty(), ConvexPolygons.empty((2,)), Polytope.empty(2)]
)
def test_empty_set_of_the_plane_is_drawn_without_artists(empty: Any) -> None:
    ax = axes_of(2)

    assert empty.plot(ax) == []
    assert not ax.has_data()


def test_empty_set_of_space_is_drawn_without_artists() -> None:
    ax = axes_of(3)

    assert Polytope.empty(3).plot(ax) == []
    assert not ax.has_data()


@pytest.mark.parametrize(
    "points",
    [
        [(0.0, 0.0)],
        [(0.0, 0.0), (2.0, 1.0)],
        [(0.0, 0.0), (2.0, 0.0), (1.0, 1e-9)],
        [(0.0, 0.0), (2.0, 1.0), (0.0, 1.0)],
        [(0.0, 0.0, 0.0)],
        [(0.0, 0.0, 0.0), (1.0, 2.0, 3.0)],
        [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0)],
        [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)],
        [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)],
    ],
    ids=[
        "point",
        "segment",
        "sliver",
        "triangle",
        "point in space",
        "segment in space",
        "triangle in space",
        "square in space",
        "tetrahedron",
    ],
)
@pytest.mark.parametrize(
    "style", [{}, {"color": "black"}, {"facecolor": "red"}, {"alpha": 0.5, "linewidth": 2.0}]
)
def test_set_of_any_dimension_is_visible(
    points: list[tuple[float, ...]], style: dict[str, Any]
) -> None:
    """Points, segments and slivers are visible by their edges."""
    space = len(points[0])
    sets: list[Any] = [Polytope.from_vertices(points)]
    if space == 2:
        sets.append(ConvexPolygons.from_points(points))

    for each in sets:
        ax = axes_of(space)
        (artist,) = each.plot(ax, **style)
        ax.set_axis_off()
        with_set = painted(ax.figure)
        artist.remove()

        assert painted(ax.figure) == 0
        assert with_set > 10  # a dot has about 30 pixels


def test_facets_of_a_cube_are_its_six_squares() -> None:
    ax = axes_of(3)
    (artist,) = cube().plot(ax)
    ax.figure.canvas.draw()
    rings = cube()._facet_rings()

    assert len(artist.get_paths()) == len(rings) == 6

    for ring in rings:
        sides = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1)
        np.testing.assert_allclose(sides, 1.0, rtol=1e-15)


@pytest.mark.parametrize("seed", range(10))
def test_order_around_a_polygon_in_space_is_the_order_of_its_angles_in_the_plane(seed: int) -> None:
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, 7))
    circle = np.column_stack([np.cos(angles), np.sin(angles)]) * [1.0, 10.0 ** -(seed % 5)]
    mixed = random.permutation(7)

    order = ring_order((circle @ random.normal(size=(2, 3)))[mixed])

    steps = np.diff(np.append(mixed[order], mixed[order][0])) % 7

    assert (steps == 1).all() or (steps == 6).all()


@pytest.mark.parametrize("seed", range(5))
def test_edges_of_facets_join_vertices_with_two_common_facets(seed: int) -> None:
    """The order around a facet agrees with the incidence of facets and vertices."""
    random = np.random.default_rng(seed)
    polytope = Zonotope([0, 0, 0], random.normal(size=(4, 3))).polytope()

    for on in polytope.incidence.T:
        ring = np.flatnonzero(on)[ring_order(polytope.points[on])]
        for one, other in zip(ring, np.roll(ring, 1), strict=True):
            assert (polytope.incidence[one] & polytope.incidence[other]).sum() == 2


def test_faces_in_space_are_transparent_if_the_style_has_no_opacity() -> None:
    ax = axes_of(3)
    (first,) = cube().plot(ax)
    (second,) = cube().plot(ax, color="red")
    (third,) = cube().plot(ax, facecolor="red", edgecolor="black", shade=False)

    ax.figure.canvas.draw()

    assert [tuple(artist.get_facecolor()[0]) for artist in (first, second, third)] == [
        to_rgba("C0", 0.3),
        to_rgba("red", 0.3),
        to_rgba("red"),
    ]
    assert [tuple(artist.get_edgecolor()[0]) for artist in (first, second, third)] == [
        to_rgba("C0"),
        to_rgba("red"),
        to_rgba("black"),
    ]


def test_sets_in_space_have_different_colours_and_are_within_the_limits() -> None:
    ax = axes_of(3)
    (first,) = cube().translate([10, 20, 30]).plot(ax)
    (second,) = cube().translate([14, 20, 30]).plot(ax)
    third = Polytope.from_vertices([[10, 29, 30]]).plot(ax)[0]

    ax.figure.canvas.draw()

    assert len({tuple(artist.get_edgecolor()[0]) for artist in (first, second, third)}) == 3
    for low, high, ends in [
        (10, 15, ax.get_xlim()),
        (20, 29, ax.get_ylim()),
        (30, 31, ax.get_zlim()),
    ]:
        assert low - 1 < ends[0] <= low
        assert high <= ends[1] < high + 1


def test_hatching_of_a_polygon_stays_visible() -> None:
    (patch,) = square().plot(axes_of(2), hatch="//")

    assert patch.get_hatchcolor() != patch.get_facecolor()


def test_present_axes_are_used_if_they_have_as_many_dimensions() -> None:
    plane = plt.figure().add_subplot()
    square().plot()
    square().polytope().plot()

    assert len(plane.patches) == 2

    cube().plot()
    space = plt.gca()

    assert space.figure is not plane.figure

    cube().plot()
    assert len(space.collections) == 2

    square().plot()
    assert plt.gca() not in (plane, space)
    assert len(plt.gca().patches) == 1


@pytest.mark.parametrize("dimension", [2, 3])
def test_axes_are_made_in_a_new_figure_if_there_are_none(dimension: int) -> None:
    Polytope.from_box([0] * dimension, [1] * dimension).plot()

    assert len(plt.get_fignums()) == 1
    assert (plt.gca().name == "3d") == (dimension == 3)


@pytest.mark.parametrize(
    ("make", "space"),
    [
        (square, 3),
        (lambda: square().polytope(), 3),
        (cube, 2),
        (lambda: Polytope.empty(3), 2),
    ],
)
def test_axes_of_another_dimension_are_refused(make: Callable[[], Any], space: int) -> None:
    each = make()
    with pytest.raises(
        ValueError,
        match=rf"a set of R\^{5 - space} is drawn on axes of {5 - space} dimensions: got",
    ):
        each.plot(axes_of(space))


@pytest.mark.parametrize("make", [square, cube])
def test_argument_other_than_axes_is_refused(make: Callable[[], Any]) -> None:
    each = make()
    with pytest.raises(TypeError, match="ax must be axes of matplotlib: got"):
        each.plot(np.array([axes_of(2), axes_of(2)]))


@pytest.mark.parametrize(
    ("space", "instead"),
    [
        (1, r"it is the interval of bounding_box\(\)"),
        (4, "project it on two or three axes first"),
        (6, "project it on two or three axes first"),
    ],
)
def test_set_of_another_space_is_refused_with_the_methods_to_use(space: int, instead: str) -> None:
    with pytest.raises(
        ValueError,
        match=rf"sets of R\^2 and R\^3 are drawn, and this one is of R\^{space}: {instead}",
    ):
        Polytope.from_box([0] * space, [1] * space).plot()
