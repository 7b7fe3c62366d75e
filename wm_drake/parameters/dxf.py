"""Middle line of a gasket from a DXF file: the lines and curves of a layer become one path.

The package ezdxf reads the file; it is an extra (`wm-drake[gasket]`). x is the radius, y the
position along the axis. Splines and ellipses become arcs within 0.01 mm.
"""

import io
import itertools
import logging
import math
import unicodedata
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from wm_drake.errors import InputNotice, Problem, input_error, nearest_names, shortened
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.meridian_path import (
    SAME_PLACE,
    Corner,
    Segment,
    arcs_along,
    corners_of,
    path_of,
    text,
)
from wm_drake.parameters.text_files import check_regular

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfgfx import DXFGraphic
    from ezdxf.math import BSpline, Vec3

LARGEST_DXF = 32 << 20
"""Largest file. [byte]"""

MOST_CORNERS = 300
"""Most lines and arcs of a path, and most corners of a meridian."""

MOST_ENTITIES = 50_000
"""Most entities of a file, those of its blocks counted at each place."""

DEEPEST_BLOCK = 16
"""Most blocks within each other."""

IGNORED = {
    "ACAD_TABLE", "ARC_DIMENSION", "ATTDEF", "ATTRIB", "DIMENSION", "HATCH", "IMAGE", "INSERT",
    "LARGE_RADIAL_DIMENSION", "LEADER", "LIGHT", "MLEADER", "MPOLYGON", "MTEXT", "MULTILEADER",
    "OLE2FRAME", "POINT", "RAY", "SHAPE", "SOLID", "TEXT", "TOLERANCE", "TRACE", "UNDERLAY",
    "VIEWPORT", "WIPEOUT", "XLINE",
}  # fmt: skip
"""Entities that are no lines of a wall: text, dimensions, hatches, symbols, construction lines."""


class DxfLine(Frozen):
    """Middle line of the wall in a DXF file: x is the radius, y that of the gasket.

    Attributes:
        file: Name of the file, from the folder of the drawing.
        unit: Unit of its numbers.
        thickness: Wall thickness, the same everywhere.
        layer: Layer that has the line, in capitals or not; "" for all layers that are shown.
        housing_end: Which end of the line is the rim at the housing.
    """

    file: Path
    unit: Literal["mm", "cm", "m", "in"]
    thickness: Annotated[u.Length, Field(gt=0.0)]
    layer: str = ""
    housing_end: Literal["smaller y", "larger y", "smaller radius", "larger radius"] = "smaller y"


class _UnusableError(ValueError):
    """An entity that is no part of a middle line; its text says why."""


def corners_of_line(line: DxfLine, folder: Path) -> list[Corner]:
    """Return the corners of a line.

    Raises:
        InputError: the file is missing or no DXF, ezdxf is not installed, or its lines are no path.
    """
    path = folder / line.file
    check_regular(path, largest=LARGEST_DXF)
    try:
        path_of_wall = _path(_read(path, line), line)
        return corners_of(_from_housing(path_of_wall, line.housing_end))
    except ImportError:
        message = "needs the package ezdxf: pip install 'wm-drake[gasket]'"
        raise input_error(message, where=str(path)) from None
    except ValueError as error:
        raise input_error(str(error), where=str(path)) from None


