"""No node lies inside the circle through the corners of a triangle : Delaunay's triangulation, found and kept.

Nodes that move a little change a few of its edges. In the triangulation of before, an edge ab between the triangles abc
and bad is wrong where d lies inside the circle of abc; the other diagonal cd takes its place (Lawson 1977). Where every
edge is right and the hull convex, no node lies in any circle (Delaunay 1934), and the triangulation is the only one.
Four nodes on one circle have two, and the diagonal that was there stays. Where nodes have moved too far, all is found
anew.
"""

from __future__ import annotations

import numpy as np
import scipy

from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array, Indices, Mask

TIE = 1e-11  # relative to the size of the coordinates: four nodes are on one circle, as far as rounding can tell
MOST_ROUNDS = 20  # of flips, before the triangulation is found anew


def found(nodes: Array) -> Indices:
    """Corners (T, 3) of the triangles of `nodes` (N, 2), counter-clockwise, in the order of `ordered`.

    Raises SolveError (bad cloud) if the nodes lie on one line.
    """
    try:
        return ordered(scipy.spatial.Delaunay(nodes).simplices.astype(np.intp))
    except scipy.spatial.QhullError as error:
        raise SolveError(Status.BAD_CLOUD, "the nodes lie on one line: they span no triangles") from error


def ordered(corners: Indices) -> Indices:
    """The triangles with their least corner first, in the order of their corners: no trace of how they were found."""
    a, b, c = np.ascontiguousarray(corners.T)
    count, from_a, from_b = np.int64(corners.max()) + 1, (a < b) & (a < c), b < c
    turned = np.stack(
        [np.where(from_a, x, np.where(from_b, y, z)) for x, y, z in ((a, b, c), (b, c, a), (c, a, b))], axis=1
    )
    a, b, c = turned.T
    return turned[in_order((a * count + b) * count + c)[0]]


def edges_of(corners: Indices) -> Indices:
    """The edges (E, 2) of triangles (T, 3), each once, the smaller node first, in the order of their nodes."""
    count = int(corners.max(initial=0)) + 1
    keys = np.sort(side_keys(corners, count))
    return np.stack(np.divmod(keys[np.flatnonzero(np.diff(keys, prepend=-1))], count), axis=1)


def spacings(nodes: Array, edges: Indices) -> Array:
    """The median length of the edges (E, 2) that meet at each node (N, 2), (N,); infinite where none does."""
    lengths = np.linalg.norm(nodes[edges[:, 0]] - nodes[edges[:, 1]], axis=1)
    ends, both = edges.T.ravel(), np.concatenate([lengths, lengths])
    order = np.lexsort((both, ends))
    counts = np.bincount(ends, minlength=len(nodes))
    middle = np.cumsum(counts) - counts + (counts - 1) // 2
    return np.where(counts > 0, both[order][np.minimum(middle, len(both) - 1)], np.inf)


