"""Path of lines and arcs in a plane through the axis, and the corners with fillets that make it.

A place is radius + i y. An arc is a corner with a fillet, where its tangents cross; long ones are
divided first.
"""

import cmath
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

SAME_PLACE = 1e-5
"""Distance within which ends of segments are the same place, and arcs are a curve. [m] CAD programs
write three or four decimals."""

SAME_DIRECTION = math.radians(1.0)
"""Angle within which an arc continues in the direction of its neighbour."""

LONGEST_ARC = math.radians(100.0)
"""Longest arc that becomes one corner."""

MOST_HALVINGS = 12
"""Largest number of times that a piece of a curve is halved."""

Corner: TypeAlias = tuple[float, float, float]
"""Radius, y and fillet of a corner. [m]"""

Curve: TypeAlias = Callable[[float], tuple[complex, complex]]
"""Place on a curve [m] and direction there, of size 1, over a parameter."""


class Segment(NamedTuple):
    """A line or an arc.

    Attributes:
        begin, end: Its ends, radius + i y. [m]
        turn: Angle by which it turns counter-clockwise; 0 for a line. [rad]
    """

    begin: complex
    end: complex
    turn: float

    @property
    def size(self) -> float:
        """Distance of its ends. [m]"""
        return abs(self.end - self.begin)

    @property
    def rise(self) -> float:
        """Distance of the middle of the arc from the chord. [m]"""
        return 0.5 * self.size * math.tan(0.25 * abs(self.turn))

    @property
    def reversed(self) -> "Segment":
        """Return the segment from its end to its begin."""
        return Segment(self.end, self.begin, -self.turn)

    @property
    def directions(self) -> tuple[complex, complex]:
        """Directions at both ends, of size 1."""
        chord = (self.end - self.begin) / self.size
        half = cmath.exp(0.5j * self.turn)
        return chord / half, chord * half

    def distance(self, place: complex) -> float:
        """Return the distance of a place from the line or circle. [m]"""
        if self.rise <= 1e-3 * SAME_PLACE:
            return abs(((place - self.begin) / self.directions[0]).imag)
        radius = 0.5 * self.size / math.sin(0.5 * self.turn)
        centre = self.begin + 1j * radius * self.directions[0]
        return abs(abs(place - centre) - abs(radius))

    def parts(self) -> "Iterator[Segment]":
        """Yield arcs of up to `LONGEST_ARC` that follow each other."""
        count = max(1, math.ceil(abs(self.turn) / LONGEST_ARC))
        places = [self.begin, *[self.end] * count]
        if count > 1:
            step = cmath.exp(1j * self.turn / count)
            centre = (self.end - self.begin * step**count) / (1.0 - step**count)
            places[1:-1] = [centre + (self.begin - centre) * step**k for k in range(1, count)]
        for begin, end in itertools.pairwise(places):
            yield Segment(begin, end, self.turn / count)


def arcs_along(curve: Curve, begin: float, end: float, halvings: int = 0) -> Iterator[Segment]:
    """Yield arcs within `SAME_PLACE` of a curve, each in the direction of the one before.

    Args:
        curve: A smooth curve.
        begin, end: Its parameters at the ends.
        halvings: Number of times that this piece was halved.
    """
    pair = _biarc(*curve(begin), *curve(end))
    between = (curve(begin + part * (end - begin))[0] for part in (0.2, 0.4, 0.6, 0.8))
    if halvings == MOST_HALVINGS or all(
        min((arc.distance(place) for arc in pair), default=0.0) <= SAME_PLACE for place in between
    ):
        yield from pair
        return
    middle = 0.5 * (begin + end)
    yield from arcs_along(curve, begin, middle, halvings + 1)
    yield from arcs_along(curve, middle, end, halvings + 1)


def _biarc(begin: complex, first: complex, end: complex, last: complex) -> list[Segment]:
    """Return two arcs with given ends and directions; both end tangents are equally long."""
    chord = end - begin
    both = 2.0 * (chord * (first + last).conjugate()).real
    apart = 2.0 * (1.0 - (first * last.conjugate()).real)
    square = abs(chord) ** 2
    length = 2.0 * square / (both + math.sqrt(both**2 + 4.0 * apart * square) or 1.0)
    middle = 0.5 * (begin + end + length * (first - last))
    pair = (begin, middle, first), (middle, end, None)
    return [
        Segment(a, b, 2.0 * cmath.phase((b - a) / at if at else last / (b - a)))
        for a, b, at in pair
        if a != b
    ]