def _read(path: Path, line: DxfLine) -> "Drawing":
    """Return the content of a file; one that has to be repaired gets a notice."""
    from ezdxf import recover
    from ezdxf.filemanagement import read, readfile

    logging.getLogger("ezdxf").setLevel(logging.CRITICAL)  # its remarks are in our messages
    content = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
    if content.startswith(b"AC10"):
        raise ValueError("is a DWG file; allowed is DXF: save it as DXF in the CAD program")
    is_text = not content.startswith(b"AutoCAD Binary DXF")
    content = _of_one_version(content.lstrip()) if is_text else content
    try:
        drawing = read(_decoded(content)) if is_text else readfile(path)
    except Exception as error:  # of many kinds on a damaged file
        damage = _reason(error)
        try:
            drawing, audit = recover.read(io.BytesIO(content))
            is_whole = not audit.errors and len(drawing.modelspace()) > 0
        except Exception:
            is_whole = False
        if not is_whole:
            message = f"cannot be read by ezdxf ({damage}); allowed is DXF, in text or binary"
            raise ValueError(message) from None
        _notify(path, f"is damaged ({damage}) and was repaired: check the wall in the pictures")
    if b"$INSUNITS" in content:  # ezdxf has metres for files that have none
        _compare_unit(drawing.header.get("$INSUNITS"), line, path)
    return drawing


def _decoded(content: bytes) -> io.StringIO:
    """Return a DXF file in text, decoded as its header says."""
    from ezdxf.filemanagement import dxf_stream_info

    encoding = dxf_stream_info(io.StringIO(content.decode(errors="ignore"))).encoding
    return io.StringIO(content.decode(encoding, errors="surrogateescape"), newline=None)


_MARKERS = {b"LWPOLYLINE": b"AcDbPolyline", b"SPLINE": b"AcDbSpline"}
"""Entities that R12 does not have, and the marker without which ezdxf does not read them."""


def _of_one_version(content: bytes) -> bytes:
    """Return a DXF file in text, as one of R2000 if R12 does not have all its entities.

    Simple programs write them without markers, or without a header or with that of R12: then ezdxf
    drops their layer and extrusion.
    """
    lines = [line.strip() for line in content.splitlines()]
    tags = list(zip(lines[::2], lines[1::2], strict=False))
    starts = [index for index, (code, _) in enumerate(tags) if code == b"0"]
    markers = {begin: tags[begin:end] for begin, end in itertools.pairwise([*starts, len(tags)])
               if tags[begin][1] in _MARKERS}  # fmt: skip
    if not markers:
        return content
    for begin, entity in reversed(markers.items()):
        marker = _MARKERS[entity[0][1]]
        if (b"100", marker) not in entity:
            tags[begin + 1 : begin + 1] = [(b"100", b"AcDbEntity"), (b"100", marker)]
    version = [(b"9", b"$ACADVER"), (b"1", b"AC1015")]
    if version[0] not in tags:
        tags[:0] = [(b"0", b"SECTION"), (b"2", b"HEADER"), *version, (b"0", b"ENDSEC")]
    at = tags.index(version[0]) + 1
    if at < len(tags) and tags[at][1] < b"AC1012":
        tags[at] = version[1]
    return b"\n".join(itertools.chain.from_iterable(tags)) + b"\n"


def _reason(error: Exception) -> str:
    words = " ".join(str(error).removeprefix("DXFStructureError:").split())
    return shortened(words.rstrip(".") or type(error).__name__, 120)


def _compare_unit(code: Any, line: DxfLine, path: Path) -> None:
    """Issue a notice if a file names another unit than its gasket drawing."""
    from ezdxf import units

    named = units.decode(code) if code in range(25) else None
    if named not in (None, line.unit):
        _notify(
            path,
            f"says that its unit is {named} ($INSUNITS {code}); the gasket drawing says "
            f"{line.unit}, which is used",
            "dxf.unit",
        )


def _notify(path: Path, message: str, key: str = "") -> None:
    warnings.warn(str(Problem(str(path), key, message)), InputNotice, stacklevel=3)


