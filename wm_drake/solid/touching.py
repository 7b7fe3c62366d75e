"""Where the faces of a wall touch: points of a face that are inside an opposite part of the wall.

Own derivation. Each column of nodes gives two curves in the plane of radius ρ = sqrt(x^2 + z^2) and
y, one for each face of the wall: cubic splines of Catmull and Rom through its nodes, which have no
corners. A point x_s of a face has the gap g from the nearest point x(σ) of an opposite face with
outward normal n and tangent x' = dx/dσ:

    g = n · (x_s - x(σ)),   x' · (x_s - x(σ)) = 0

A point is opposite if the outward normals point at each other and the wall between is longer than
`APART` thicknesses. A cut is compared with itself: sliding along the circumference does not change
what is opposite.
"""

from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.parameters.types import FloatArray
from wm_drake.solid.mesh import Ring

APART = 2.0
"""Length of wall between parts that may touch, in thicknesses, as in the check of a drawing."""

DEEPEST = 0.6
"""Depth up to which a point counts as inside the wall, in thicknesses: it is nearer to the face it
came through than to the other."""

SPLINE = 0.5 * np.array(
    [[0.0, -1.0, 2.0, -1.0], [2.0, 0.0, -5.0, 3.0], [0.0, 1.0, 4.0, -3.0], [0.0, 0.0, -1.0, 1.0]]
)
"""Polynomials of Catmull and Rom: for each of four nodes, factors of 1, x, x^2, x^3."""

GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Points of a face between two nodes."""

COLUMN, FACE, PLACE, OTHER_FACE, OTHER_PLACE, DEPTH, AREA, THICKNESS = range(8)
"""Fields of a touching point: column, face and place along it; the same of the opposite point;
depth, area of the point, thickness of the wall. Places count nodes."""


@long_running
def write_spline(place, count, values):
    """Write factors of four nodes for value and two derivatives of a curve at a place.

    Args:
        place: Place along the curve, in nodes.
        count: Number of nodes of the curve, at least 4.
        values: Receives the factors. (3, 4)

    Returns:
        Number of the first node.
    """
    at = min(max(int(place), 0), count - 2)
    x = place - at
    for k in range(4):
        a, b, c, d = SPLINE[k]
        values[0, k] = a + x * (b + x * (c + x * d))
        values[1, k] = b + x * (2.0 * c + x * 3.0 * d)
        values[2, k] = 2.0 * c + 6.0 * x * d
    for row in values:  # beyond an end the curve goes on straight
        if at == 0:
            row[0], row[1], row[2], row[3] = row[1] + 2.0 * row[0], row[2] - row[0], row[3], 0.0
        elif at == count - 2:
            row[0], row[1], row[2], row[3] = 0.0, row[0], row[1] - row[3], row[2] + 2.0 * row[3]
    return min(max(at - 1, 0), count - 4)


@long_running
def on_curve(curve, place, values, points):
    """Write value and two derivatives of a curve at a place. (3, 2)"""
    first = write_spline(place, len(curve), values)
    for row in range(3):
        for i in range(2):
            points[row, i] = 0.0
            for k in range(4):
                points[row, i] += values[row, k] * curve[first + k, i]


@long_running
def _nearest(curve, at, point, values, points):
    """Return the place of the point of a curve that is nearest to a point; -1 without one.

    Args:
        curve: Nodes of the curve. (n, 2)
        at: Nearest node.
        point: The point. (2,)
        values, points: As in `on_curve`; at the end those of the place.
    """
    low, high = max(at - 1.0, 0.0), min(at + 1.0, len(curve) - 1.0)
    for end, sign in ((low, -1.0), (high, 1.0)):
        on_curve(curve, end, values, points)
        if sign * ((point - points[0]) @ points[1]) > 0.0:
            return -1.0
    place = float(at)
    for _ in range(60):
        on_curve(curve, place, values, points)
        away = point - points[0]
        slope = away @ points[1]
        if slope > 0.0:
            low = place
        else:
            high = place
        fall = points[1] @ points[1] - away @ points[2]
        following = place + slope / fall if fall > 0.0 else -1.0
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - place) < 1e-13 * len(curve):
            break
        place = following
    return place


@long_running
def outward_normal(face, tangent):
    """Return the unit normal out of the wall. (2,)"""
    scale = (2 * face - 1) / np.sqrt(tangent[0] ** 2 + tangent[1] ** 2)
    return np.array([-scale * tangent[1], scale * tangent[0]])


@long_running
def write_curves(positions, u, numbers, curves):
    """Write radius and y of the nodes of the faces. (columns, 2, n, 2) [m]"""
    for column in range(numbers.shape[0]):
        for face in range(2):
            for k in range(numbers.shape[2]):
                node = numbers[column, face, k]
                x, y, z = positions[node] + u[node]
                curves[column, face, k, 0], curves[column, face, k, 1] = np.hypot(x, z), y


@long_running
def find_touching(curves, along, thickness, areas, touching):
    """Write the points of the faces that are inside an opposite part of the wall.

    Args:
        curves: Radius and y of the nodes of the faces. (columns, 2, n, 2) [m]
        along: Length of the wall from its rim to each node. (n,) [m]
        thickness: Thickness at each node. (n,) [m]
        areas: Area of each point of a face. (columns, 2, points) [m^2]
        touching: Receives the touching points; their fields are listed above. (2 areas, 8)

    Returns:
        Number of touching points.
    """
    count, values, points = 0, np.zeros((3, 4)), np.zeros((3, 2))
    for column, face, other, number in np.ndindex(len(curves), 2, 2, areas.shape[2]):
        place, curve = number // 2 + GAUSS[number % 2], curves[column, other]
        node = int(place)
        on_curve(curves[column, face], place, values, points)
        point, normal = points[0].copy(), outward_normal(face, points[1])
        near = _nearest_node(curve, point, np.abs(along - along[node]) > APART * thickness[node])
        if near < 0:
            continue
        opposite = _nearest(curve, near, point, values, points)
        outward = outward_normal(other, points[1])
        depth, wall = outward @ (points[0] - point), 0.5 * (thickness[node] + thickness[near])
        is_inside = opposite >= 0.0 and 0.0 < depth < DEEPEST * wall
        if is_inside and normal @ outward < 0.0:
            row, area = touching[count], areas[column, face, number]
            row[COLUMN], row[FACE], row[PLACE] = column, face, place
            row[OTHER_FACE], row[OTHER_PLACE] = other, opposite
            row[DEPTH], row[AREA], row[THICKNESS] = depth, area, wall
            count += 1
    return count


@long_running
def _nearest_node(curve, point, is_apart):
    """Return the node of a part of a curve that is nearest to a point; -1 if the part is empty."""
    nearest, least = -1, np.inf
    for k in range(len(curve)):
        if is_apart[k]:
            distance = (curve[k, 0] - point[0]) ** 2 + (curve[k, 1] - point[1]) ** 2
            if distance < least:
                nearest, least = k, distance
    return nearest


@dataclass(frozen=True)
class Touching:
    """Touching points of a deformed ring.

    Attributes:
        rows: Their fields. (n, 8)
        curves: Radius and y of the nodes of the faces. (columns, 2, n, 2) [m]
    """

    rows: FloatArray
    curves: FloatArray

    @property
    def places(self) -> FloatArray:
        """Radius and y of the touching points. (n, 2) [m]"""
        values, points = np.zeros((3, 4)), np.zeros((3, 2))
        places = np.zeros((len(self.rows), 2))
        for place, row in zip(places, self.rows, strict=True):
            curve = self.curves[int(row[COLUMN]), int(row[FACE])]
            on_curve(curve, row[PLACE], values, points)
            place[:] = points[0]
        return places

    def in_column(self, column: int) -> "Touching":
        """Return the touching points of a column of nodes."""
        return Touching(self.rows[self.rows[:, COLUMN] == column], self.curves)

    @property
    def depth(self) -> float:
        """Largest depth of a point inside the wall, in thicknesses; 0 if nothing touches."""
        return float(np.max(self.rows[:, DEPTH] / self.rows[:, THICKNESS], initial=0.0))


class Faces:
    """Faces of the wall of a ring, to find where they touch.

    Attributes:
        numbers: Numbers of the nodes of both faces. (columns, 2, n)
    """

    def __init__(self, ring: Ring) -> None:
        """Divide the faces into points."""
        self._ring = ring
        self.numbers = np.ascontiguousarray(ring.grid[:, :, [0, 2]].transpose(1, 2, 0))
        drawn = ring.positions[ring.grid[:, 0]]
        self._thickness = np.linalg.norm(drawn[:, 2] - drawn[:, 0], axis=-1)
        steps = np.linalg.norm(np.diff(drawn[:, 1], axis=0), axis=1)
        self._along = np.append(0.0, np.cumsum(steps))
        self._areas = self._drawn_areas()

    def _drawn_areas(self) -> FloatArray:
        """Return half the area of each point of the faces as drawn. (columns, 2, points) [m^2]"""
        curves = self._curves(np.zeros_like(self._ring.positions))
        values, points = np.zeros((3, 4)), np.zeros((3, 2))
        areas = np.zeros((*curves.shape[:2], 2 * (curves.shape[2] - 1)))
        for column, face, number in np.ndindex(areas.shape):
            place = number // 2 + GAUSS[number % 2]
            on_curve(curves[column, face], place, values, points)
            areas[column, face, number] = points[0, 0] * np.linalg.norm(points[1])
        return 0.25 * areas * self._ring.angles[:, None, None]

    def _curves(self, u: FloatArray) -> FloatArray:
        curves = np.zeros((*self.numbers.shape, 2))
        write_curves(self._ring.positions, u, self.numbers, curves)
        return curves

    def touching(self, u: FloatArray) -> Touching:
        """Return the touching points at displacements of the nodes (nodes, 3) [m]."""
        curves = self._curves(u)
        rows = np.zeros((2 * self._areas.size, 8))
        count = find_touching(curves, self._along, self._thickness, self._areas, rows)
        return Touching(rows[:count], curves)
