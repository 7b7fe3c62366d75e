"""Middle line of a gasket from an ASCII DXF file: LWPOLYLINE, LINE and ARC become one path.

Format: Autodesk, DXF Reference. Each value is a line with its group code in the line before it. x
is the radius, y the position along the axis. An arc is a corner with a fillet, where its tangents
cross; long ones are divided first.
"""

import cmath
import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from wm_drake.errors import input_error
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.text_files import read_text

LARGEST_DXF = 4 << 20
"""Largest file. [byte]"""

MOST_SEGMENTS = 60
"""Most segments of a path."""

SAME_PLACE = 1e-6
"""Distance within which ends of segments are the same place. [m]"""

SAME_DIRECTION = math.radians(1.0)
"""Angle within which an arc continues in the direction of its neighbour."""

LONGEST_ARC = math.radians(100.0)
"""Longest arc that becomes one corner."""

SMALLER = 1.0 - 1e-5
"""Factor of fillets, so that two of them fit between corners in spite of rounded numbers."""


class DxfLine(Frozen):
    """Middle line of the wall in a DXF file: x is the radius, y that of the gasket.

    Attributes:
        file: Name of the file, from the folder of the drawing.
        unit: Unit of its numbers.
        thickness: Wall thickness, the same everywhere.
        layer: Layer that has the line; "" for all layers.
        housing_end: Whether the rim at the housing is the end with the smaller or the larger y.
    """

    file: Path
    unit: Literal["mm", "cm", "m", "in"]
    thickness: Annotated[u.Length, Field(gt=0.0)]
    layer: str = ""
    housing_end: Literal["smaller y", "larger y"] = "smaller y"


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
    def reversed(self) -> "Segment":
        """Return the segment from its end to its begin."""
        return Segment(self.end, self.begin, -self.turn)

    @property
    def directions(self) -> tuple[complex, complex]:
        """Directions at both ends, of size 1."""
        chord = (self.end - self.begin) / abs(self.end - self.begin)
        half = cmath.exp(0.5j * self.turn)
        return chord / half, chord * half

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


def corners_of(line: DxfLine, folder: Path) -> list[tuple[float, float, float]]:
    """Return radius, y and fillet of the corners of a line. [m]

    Raises:
        InputError: the file is missing or no ASCII DXF, or its segments are no path.
    """
    path = folder / line.file
    try:
        segments = list(_segments(_entities(path), line))
        whole = _path(segments)
        if (whole[0].begin.imag > whole[-1].end.imag) == (line.housing_end == "smaller y"):
            whole = [segment.reversed for segment in whole[::-1]]
        return list(_corners([part for segment in whole for part in segment.parts()]))
    except ValueError as error:
        raise input_error(str(error), where=str(path)) from None


def _entities(path: Path) -> Iterator[list[tuple[int, str]]]:
    """Yield the group codes and values of each entity of a file, its kind first."""
    lines = [text.strip() for text in read_text(path, largest=LARGEST_DXF).splitlines()]
    pairs = []
    for number in range(0, len(lines) - 1, 2):
        if not lines[number].lstrip("-").isdecimal():
            raise ValueError(
                f"line {number + 1}: '{lines[number][:20]}' is no group code; allowed is ASCII DXF"
            )
        pairs.append((int(lines[number][:6]), lines[number + 1]))
    if (2, "ENTITIES") not in pairs:
        raise ValueError("has no section ENTITIES; allowed is ASCII DXF")
    entity: list[tuple[int, str]] = []
    for code, value in pairs[pairs.index((2, "ENTITIES")) + 1 :]:
        if code == 0:
            if entity:
                yield entity
            if value == "ENDSEC":
                return
            entity = []
        entity.append((code, value))
    raise ValueError("ends within the section ENTITIES")


def _segments(entities: Iterator[list[tuple[int, str]]], line: DxfLine) -> Iterator[Segment]:
    """Yield the segments of the entities of a layer."""
    metres = u.to_base(1.0, line.unit)
    for entity in entities:
        kind = entity[0][1]
        if line.layer and (8, line.layer) not in entity:
            continue
        if kind == "LWPOLYLINE":
            yield from _polyline(entity, metres)
        elif kind == "LINE":
            ends = [complex(_number(entity, x), _number(entity, x + 10)) for x in (10, 11)]
            yield Segment(metres * ends[0], metres * ends[1], 0.0)
        elif kind == "ARC":
            centre = complex(_number(entity, 10), _number(entity, 20))
            angles = [math.radians(_number(entity, code)) for code in (50, 51)]
            begin, end = (centre + _number(entity, 40) * cmath.exp(1j * a) for a in angles)
            turn = (angles[1] - angles[0]) % (2.0 * math.pi)
            yield Segment(metres * begin, metres * end, turn)
        else:
            raise ValueError(
                f"has an entity {kind[:30]}; allowed are LWPOLYLINE, LINE and ARC, and with layer "
                "only those of one layer"
            )