def _path(drawing: "Drawing", line: DxfLine) -> list[Segment]:
    """Return the lines and arcs of the layer of a line, one after the other."""
    plane, segments = _Plane(u.to_base(1.0, line.unit)), list[Segment]()
    kinds, layers = Counter[str](), set[str]()
    for entity in _shown(drawing, line.layer):
        kind, layer = entity.dxftype(), _layer(entity)
        kinds[kind] += 1
        if kind in IGNORED:
            continue
        layers.add(layer)
        if not line.layer or _folded(layer) == _folded(line.layer):
            segments += _segments_of(entity, plane)
    if line.layer and not segments:
        raise ValueError(
            f"has no line or arc on the layer '{line.layer}'{nearest_names(line.layer, layers)}"
        )
    try:
        if not segments and kinds:
            listed = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common(6))
            raise ValueError(f"has no line or arc of a wall, only {listed}")
        path = path_of(segments, MOST_CORNERS)
    except ValueError as error:
        raise ValueError(f"{error}{_choice(layers, line)}") from None
    if min(min(part.begin.real, part.end.real) for part in path) <= 0.0:
        raise ValueError(
            f"the path from {text(path[0].begin)} to {text(path[-1].end)} reaches x = 0; x is the "
            "radius: allowed is a line with x above 0"
        )
    return path


def _layer(entity: "DXFGraphic") -> str:
    """Return the layer of an entity; "0" if ezdxf does not know its kind."""
    return str(entity.dxf.get("layer", "0")) if entity.dxf.is_supported("layer") else "0"


def _folded(layer: str) -> str:
    """Return the name of a layer as names are compared: without capitals."""
    return unicodedata.normalize("NFC", layer).casefold()


def _choice(layers: set[str], line: DxfLine) -> str:
    if line.layer or len(layers) < 2:
        return ""
    return f"; dxf.layer chooses one of the layers {', '.join(sorted(layers))}"


def _from_housing(path: list[Segment], end: str) -> list[Segment]:
    """Return a path from the rim at the housing."""
    which, name = end.split()
    ends = path[0].begin, path[-1].end
    first, last = (place.imag if name == "y" else place.real for place in ends)
    if abs(first - last) <= SAME_PLACE:
        raise ValueError(
            f"both ends, {text(ends[0])} and {text(ends[1])}, have the same {name}; "
            "dxf.housing_end needs smaller or larger " + ("radius" if name == "y" else "y")
        )
    is_reversed = (first > last) == (which == "smaller")
    return [segment.reversed for segment in path[::-1]] if is_reversed else path


def _shown(drawing: "Drawing", layer: str) -> Iterator["DXFGraphic"]:
    """Yield the entities of the model and its blocks; those of hidden layers only with a layer."""
    layers = [] if layer else list(drawing.layers)
    frozen = {_folded(each.dxf.name) for each in layers if each.is_frozen()}
    off = {_folded(each.dxf.name) for each in layers if each.is_off()}

    def is_shown(entity: "DXFGraphic") -> bool:
        hidden = frozen if entity.dxftype() == "INSERT" else frozen | off
        is_drawn = not (entity.dxf.is_supported("invisible") and entity.dxf.get("invisible"))
        return is_drawn and _folded(_layer(entity)) not in hidden

    for count, entity in enumerate(_exploded(drawing.modelspace(), is_shown)):
        if count == MOST_ENTITIES:
            raise ValueError(f"has too many entities; allowed are up to {MOST_ENTITIES}")
        yield entity


def _exploded(
    entities: Iterable["DXFGraphic"], is_shown: Callable[["DXFGraphic"], bool], depth: int = 0
) -> Iterator["DXFGraphic"]:
    """Yield entities and, after each INSERT, what is in its block, at its place."""
    for entity in filter(is_shown, entities):
        yield entity
        if entity.dxftype() == "INSERT":
            if depth == DEEPEST_BLOCK:
                raise ValueError(f"has blocks within blocks; allowed are up to {DEEPEST_BLOCK}")
            yield from _exploded(_content(entity), is_shown, depth + 1)