def subdivided(corners: Indices, edges: Indices, first: int) -> Indices:
    """The triangles (T, 3), cut from the middles of those of their sides that are among the `edges` (E, 2) to the other
    ones, or to the corner in front of them; the node in the middle of edge e has the number `first` + e.
    """
    if not len(edges):
        return corners
    keys = np.minimum(*edges.T) * first + np.maximum(*edges.T)
    order = np.argsort(keys)
    asked = side_keys(corners, first)
    at = np.minimum(np.searchsorted(keys, asked, sorter=order), len(keys) - 1)
    middles = np.where(keys[order[at]] == asked, first + order[at], -1).reshape(-1, 3)
    cut = middles >= 0
    count = cut.sum(axis=1)
    # The side from a to b is cut where one is, that from c to a is not where two are.
    turn = np.where(count == 1, cut.argmax(axis=1), np.where(count == 2, (~cut).argmax(axis=1) + 1, 0))
    turned = (turn[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(corners, turned, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, turned, axis=1).T
    by_count = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(ab, b, bc), (a, ab, bc), (a, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    parts = [np.stack(nodes, axis=1)[count == cuts] for cuts, each in by_count.items() for nodes in each]
    return np.concatenate(parts)


def side_keys(corners: Indices, nodes: int) -> Indices:
    """A number for each side ab, bc, ca of each triangle, (3T,): smaller node times `nodes` plus the larger one."""
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    return np.minimum(start, end) * nodes + np.maximum(start, end)


def in_order(keys: Indices) -> tuple[Indices, Indices]:
    """The places (K,) of whole numbers ≥ 0 in their order, equal ones as they were, and the numbers in it.

    To sort numbers that hold their places in their last bits takes a fifth of the time that `argsort` takes.
    """
    bits = len(keys).bit_length()
    if int(keys.max(initial=0)).bit_length() + bits > 63:
        order = np.argsort(keys, kind="stable")
        return order, keys[order]
    both = np.sort(keys << bits | np.arange(len(keys)))
    return both & ((1 << bits) - 1), both >> bits


def kept(corners: Indices, nodes: Array, walls: Indices) -> Indices | None:
    """The triangles that `found` would give, by flips in those of before (T, 3); None where these do not lead there.

    Between nodes of one wall, where no flow is, they may be others.

    walls : (N,), the number of the wall of each node, 0 inside.
    """
    x, y = np.ascontiguousarray(nodes.T)
    tie = TIE * float((x * x + y * y).max())
    if (doubled_areas(x, y, *corners.T) <= 0.0).any():
        return None
    corners, flipped, near = corners.copy(), False, np.arange(len(corners))
    for _ in range(MOST_ROUNDS):
        quads, beside, hull = quadrilaterals(corners[near])
        if not flipped and not _is_convex(hull, x, y, walls, tie):
            return None
        inside, size = _in_circle(x.take(quads), y.take(quads))
        wrong = np.flatnonzero(inside > tie * size)
        wrong = wrong[~on_one_wall(walls[quads[:, wrong]])]
        if not len(wrong):
            return ordered(corners) if flipped else corners
        chosen = wrong[_alone(beside[:, wrong], len(near))]
        (a, b, c, d), (one, other) = quads[:, chosen], near[beside[:, chosen]]
        corners[one], corners[other] = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
        if (doubled_areas(x, y, *corners[[*one, *other]].T) <= 0.0).any():
            return None
        doubtful = np.zeros(len(nodes), dtype=bool)
        doubtful[quads[:, wrong]] = True
        near = np.flatnonzero(doubtful.take(corners.T).any(axis=0))  # no other edge can have become wrong
        flipped = True
    return None


def doubled_areas(x: Array, y: Array, a: Indices, b: Indices, c: Indices) -> Array:
    """Twice the signed areas of the triangles abc of nodes at x, y (N,)."""
    return (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a])


def quadrilaterals(corners: Indices) -> tuple[Indices, Indices, Indices]:
    """For every inner edge ab the nodes a, b, c, d (4, E) of the triangles abc and bad, and these two (2, E); and the
    edges (2, H) of the hull. All go counter-clockwise.
    """
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    key = side_keys(corners, int(corners.max()) + 1)
    order, key = in_order(key)
    again = np.flatnonzero(key[1:] == key[:-1])
    one, other = order[again], order[again + 1]
    single = np.ones(len(key), dtype=bool)
    single[one] = single[other] = False
    apex = corners[:, [2, 0, 1]].ravel()
    quads = np.stack([start[one], end[one], apex[one], apex[other]])
    return quads, np.stack([one // 3, other // 3]), np.stack([start[single], end[single]])


def _in_circle(x: Array, y: Array) -> tuple[Array, Array]:
    """A determinant that is positive where d lies inside the circle of abc, for quadrilaterals at x, y (4, E), and the
    square of the largest distance from d.

    It is twice the area of abc times the power of d: squared radius less squared distance from the centre.
    """
    (ax, bx, cx), (ay, by, cy) = x[:3] - x[3], y[:3] - y[3]
    a, b, c = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    determinant = a * (bx * cy - by * cx) + b * (cx * ay - cy * ax) + c * (ax * by - ay * bx)
    return determinant, np.maximum(np.maximum(a, b), c)


def on_one_wall(walls: Indices) -> Mask:
    """Which of the polygons with nodes on `walls` (corners, E) have all of them on one and the same."""
    same: Mask = (walls[0] > 0) & (walls == walls[0]).all(axis=0)
    return same


def _alone(beside: Indices, triangles: int) -> Mask:
    """Which of the edges with triangles `beside` (2, E) are the first of both of these: no two share a triangle."""
    number = np.arange(beside.shape[1])
    first = np.full(triangles, len(number))
    np.minimum.at(first, beside.ravel(), np.tile(number, 2))
    alone: Mask = (first[beside] == number).all(axis=0)
    return alone


def _is_convex(hull: Indices, x: Array, y: Array, walls: Indices, tie: float) -> bool:
    """Whether the edges (2, H) of the hull turn left at every node; along walls they may go straight on."""
    following = np.zeros(len(x), dtype=np.intp)
    following[hull[0]] = hull[1]
    corner = np.stack([*hull, following[hull[1]]])
    least = np.where((walls[corner] > 0).all(axis=0), -tie, tie)
    return bool((doubled_areas(x, y, *corner) > least).all())