def _number(entity: Sequence[tuple[int, str]], code: int) -> float:
    """Return the first number of a group code of an entity."""
    kind = entity[0][1]
    for group, text in entity:
        if group == code:
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise ValueError(f"{kind}: group {code} is '{text[:20]}', not a number")
            return value
    raise ValueError(f"{kind}: has no group {code}")


def _polyline(entity: Sequence[tuple[int, str]], metres: float) -> Iterator[Segment]:
    """Yield the segments of a LWPOLYLINE; a bulge is the tangent of a quarter of the turn."""
    if any(code == 70 and text.isdecimal() and int(text[:9]) & 1 for code, text in entity):
        raise ValueError("LWPOLYLINE: is closed; allowed is the open middle line of the wall")
    starts = [number for number, (code, _) in enumerate(entity) if code == 10]
    vertices = []
    for begin, end in itertools.pairwise([*starts, len(entity)]):
        vertex = [entity[0], *entity[begin:end]]
        bulge = _number(vertex, 42) if any(code == 42 for code, _ in vertex) else 0.0
        place = complex(_number(vertex, 10), _number(vertex, 20))
        vertices.append((metres * place, 4.0 * math.atan(bulge)))
    for (begin_at, turn), (end_at, _) in itertools.pairwise(vertices):
        yield Segment(begin_at, end_at, turn)


def _path(segments: list[Segment]) -> list[Segment]:
    """Return segments one after the other, from one free end to the other."""
    if not 0 < len(segments) <= MOST_SEGMENTS:
        raise ValueError(f"has {len(segments)} lines and arcs; allowed are 1 to {MOST_SEGMENTS}")
    for segment in segments:
        if abs(segment.end - segment.begin) <= SAME_PLACE:
            raise ValueError(f"a line or arc at {_text(segment.begin)} has no length, or is closed")
    path, rest = [segments[0]], segments[1:]
    while rest:
        for segment in [*rest, *(each.reversed for each in rest)]:
            if abs(segment.begin - path[-1].end) <= SAME_PLACE:
                path.append(segment)
            elif abs(segment.end - path[0].begin) <= SAME_PLACE:
                path.insert(0, segment)
            else:
                continue
            rest.remove(segment if segment in rest else segment.reversed)
            break
        else:
            raise ValueError(
                f"the line or arc from {_text(rest[0].begin)} to {_text(rest[0].end)} does not "
                f"continue the others; allowed is one path, its ends within {1e3 * SAME_PLACE:g} mm"
            )
    return path


def _corners(parts: list[Segment]) -> Iterator[tuple[float, float, float]]:
    """Yield radius, y and fillet of the corners of a path. [m]"""
    for before, after in itertools.pairwise(parts):
        is_bent = before.turn != 0.0 or after.turn != 0.0
        turn = abs(cmath.phase(after.directions[0] / before.directions[1]))
        if is_bent and turn > SAME_DIRECTION:
            raise ValueError(
                f"the path turns by {math.degrees(turn):.3g} degrees where an arc ends at "
                f"{_text(before.end)}; allowed are arcs that continue in the direction of the line"
            )
    first, last = parts[0].begin, parts[-1].end
    yield first.real, first.imag, 0.0
    for number, part in enumerate(parts):
        if part.turn:
            size = abs(part.end - part.begin)
            corner = part.begin + part.directions[0] * 0.5 * size / math.cos(0.5 * part.turn)
            fillet = SMALLER * 0.5 * size / math.sin(0.5 * abs(part.turn))
            yield corner.real, corner.imag, fillet
        elif number + 1 < len(parts) and not parts[number + 1].turn:
            yield part.end.real, part.end.imag, 0.0
    yield last.real, last.imag, 0.0


def _text(place: complex) -> str:
    return f"({1e3 * place.real:.6g}, {1e3 * place.imag:.6g}) mm"