def _content(insert: Any) -> Iterator["DXFGraphic"]:
    """Yield the content of a block at one place; an array as its places.

    Entities on layer 0 of a block are on the layer of its INSERT.
    """
    name = insert.dxf.get("name", "")

    def refuse(entity: "DXFGraphic", reason: str) -> None:
        if entity.dxftype() not in IGNORED:
            raise _UnusableError(f"{_named(entity)} of block '{name}' cannot be placed: {reason}")

    with _readable(f"block '{name}'"):
        if insert.is_xref():
            raise _UnusableError(f"block '{name}' is in another file; bind it in the CAD program")
        if insert.mcount > 1:
            yield from insert.multi_insert()
            return
        for part in insert.virtual_entities(skipped_entity_callback=refuse):
            if _layer(part) == "0" and part.dxf.is_supported("layer"):
                part.dxf.layer = insert.dxf.layer
            yield part


@contextmanager
def _readable(what: str) -> Iterator[None]:
    """Say what cannot be read if the block raises an error of the library."""
    try:
        yield
    except (_UnusableError, GeneratorExit):
        raise
    except Exception as error:  # of many kinds on odd numbers
        raise _UnusableError(f"{what} cannot be read by ezdxf ({_reason(error)})") from None


class _Plane:
    """Plane of a drawing, parallel to x and y at the height of its first point."""

    def __init__(self, metres: float) -> None:
        """Store the unit of the numbers. [m]"""
        self.metres = metres
        self._height: float | None = None

    def places(self, points: Iterable["Vec3"], entity: "DXFGraphic") -> list[complex]:
        """Return points as radius + i y [m], of an entity that must be in the plane."""
        corners = list(points)
        if not all(math.isfinite(number) for point in corners for number in point.xyz):
            raise _UnusableError(f"{_named(entity)} has a coordinate that is not a number")
        for point in corners:
            height = self.metres * point.z
            self._height = height if self._height is None else self._height
            if abs(height - self._height) > SAME_PLACE:
                raise _UnusableError(
                    f"{_named(entity)} leaves the plane of x and y: z is {1e3 * height:.6g} mm "
                    f"there, {1e3 * self._height:.6g} mm elsewhere; allowed is a flat drawing"
                )
        return [self.metres * complex(point.x, point.y) for point in corners]


def _segments_of(entity: "DXFGraphic", plane: _Plane) -> list[Segment]:
    """Return the lines and arcs of an entity, without a line on the axis."""
    read = _READERS.get(entity.dxftype())
    if read is None:
        raise ValueError(
            f"has a {_named(entity)}; allowed are {', '.join(_READERS)} and blocks of them, open "
            "and flat; text, dimensions and hatches are passed over, and dxf.layer leaves out "
            "other layers"
        )
    with _readable(_named(entity)):
        return [each for each in read(entity, plane) if not _is_axis(each)]


def _is_axis(segment: Segment) -> bool:
    ends = (segment.begin, segment.end)
    return not segment.turn and all(abs(place.real) <= SAME_PLACE for place in ends)


def _named(entity: "DXFGraphic") -> str:
    return f"{entity.dxftype()[:30]} on layer '{_layer(entity)[:60]}'"


def _side(entity: "DXFGraphic") -> float:
    """Return 1 for an entity seen from above, -1 from below, as after mirroring."""
    normal = entity.dxf.get("extrusion", (0.0, 0.0, 1.0))
    if abs(math.hypot(normal[0], normal[1])) > 1e-6 * abs(normal[2]):
        raise _UnusableError(
            f"{_named(entity)} leaves the plane of x and y: it has an extrusion along "
            f"({', '.join(f'{part:.3g}' for part in normal)}); allowed is a flat drawing"
        )
    return math.copysign(1.0, normal[2])


def _line(entity: Any, plane: _Plane) -> Iterator[Segment]:
    _check_complete(entity, "start", "end")
    begin, end = plane.places((entity.dxf.start, entity.dxf.end), entity)
    yield Segment(begin, end, 0.0)


