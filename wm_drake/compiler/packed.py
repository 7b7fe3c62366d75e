"""Named packed layouts: one declaration orders the numbers of a component in a flat array.

A layout is declared once, with a name and a kind for each field:

    SPRING = PackedLayout("SpringNumbers", p_ToA_T=VECTOR, preload=SCALAR, stiffness=CURVE)

It packs values by name (`pack`), and it generates a law (`read`) that returns the numbers which
begin at an index as a named tuple. Compiled laws and interpreted ones use the same reader. A field
is either of fixed size, a number or a tuple of numbers, or it is a part: packed numbers of their
own, such as a table of points or the numbers of another layout. A part is read as the pair ``(p,
at)`` of the array and the index where it begins, which a law passes on: ``stiffness_force(x,
*numbers.stiffness)``.
"""

import linecache
from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.compiler.compilation import generic, law

_FloatArray = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


@dataclass(frozen=True)
class Fixed:
    """A field of fixed size: one number, or several that are read as a tuple."""

    size: int
    is_tuple: bool = True

    def expression(self, at: str, offset: int) -> str:
        """Return the source that reads the field at an offset from the variable `at`."""
        entries = [f"p[{_sum(at, offset + k)}]" for k in range(self.size)]
        return f"({', '.join(entries)},)" if self.is_tuple else entries[0]


@dataclass(frozen=True)
class PackedPart:
    """A field with packed numbers of its own, whose size may depend on them.

    Attributes:
        size: Law (p, at) that returns how many numbers the part has; None for a part that must be
            last.
        structure: Function (p, at) that returns the whole numbers which must be equal in all
            machines of a batch, such as the number of points of a table.
        fixed_size: How many numbers the part has, if all machines have as many; else None.
        inside: Function (p, at) that returns the layout of its numbers and the index where they
            begin; None without a layout.
    """

    size: Any
    structure: Callable[[_FloatArray, int], list[int]]
    fixed_size: int | None = None
    inside: "Callable[[Any, int], tuple[PackedLayout, int]] | None" = None


SCALAR = Fixed(1, is_tuple=False)
VECTOR = Fixed(3)
"""Three components, as `wm_drake.compiler.vectors` takes them."""
ROTATION = Fixed(9)
"""A rotation matrix by rows, as `wm_drake.compiler.vectors` takes it."""
SYMMETRIC = Fixed(6)
"""A symmetric matrix xx, yy, zz, xy, xz, yz, as `wm_drake.compiler.matrices` takes it."""


def ARRAY(size: int) -> Fixed:  # a kind, like the constants above
    """Return the kind of a field of so many numbers, which is read as a tuple."""
    return Fixed(size)


def LAYOUT(layout: "PackedLayout") -> PackedPart:
    """Return the kind of a field that holds the numbers of another layout."""
    inside = lambda _, at: (layout, at)  # noqa: E731
    return PackedPart(layout.size, layout.structure, layout._fixed_size, inside)


