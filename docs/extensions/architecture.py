"""Picture of the architecture: the rooms of the package and their imports, read from the sources.

The rooms stand in the order of their imports, so the package can be read downwards. An arc leads
from a room up to one that it imports; the more imports, the wider the arc. Rooms and studies of the
edge (`wm_drake/edge.ini`), which the core does not import, have a colour of their own.
"""

import ast
import graphlib
from collections import Counter
from html import escape
from math import log2
from pathlib import Path

from wm_drake.registry import edge

PACKAGE = Path(__file__).parents[2] / "wm_drake"
LIBRARIES = {"pydrake": "Drake", "numba": "numba", "plotly": "plotly", "matplotlib": "matplotlib"}
EDGE = "#b34700"
"""Colour of the edge."""
ROW, LEFT, WIDTH = 30, 230, 1060
"""Distance of two rooms, place of their names, and width of the picture. [px]"""


def imports() -> dict[str, Counter[str]]:
    """Return how often each room imports each other room, and the large libraries."""
    rooms: dict[str, Counter[str]] = {
        path.parent.name: Counter() for path in PACKAGE.glob("*/__init__.py")
    }
    for path in PACKAGE.glob("*/**/*.py"):
        room = path.relative_to(PACKAGE).parts[0]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in names:
                package, _, rest = name.partition(".")
                other = rest.split(".")[0] if package == PACKAGE.name else LIBRARIES.get(package)
                if other in rooms.keys() - {room} or other in LIBRARIES.values():
                    rooms[room][str(other)] += 1
    return rooms


def svg() -> str:
    """Return the picture as SVG, with the imports as its text for screen readers."""
    rooms = imports()
    order = list(graphlib.TopologicalSorter(_downward(rooms)).static_order())
    height = {room: ROW * (number + 0.7) for number, room in enumerate(order)}
    parts, words = [], []
    for room in order:
        y = height[room]
        about = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text())) or " "
        used = [f"{name} {n}" for name, n in rooms[room].items() if name in LIBRARIES.values()]
        of_edge = sorted(m.split(".")[2] for m in edge("modules") if f".{room}." in m)
        if of_edge:
            parts.append(
                f'<text x="{LEFT + 90}" y="{y + 13}" font-size="10" fill="{EDGE}">edge: '
                f"{', '.join(of_edge)}</text>"
            )
        colour = EDGE if f"{PACKAGE.name}.{room}" in edge("modules") else "currentColor"
        parts.append(
            f'<text x="{LEFT}" y="{y}" font-weight="bold" fill="{colour}">{room}</text>'
            f'<text x="{LEFT + 90}" y="{y}">{escape(about.splitlines()[0])}</text>'
            f'<text x="{WIDTH - 5}" y="{y}" text-anchor="end" fill="#888">{", ".join(used)}</text>'
        )
        for other in sorted(rooms[room].keys() & height.keys()):
            at, count = height[other], rooms[room][other]
            bend = LEFT - 10 - 0.6 * abs(y - at)
            parts.append(
                f'<path d="M{LEFT - 6} {y - 4} C{bend:.0f} {y - 4} {bend:.0f} {at - 4} {LEFT - 6} '
                f'{at - 4}" fill="none" stroke="#4a7ab0" stroke-opacity="0.5" '
                f'stroke-width="{0.4 * log2(1 + count):.1f}"><title>{room} imports {other} '
                f"{count} times</title></path>"
            )
        words.append(f"{room} imports {', '.join(sorted(rooms[room])) or 'no room'}")
    return (
        f'<svg viewBox="0 0 {WIDTH} {ROW * len(order)}" width="100%" role="img" font-size="13" '
        f'fill="currentColor" aria-label="{escape("; ".join(words))}">{"".join(parts)}</svg>'
    )


def _downward(rooms: dict[str, Counter[str]]) -> dict[str, set[str]]:
    """Return the rooms that each room imports more often than it is imported by them."""
    return {
        room: {other for other in others if other in rooms and others[other] >= rooms[other][room]}
        for room, others in rooms.items()
    }