def _arc(entity: Any, plane: _Plane) -> Iterator[Segment]:
    _check_complete(entity, "center", "radius", "start_angle", "end_angle")
    turn = math.radians((entity.dxf.end_angle - entity.dxf.start_angle) % 360.0)
    if not turn:
        raise _closed(entity)
    begin, end = plane.places((entity.start_point, entity.end_point), entity)
    yield Segment(begin, end, _side(entity) * turn)


def _lwpolyline(entity: Any, plane: _Plane) -> Iterator[Segment]:
    if entity.closed:
        raise _closed(entity)
    bulges = [bulge for (bulge,) in entity.get_points("b")]
    yield from _bulged(entity, plane, list(entity.vertices_in_wcs()), bulges)


def _polyline(entity: Any, plane: _Plane) -> Iterator[Segment]:
    if not (entity.is_2d_polyline or entity.is_3d_polyline):
        raise _UnusableError(f"{_named(entity)} is a mesh; allowed is a flat polyline")
    if entity.is_closed:
        raise _closed(entity)
    for vertex in entity.vertices:
        _check_complete(vertex, "location")
    vertices = [  # without those of the frame of a spline
        (point, vertex.dxf.get("bulge", 0.0) if entity.is_2d_polyline else 0.0)
        for point, vertex in zip(entity.points_in_wcs(), entity.vertices, strict=True)
        if not vertex.dxf.flags & vertex.SPLINE_FRAME_CONTROL_POINT
    ]
    yield from _bulged(entity, plane, *map(list, zip(*vertices, strict=True)))


def _bulged(
    entity: Any, plane: _Plane, points: list["Vec3"], bulges: list[float]
) -> Iterator[Segment]:
    """Yield the segments of a polyline; a bulge is the tangent of a quarter of the turn."""
    if not all(map(math.isfinite, bulges)):
        raise _UnusableError(f"{_named(entity)} has a bulge that is not a number")
    side = _side(entity) if any(bulges) else 1.0
    ends = itertools.pairwise(plane.places(points, entity))
    for (begin, end), bulge in zip(ends, bulges, strict=False):
        yield Segment(begin, end, side * 4.0 * math.atan(bulge))


def _ellipse(entity: Any, plane: _Plane) -> Iterator[Segment]:
    from ezdxf.math import BSpline

    _check_complete(entity, "center", "major_axis", "ratio")
    yield from _curved(entity, plane, BSpline.from_ellipse(entity.construction_tool()))


def _spline(entity: Any, plane: _Plane) -> Iterator[Segment]:
    if entity.closed:
        raise _closed(entity)
    yield from _curved(entity, plane, entity.construction_tool())


def _curved(entity: Any, plane: _Plane, spline: "BSpline") -> Iterator[Segment]:
    """Yield arcs along a spline, between each two knots."""
    plane.places(spline.control_points, entity)
    knots = sorted(set(spline.knots()[spline.degree : spline.count + 1]))

    def at(parameter: float) -> tuple[complex, complex]:
        place, along = (
            plane.metres * complex(*each.vec2) for each in spline.derivative(parameter, 1)
        )
        return place, along / abs(along)

    for begin, end in itertools.pairwise(knots):
        inside = 1e-9 * (end - begin)  # a kink has two directions at its knot
        yield from arcs_along(at, begin + inside, end - inside)


def _closed(entity: Any) -> _UnusableError:
    return _UnusableError(
        f"{_named(entity)} is closed; allowed is the open middle line of the wall"
    )


def _check_complete(entity: Any, *names: str) -> None:
    for name in names:
        if not entity.dxf.hasattr(name):
            raise _UnusableError(f"{_named(entity)} has no {name.replace('_', ' ')}")


_READERS: dict[str, Callable[[Any, _Plane], Iterable[Segment]]] = {
    "LINE": _line,
    "ARC": _arc,
    "LWPOLYLINE": _lwpolyline,
    "POLYLINE": _polyline,
    "SPLINE": _spline,
    "ELLIPSE": _ellipse,
}