class PackedLayout:
    """The order of named numbers in a flat array.

    Attributes:
        name: Name of the named tuple that `read` returns.
        fields: Kind of each field, in packed order.
        offsets: Offset of each field whose offset is the same in all machines.
        read: Law (p, at) that returns the numbers which begin at index `at` as a named tuple.
        write: Law (p, at, fields) that writes them; None if a field is a part.
        size: Law (p, at) that returns how many numbers there are; None if the last part has no
            size.
        units: SI unit of fields that are numbers of a machine file, by name.
    """

    def __init__(self, name: str, **fields: Fixed | PackedPart) -> None:
        """Generate the laws.

        Raises:
            ValueError: A part without a size is not the last field.
        """
        self.name = name
        self.fields: Mapping[str, Fixed | PackedPart] = fields
        self.offsets: dict[str, int] = {}
        self.units: dict[str, str] = {}
        self._fixed_size: int | None = None
        self.read: Any
        self.write: Any = None
        self.size: Any = None
        self._generate_reader()
        self._generate_writer()

    def _generate_reader(self) -> None:
        """Set `read`, `size` and offsets.

        In the source, each part of variable size moves the variable from which offsets count.
        """
        names: dict[str, Any] = {"Numbers": namedtuple(self.name, tuple(self.fields))}
        steps, entries = list[str](), list[str]()
        begin, offset, open_ended = "at", 0, False
        for field, kind in self.fields.items():
            if open_ended:
                raise ValueError(f"{self.name}: the part before '{field}' has no size")
            if begin == "at":
                self.offsets[field] = offset
            place = _sum(begin, offset)
            if isinstance(kind, Fixed):
                entries.append(kind.expression(begin, offset))
                offset += kind.size
                continue
            entries.append(f"(p, {place})")
            if kind.fixed_size is not None:
                offset += kind.fixed_size
            elif kind.size is None:
                open_ended = True
            else:
                names[f"size_of_{field}"] = kind.size
                steps.append(f"    after_{field} = {place} + size_of_{field}(p, {place})\n")
                begin, offset = f"after_{field}", 0
        read, size, chain = f"read_{self.name}", f"size_of_{self.name}", "".join(steps)
        source = f"def {read}(p, at):\n{chain}    return Numbers({', '.join(entries)})\n"
        self.read = generated(read, source, names)
        if begin == "at" and not open_ended:
            self._fixed_size = offset
        source = f"def {size}(p, at):\n{chain}    return {_sum(begin, offset)} - at\n"
        if not open_ended:
            self.size = generated(size, source, names)

    def _generate_writer(self) -> None:
        """Set `write` of a layout without parts."""
        write = f"write_{self.name}"
        lines = [f"def {write}(p, at, {', '.join(self.fields)}):"]
        for field, kind in self.fields.items():
            if isinstance(kind, PackedPart):
                return
            for k in range(kind.size):
                value = f"{field}[{k}]" if kind.is_tuple else field
                lines.append(f"    p[{_sum('at', self.offsets[field] + k)}] = {value}")
        self.write = generated(write, "\n".join(lines) + "\n", {})

    @property
    def fixed_size(self) -> int:
        """Number of entries of a layout without variable parts.

        Raises:
            ValueError: The layout has a part of variable size.
        """
        if self._fixed_size is None:
            raise ValueError(f"{self.name} has no fixed size")
        return self._fixed_size

    def pack(self, **values: Any) -> _FloatArray:
        """Return the packed numbers of named values; a part is given packed.

        Raises:
            ValueError: A value is missing, is unknown, or has another size than its field.
        """
        if values.keys() != self.fields.keys():
            odd = ", ".join(sorted(values.keys() ^ self.fields.keys()))
            raise ValueError(f"{self.name}: values and fields differ in {odd}")
        numbers: list[float] = []  # a study packs millions of numbers: lists are faster than arrays
        for field, kind in self.fields.items():
            if kind is SCALAR and type(values[field]) is float:
                numbers.append(values[field])
            else:
                numbers += self._flat(field, values[field]).tolist()
        return np.array(numbers, dtype=float)

    def pack_rows(self, **values: Any) -> _FloatArray:
        """Return the packed numbers of n components (n, size); fields of fixed size.

        Args:
            values: For each field its numbers (n, size of the field).

        Raises:
            ValueError: A value is missing or has another size than its field.
        """
        rows = np.column_stack([values[field] for field in self.fields])
        if set(values) != set(self.fields) or rows.shape[1] != self.fixed_size:
            raise ValueError(f"{self.name}: values do not have the sizes of the fields")
        return rows

    def _flat(self, field: str, value: Any) -> _FloatArray:
        flat = np.asarray(value, dtype=float).ravel()
        kind = self.fields[field]
        if isinstance(kind, Fixed) and len(flat) != kind.size:
            raise ValueError(
                f"{self.name}: {field} has {len(flat)} numbers; allowed are {kind.size}"
            )
        return flat

    def unpack(self, packed: Any, at: int = 0) -> Any:
        """Return the numbers that begin at an index as a named tuple, for Python code."""
        return generic(self.read)(packed, at)

    def places(
        self, packed: Any, at: int = 0
    ) -> Iterator[tuple[str, int, Fixed | PackedPart, str]]:
        """Yield name, index, kind and unit of each field, and of the fields of its parts.

        Before the name of a field of a part stands the name of the part and a dot, unless it is
        `law`: the numbers of a law belong to the component.
        """
        for field, kind in self.fields.items():
            if isinstance(kind, Fixed):
                yield field, at, kind, self.units.get(field, "")
                at += kind.size
                continue
            if kind.inside is None:
                yield field, at, kind, self.units.get(field, "")
            else:
                layout, begin = kind.inside(packed, at)
                before = "" if field == "law" else f"{field}."
                for name, place, of_part, unit in layout.places(packed, begin):
                    yield f"{before}{name}", place, of_part, unit
            at += generic(kind.size)(packed, at) if kind.size else 0

    def replaced(self, packed: _FloatArray, **values: Any) -> _FloatArray:
        """Return a copy of packed numbers with fields of fixed size and offset replaced."""
        copy = packed.copy()
        for field, value in values.items():
            flat = self._flat(field, value)
            copy[self.offsets[field] : self.offsets[field] + len(flat)] = flat
        return copy

    def structure(self, packed: _FloatArray, at: int = 0) -> list[int]:
        """Return the whole numbers of all parts, which must be equal in all machines of a batch."""
        numbers = self.unpack(packed, at)
        return [
            number
            for field, kind in self.fields.items()
            if isinstance(kind, PackedPart)
            for number in kind.structure(*getattr(numbers, field))
        ]


def generated(name: str, source: str, names: Mapping[str, Any]) -> Any:
    """Return the law of a generated source.

    Args:
        name: Name of the function that the source defines.
        source: Source of one function.
        names: Global names of the function.
    """
    filename = f"<generated {name}>"
    lines = source.splitlines(keepends=True)
    linecache.cache[filename] = (len(source), None, lines, filename)  # for tracebacks
    namespace = dict(names)
    exec(compile(source, filename, "exec"), namespace)
    return law(namespace[name])


def _sum(variable: str, offset: int) -> str:
    return f"{variable} + {offset}" if offset else variable
