"""Compiled outer approximations of polygons (see `polygon`) and of paths by fewer vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, compiled, inlined
from infoset.arrays import Floats
from infoset.geometry.polygon import (
    HEIGHT_ROUNDING,
    Points,
    append,
    close,
    cross,
    farthest_pair,
    following,
    move,
    put,
)
from infoset.geometry.polygon_exact import hull


class Removal(NamedTuple):
    """Twice the area that the removal of an edge adds, and the point where its neighbours meet."""

    added: float
    x: float
    y: float


class CheapestEdge(NamedTuple):
    """The first vertex of an edge, and the point where its neighbours meet."""

    start: int
    x: float
    y: float


@allocation_free
def drop_turned(out: Points, made: int, x: float, y: float) -> int:
    """Remove last vertices, down to one, at which the path to (x, y) does not turn left.

    Return the new count.
    """
    while made > 1:
        along_x = out[made - 1, 0] - out[made - 2, 0]
        along_y = out[made - 1, 1] - out[made - 2, 1]
        if cross(along_x, along_y, x - out[made - 1, 0], y - out[made - 1, 1]) > 0.0:
            break
        made -= 1
    return made


@compiled
def reduce_outward(points: Points, count: int, cap: int) -> int:
    """Remove edges, in place, until at most `cap` vertices are left; return the new count.

    The result contains the polygon. The cap is at least 4, because a convex polygon of five
    vertices always has an edge that can be removed. An edge is removed by extending its neighbours
    to their intersection; the edge that adds the minimum area is removed first, at O(count) per
    edge. If rounding has given an edge a wrong direction, the hull is taken first; a rectangle
    replaces a hull that is too thin.
    """
    is_hull = False
    while count > cap:
        edge = cheapest_edge(points, count)
        if edge.start >= 0:
            put(points, edge.start, edge.x, edge.y)
            for i in range(following(edge.start, count), count - 1):
                move(points, i + 1, i)
            count -= 1
            is_hull = False
        elif is_hull:
            count = make_rectangle(points, count)
        else:
            count = hull(points, count, points)
            is_hull = True
    return count


@allocation_free
def cheapest_edge(points: Points, count: int) -> CheapestEdge:
    """Return the edge whose removal adds the minimum area; its start is -1 if there is none.

    A polygon that is not convex has none, and a thin one may have none.
    """
    minimum = np.inf
    cheapest = CheapestEdge(-1, 0.0, 0.0)
    before = count - 1
    for i in range(count):
        j = following(i, count)
        removal = removed_edge(points, before, i, j, following(j, count))
        before = i
        if removal.added < 0.0:
            return CheapestEdge(-1, 0.0, 0.0)
        if removal.added < minimum:
            minimum = removal.added
            cheapest = CheapestEdge(i, removal.x, removal.y)
    return cheapest


@inlined
def removed_edge(points: Points, before: int, i: int, j: int, after: int) -> Removal:
    """Return the area that the removal of the edge from vertex i to j adds, twice.

    It is infinite if the edge cannot be removed, -1 if the path does not turn left at vertex i, and
    may be negative if it turns right at j: callers use only the sign of such areas. `before` and
    `after` are the vertices next to the edge.
    """
    from_x = points[i, 0] - points[before, 0]
    from_y = points[i, 1] - points[before, 1]
    edge_x = points[j, 0] - points[i, 0]
    edge_y = points[j, 1] - points[i, 1]
    to_x = points[after, 0] - points[j, 0]
    to_y = points[after, 1] - points[j, 1]
    bend = cross(from_x, from_y, edge_x, edge_y)
    if bend <= 0.0:
        return Removal(-1.0, 0.0, 0.0)

    # Neighbours that turn by half a revolution or more do not meet. Nearly half a revolution, to
    # rounding, counts as that: the point where they meet would be arbitrary.
    turn = cross(from_x, from_y, to_x, to_y)
    if turn <= HEIGHT_ROUNDING * (abs(from_x * to_y) + abs(from_y * to_x)):
        return Removal(np.inf, 0.0, 0.0)

    reach = cross(edge_x, edge_y, to_x, to_y) / turn
    x = points[i, 0] + reach * from_x
    y = points[i, 1] + reach * from_y
    # The new vertex is on the line of the next edge, behind j: without rounding always, as `bend`
    # and `turn` are positive. If rounding puts it in front of j, at a sharp tip, it would cut off
    # the tip.
    is_behind = (points[j, 0] - x) * to_x + (points[j, 1] - y) * to_y >= 0.0
    return Removal(reach * bend if is_behind else np.inf, x, y)


@allocation_free
def drop_inner_edges(points: Points, count: int, fewest: int, work: Points) -> tuple[int, bool]:
    """Remove edges inside a path, in place, until `fewest` vertices are left.

    The path moves outward only. The edge that adds the minimum area is removed first, of equal ones
    the first. Return the new number of vertices, and False if no edge can be removed before that,
    or the path does not turn left at the start of one. O(count + removed log(count)).

    `work` is a working array of twice as many rows as the minimum power of two from `count`. Its
    first column is a tree: the leaves are the areas that the removal of the edge after each vertex
    adds, the other nodes are the lesser of two children, and the root is node 1. Its second column
    has the numbers of the next and, from `leaves`, of the previous vertex.
    """
    leaves = 1
    while leaves < count:
        leaves *= 2
    tree = work[:, 0]
    links = work[:, 1]
    last = count - 1
    for i in range(leaves):
        links[i] = min(i + 1, last)
        links[leaves + i] = max(i - 1, 0)
        # The first and the last edge of the path stay.
        is_inner = 0 < i < last - 1
        tree[leaves + i] = (
            removed_edge(points, i - 1, i, i + 1, i + 2).added if is_inner else np.inf
        )
    update_nodes(tree, leaves, 2 * leaves - 1)

    while count > fewest and 0.0 <= tree[1] < np.inf:
        i = first_lowest_leaf(tree, leaves)
        before = int(links[leaves + i])
        j = int(links[i])
        after = int(links[j])
        removal = removed_edge(points, before, i, j, after)
        put(points, i, removal.x, removal.y)
        links[i] = after
        links[leaves + after] = i
        tree[leaves + j] = np.inf
        count -= 1

        # The removal changes the areas of four edges: they begin at the two vertices before the new
        # one, at it, and after it.
        first = int(links[leaves + before])
        i = first
        at = first
        for _ in range(4):
            before = int(links[leaves + i])
            j = int(links[i])
            after = int(links[j])
            is_inner = before < i < j < after
            tree[leaves + i] = (
                removed_edge(points, before, i, j, after).added if is_inner else np.inf
            )
            at = i
            i = j
        update_nodes(tree, leaves + first, leaves + at)

    i = 0
    for made in range(count):
        move(points, i, made)
        i = int(links[i])
    return count, count <= fewest


@inlined
def first_lowest_leaf(tree: Floats, leaves: int) -> int:
    """Return the number of the lowest leaf of a tree of minima; of equal ones the first."""
    at = 1
    while at < leaves:
        # To the second child only if the first one is not the lowest.
        at = 2 * at + (tree[2 * at] > tree[1])
    return at - leaves


@inlined
def update_nodes(tree: Floats, first: int, last: int) -> None:
    """Compute the nodes above the leaves from `first` to `last`."""
    while first > 1:
        first = first >> 1
        last = last >> 1
        for node in range(first, last + 1):
            tree[node] = min(tree[2 * node], tree[2 * node + 1])


@allocation_free
def box_around(points: Points, count: int, sign: float, slope: float) -> int:
    """Replace a path by three sides of a box, in place; return the new count, 4.

    Two equally long sides go outward from its ends along a slope dy/dx; the one from the inner end
    reaches the x of the outermost vertex. `sign` is 1 if greater x is outward, else -1. The array
    has room for four vertices.
    """
    first_x = points[0, 0]
    first_y = points[0, 1]
    last_x = points[count - 1, 0]
    last_y = points[count - 1, 1]
    outermost = sign * first_x
    for i in range(count):
        outermost = max(outermost, sign * points[i, 0])

    out = sign * (outermost - min(sign * first_x, sign * last_x))
    put(points, 1, first_x + out, first_y + out * slope)
    put(points, 2, last_x + out, last_y + out * slope)
    put(points, 3, last_x, last_y)
    return 4


@compiled
def make_rectangle(points: Points, count: int) -> int:
    """Replace a polygon by its bounding rectangle along its diameter, in place. O(count^2).

    The array has room for four vertices; a set without a width has fewer.
    """
    diameter = farthest_pair(points, count)
    x = 1.0
    y = 0.0
    if diameter.distance > 0.0:
        x = (points[diameter.first, 0] - points[diameter.last, 0]) / diameter.distance
        y = (points[diameter.first, 1] - points[diameter.last, 1]) / diameter.distance

    # Coordinates along and across the diameter, from the first vertex.
    origin_x = points[0, 0]
    origin_y = points[0, 1]
    from_x = points[:count, 0] - origin_x
    from_y = points[:count, 1] - origin_y
    along = x * from_x + y * from_y
    across = x * from_y - y * from_x
    left = along.min()
    right = along.max()
    low = across.min()
    high = across.max()

    made = 0
    for a, h in ((left, low), (right, low), (right, high), (left, high)):
        made = append(points, made, origin_x + a * x - h * y, origin_y + a * y + h * x)
    return close(points, made)