def path_of(segments: Sequence[Segment], most: int) -> list[Segment]:
    """Return segments one after the other, from one free end to the other.

    Segments without length and those that are drawn twice are left out; ends within `SAME_PLACE`
    become the same place.

    Args:
        segments: Lines and arcs in any order and direction.
        most: Largest number of them.

    Raises:
        ValueError: they are no single open path.
    """
    rest = list(_distinct(segments))
    if not 0 < len(rest) <= most:
        raise ValueError(f"has {len(rest)} lines and arcs; allowed are 1 to {most}")
    path = [rest.pop(0)]
    while rest:
        for index, segment in enumerate(rest):
            for way in (segment, segment.reversed):
                if abs(way.begin - path[-1].end) <= SAME_PLACE:
                    path.append(way._replace(begin=path[-1].end))
                    break
                if abs(way.end - path[0].begin) <= SAME_PLACE:
                    path.insert(0, way._replace(end=path[0].begin))
                    break
            else:
                continue
            del rest[index]
            break
        else:
            raise ValueError(
                f"the line or arc from {text(rest[0].begin)} to {text(rest[0].end)} does not "
                f"continue the others; allowed is one path, its ends within {1e3 * SAME_PLACE:g} mm"
            )
    if abs(path[0].begin - path[-1].end) <= SAME_PLACE:
        raise ValueError(
            f"the path is closed at {text(path[0].begin)}; allowed is the open middle line of the "
            "wall"
        )
    return path


def _distinct(segments: Sequence[Segment]) -> Iterator[Segment]:
    """Yield segments that have a length, each once; arcs that are nearly straight as lines."""
    kept: dict[tuple[int, int], list[Segment]] = {}
    for given in segments:
        segment = given if given.rise > 0.1 * SAME_PLACE else given._replace(turn=0.0)
        if max(segment.size, segment.rise) <= SAME_PLACE:
            continue
        middle = 0.5 * (segment.begin + segment.end)
        cell = tuple(round(part / (100.0 * SAME_PLACE)) for part in (middle.real, middle.imag))
        near = [
            other
            for i, j in itertools.product((-1, 0, 1), repeat=2)
            for other in kept.get((cell[0] + i, cell[1] + j), [])
        ]
        if not any(_is_same(segment, way) for other in near for way in (other, other.reversed)):
            kept.setdefault((cell[0], cell[1]), []).append(segment)
            yield segment


def _is_same(one: Segment, other: Segment) -> bool:
    apart = (one.begin - other.begin, one.end - other.end, one.size * (one.turn - other.turn))
    return max(map(abs, apart)) <= SAME_PLACE


def corners_of(path: Sequence[Segment]) -> list[Corner]:
    """Return the corners of a path.

    Raises:
        ValueError: an arc does not continue in the direction of its neighbour.
    """
    parts = [part for segment in path for part in segment.parts()]
    for before, after in itertools.pairwise(parts):
        turn = abs(cmath.phase(after.directions[0] / before.directions[1]))
        if (before.turn or after.turn) and turn > SAME_DIRECTION:
            raise ValueError(
                f"the path turns by {math.degrees(turn):.3g} degrees where an arc ends at "
                f"{text(before.end)}; allowed are arcs that continue in the direction of the line"
            )
    return _fitted([(parts[0].begin, 0.0), *_inner_corners(parts), (parts[-1].end, 0.0)])


def _inner_corners(parts: Sequence[Segment]) -> Iterator[tuple[complex, float]]:
    """Yield place and fillet of the corners between both ends of a path. [m]"""
    for part, after in itertools.zip_longest(parts, parts[1:]):
        if part.turn:
            along = part.directions[0] * 0.5 * part.size / math.cos(0.5 * part.turn)
            yield part.begin + along, 0.5 * part.size / math.sin(0.5 * abs(part.turn))
        elif after is not None and not after.turn:
            yield part.end, 0.0


def _fitted(corners: Sequence[tuple[complex, float]]) -> list[Corner]:
    """Return corners whose fillets fit between them in spite of rounded numbers."""
    places, fillets = zip(*corners, strict=True)
    sides = [after - before for before, after in itertools.pairwise(places)]
    turns = [abs(cmath.phase(b / a)) if a and b else 0.0 for a, b in itertools.pairwise(sides)]
    cuts = [r * math.tan(0.5 * turn) for r, turn in zip(fillets, [0.0, *turns, 0.0], strict=True)]
    room = [
        min(1.0, abs(side) / (left + right) if left + right else 1.0)
        for side, (left, right) in zip(sides, itertools.pairwise(cuts), strict=True)
    ]
    least = [1.0, *map(min, itertools.pairwise(room)), 1.0]
    return [
        (place.real, place.imag, fillet * factor)
        for place, fillet, factor in zip(places, fillets, least, strict=True)
    ]


def text(place: complex) -> str:
    """Return a place for messages."""
    x, y = (round(1e3 * part, 4) + 0.0 for part in (place.real, place.imag))
    return f"({x:.6g}, {y:.6g}) mm"
