"""Schematics of the manual: of what parts a damper, a bushing, a bench and a machine consist.

The parts follow from the declarations: the fields of a damper law and of a bushing, the elements of
a machine file, and the links and joints of its SDF.
"""

import functools
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from pictures import BLUE, GREEN, ORANGE, RED, picture

import wm_drake as wm
from wm_drake.model.bodies import sdf_path
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.damper_laws import DAMPER_LAWS
from wm_drake.parameters.elements import BushingType
from wm_drake.report.drawing import matplotlib_of
from wm_drake.rigs import JIG_ARM, damper_bench
from wm_drake.studies.rig.section import section_plots

Place = tuple[float, float] | np.ndarray
ZIGZAG = [(x, 0.16 * (-1) ** k) for k, x in enumerate(np.linspace(-0.37, 0.37, 8))]
CUP = [(0.3, 0.18), (-0.2, 0.18), (-0.2, -0.18), (0.3, -0.18)]
BLOCK = [(-0.2, -0.11), (0.2, -0.11), (0.2, 0.11), (-0.2, 0.11), (-0.2, -0.11)]
GROUND = [(-0.35, -0.14), (0.4, -0.14), (0.4, 0), (0.5, 0)]
HATCHES = [[(x, -0.14), (x - 0.06, -0.24)] for x in np.linspace(-0.27, 0.35, 6)]
SHAPES: dict[str, list[list[tuple[float, float]]]] = {
    "rigid": [[(-0.5, 0), (0.5, 0)]],
    "spring": [[(-0.5, 0), (-0.42, 0), *ZIGZAG, (0.42, 0), (0.5, 0)]],
    "dashpot": [[(-0.5, 0), (-0.2, 0)], CUP, [(0.1, -0.14), (0.1, 0.14)], [(0.1, 0), (0.5, 0)]],
    "friction": [[(-0.5, 0), (-0.2, 0)], BLOCK, GROUND, *HATCHES],
}
"""Lines of each part in its own frame, along and across; it ends at -0.5 and 0.5."""


def part(axes: Axes, kind: str, start: Place, end: Place, **style: Any) -> None:
    """Draw a part from one point to another; its shape has a fixed size, its leads the rest."""
    a, b = np.array(start), np.array(end)
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    frame = np.array([along, (-along[1], along[0])])
    for shape in SHAPES[kind]:
        points = np.array(shape, dtype=float)
        is_end = np.abs(points[:, 0]) == 0.5
        points[is_end, 0] *= length
        line = (a + b) / 2.0 + points @ frame
        axes.plot(*line.T, **{"color": "k", "lw": 1.1, **style})


def wall(axes: Axes, start: Place, end: Place) -> None:
    """Draw a body at rest: a line with hatches to the right of the way from start to end."""
    a, b = np.array(start), np.array(end)
    along = (b - a) / np.linalg.norm(b - a)
    hatch = 0.16 * (np.array([along[1], -along[0]]) - along)
    part(axes, "rigid", a, b, lw=1.6)
    for place in np.linspace(a, b, 9)[1:]:
        part(axes, "rigid", place, place + hatch, lw=0.7)


def box(axes: Axes, place: Place, text: str, colour: str = "0.92") -> None:
    """Write a text in a box."""
    frame = {"boxstyle": "round,pad=0.35", "facecolor": colour, "edgecolor": "0.3"}
    axes.text(*place, text, ha="center", va="center", fontsize=8, bbox=frame, zorder=3)


def _bare(figure: Figure, rows: int, columns: int, **options: Any) -> list[Axes]:
    every = list(np.atleast_1d(figure.subplots(rows, columns, **options)).flat)
    for axes in every:
        axes.set_axis_off()
        axes.set_aspect("equal")
    return every


STAGES = {
    "sponge": {"sponge_stiffness": "spring", "sponge": "spring", "sponge_damping": "dashpot"},
    "tubes": {"basic_friction_force": "friction", "basic_full_friction_velocity": "friction"},
    "slider": {"damping": "dashpot", "slider_damping": "dashpot"},
}
"""Parts of the numbers of damper laws between end and slider, from end to end, and between slider
and end, where every other number belongs to the friction."""


def _parallel(axes: Axes, fields: dict[str, str], left: float, right: float, top: float) -> float:
    """Draw parts side by side between two bars, and return the height below the lowest one."""
    last = low = top
    for kind in dict.fromkeys(fields.values()):
        part(axes, kind, (left, low), (right, low))
        text = "\n".join(name.replace("_", " ") for name in fields if fields[name] == kind)
        axes.text((left + right) / 2.0, low - 0.26, text, ha="center", va="top", fontsize=6.2)
        last, low = low, low - 1.03 - 0.28 * text.count("\n")
    axes.plot([left, left], [top, last], [right, right], [top, last], color="k", lw=1.6)
    return low


@picture("damper-parts", "Springs, dashpots and friction sliders of each damper law")
def damper_parts() -> Figure:
    """Draw the parts of each damper law, from its fields."""
    figure = Figure(figsize=(10.5, 5.0))
    every = _bare(figure, 2, 3, height_ratios=(3.2, 4.0))
    for axes, law in zip(every, DAMPER_LAWS.values(), strict=True):
        sponge, tubes = (
            {name: kind for name, kind in STAGES[stage].items() if name in law.fields}
            for stage in ("sponge", "tubes")
        )
        others = [name for name in law.fields if name not in (*sponge, *tubes)]
        slider = {name: STAGES["slider"].get(name, "friction") for name in others}
        middle = 2.8 if sponge else 0.0
        low = _parallel(axes, slider, middle + 0.5, 5.7, 0.0)
        if sponge:
            low = min(low, _parallel(axes, sponge, 0.3, middle - 0.5, 0.0))
            box(axes, (middle, 0.0), "slider", "#f8e0c8")
        if tubes:
            axes.plot([0.0, 0.0], [0.0, low], [6.0, 6.0], [0.0, low], color="k", lw=1.6)
            _parallel(axes, tubes, 0.0, 6.0, low)
        for lead in ([0.0, 0.5], [middle - 0.5, middle + 0.5], [5.7, 6.0]):
            axes.plot(np.maximum(lead, 0.0), [0.0, 0.0], color="k", lw=1.1)
        wall(axes, (6.0, -0.5), (6.0, 0.5))
        axes.plot([0.0], [0.0], "o", color=BLUE, ms=6, zorder=3)
        axes.set_title(f"{law.name}: {law.equations}", fontsize=9)
        axes.set(xlim=(-0.3, 6.5), ylim=(-3.2 if sponge else -2.4, 0.8))
    return figure


@picture("damper-section", "Cross-section of the damper of the machine free_stroke")
def damper_section() -> Figure:
    """Draw the cross-section of the free-stroke damper, from its numbers."""
    (damper, *_) = wm.load_machine("free_stroke").damper_types.values()
    (plot,) = section_plots(damper_bench(damper))
    return matplotlib_of(plot.figure)


@picture("bushing-parts", "Springs, dashpots and friction of a bushing along and about three axes")
def bushing_parts() -> Figure:
    """Draw the parts of a bushing, from its fields."""
    figure = Figure(figsize=(9.0, 4.3))
    kinds = {"along": ("stiffness", "damping"), "about": ("rotational", "friction")}
    for axes, (title, beginning) in zip(_bare(figure, 1, 2), kinds.items(), strict=True):
        every = [name for name in BushingType.model_fields if name.startswith(beginning)]
        for axis, degrees in {"x": -25.0, "y": 32.0, "z": 90.0}.items():
            fields = [name for name in every if name.endswith(f"_{axis}")]
            along = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
            across = np.array([-along[1], along[0]])
            for k, kind in enumerate(("spring", "dashpot", "friction")[: len(fields)]):
                side = 0.56 * (k - 0.5 * (len(fields) - 1)) * across
                part(axes, kind, 1.6 * along + side, 3.1 * along + side)
            part(axes, "rigid", 0.0 * along, 1.6 * along)
            part(axes, "rigid", 1.6 * along - 0.7 * across, 1.6 * along + 0.7 * across, lw=1.6)
            wall(axes, 3.1 * along - 0.85 * across, 3.1 * along + 0.85 * across)
            side, up = ("left", "center") if degrees < 90 else ("center", "bottom")
            axes.text(*(3.5 * along), "\n".join(fields), fontsize=7, ha=side, va=up)
        box(axes, (0.0, 0.0), "tub", "#cfe3f5")
        axes.set(xlim=(-0.9, 5.5), ylim=(-2.2, 4.2))
        axes.set_title(f"{title} the axes of the housing (hatched)", fontsize=9)
    return figure


@picture("benches", "Benches of a damper, and of a bushing or gasket along and about an axis")
def benches() -> Figure:
    """Draw the benches: the end that is held, the end that moves, and what is measured."""
    figure = Figure(figsize=(9.0, 2.6))
    titles = "damper", "bushing or gasket, along an axis", "bushing or gasket, about an axis"
    for axes, title in zip(_bare(figure, 1, 3), titles, strict=True):
        at, text = (1.1, "F = M / R") if "about" in title else (0.0, "F")
        wall(axes, (0.0, 0.7), (0.0, -0.7))
        part(axes, "rigid", (0.0, 0.0), (3.2, 0.0))
        box(axes, (1.5, 0.0), title.split(",")[0].replace(" or", "\nor"), "#f8e0c8")
        if at:
            part(axes, "rigid", (3.2, 0.0), (3.2, at), lw=3)
            axes.text(3.3, 0.45, f"arm R = {1e3 * JIG_ARM:g} mm", fontsize=8, va="center")
        else:
            box(axes, (3.2, 0.0), " ", "#cfe3f5")
        for x, name in ((0.0, "held"), (3.2, "driven")):
            axes.text(x, -1.05, name, ha="center", fontsize=8)
        for x, up, what, style in ((2.6, 0.6, "d = A sin 2πft", "<->"), (3.3, 0.0, text, "->")):
            ends = (x + 1.2, at + up), (x, at + up)
            axes.annotate("", *ends, arrowprops={"arrowstyle": style, "color": RED})
            axes.text(x + 1.3, at + up, what, color=RED, va="center", fontsize=8)
        axes.set(xlim=(-0.5, 6.2), ylim=(-1.3, 2.0))
        axes.set_title(title, fontsize=9)
    return figure


HOW_TO = Path(__file__).parents[1] / "how-to" / "bench-to-machine.md"
FLOW = {
    "Measure force loops": "displacement and force of the driven end",
    "Look at the loops of the law": "loops of numbers that you guess",
    "Find the numbers": "least E = RMSE of [C] (5) within bounds; lack of fit, intervals",
    "Compare laws": "each test predicted from the others",
    "Use them in the machine": "identified.yaml extends your machine",
}
"""Sections of the page that the flow goes through, and what each of them yields."""


@picture("bench-to-machine", "From the bench to the machine: sections of this page and commands")
def bench_to_machine() -> Figure:
    """Draw the flow of [C] Fig. 10 with the first command of each section of the page."""
    figure = Figure(figsize=(9.0, 5.6))
    (axes,) = _bare(figure, 1, 1)
    parts = re.split(r"^## (?:\d+\. )?(.+)$", HOW_TO.read_text("utf-8"), flags=re.MULTILINE)
    texts = dict(zip(parts[1::2], parts[2::2], strict=True))
    for k, (section, result) in enumerate(FLOW.items()):
        command = re.search(r"^wm-drake (?!record).*", texts[section], re.MULTILINE)
        called = f"\n{command[0]}" if command and k else ""
        text = f"{k + 1}. {section}{called}\n→ {result}"
        box(axes, (0.0, -2.2 * k), text, "#cfe3f5" if called else "0.92")
        if k:
            _arrow(axes, (0.0, -2.2 * k + 1.5), (0.0, -2.2 * k + 0.7))
    axes.plot([-7.0, -7.6, -7.6], [-6.6, -6.6, -4.4], color="0.3", lw=1.0)
    _arrow(axes, (-7.6, -4.4), (-4.8, -4.4))
    axes.text(-7.7, -5.5, "lack of fit:\nanother law", fontsize=8, ha="right", va="center")
    axes.set(xlim=(-10.2, 6.5), ylim=(-9.8, 0.9))
    return figure


def _arrow(axes: Axes, start: Place, end: Place) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "0.3"})


JOINTS = {"fixed": "k", "revolute": BLUE, "prismatic": ORANGE}
FORCES = {"spring": GREEN, "damper": ORANGE, "bushing": RED}
SHAPE_OF = {"damper": "friction", "bushing": "spring"}
Chain = list[tuple[str, str]]  # force elements from the tub down, each with the body below it
TUBES: Chain = [("bushing", "outer tube"), ("damper", "inner tube"), ("bushing", "")]


def _joints(machine: MachineParameters) -> Iterator[tuple[str, ...]]:
    """Yield type, parent and child of each joint of the SDF."""
    for joint in ET.parse(sdf_path(machine.model)).getroot().iter("joint"):
        yield (joint.get("type", ""), *(joint.findtext(end, "") for end in ("parent", "child")))


def _chains(machine: MachineParameters) -> dict[str, Chain]:
    """Return the chain of each force element between tub and housing."""
    return {
        **{f"spring {name}": [("spring", "")] for name in machine.springs},
        **{f"damper {name}": [("damper", "")] for name in machine.dampers},
        **{f"damper {name}": TUBES for name in machine.telescopic_dampers},
        **{name: [("bushing", "")] for name in ("gasket",) if machine.gasket},
        **{name: [("bushing", "")] for name in machine.bushings},
    }


def _draw(axes: Axes, x: float, top: float, name: str, chain: Chain) -> None:
    heights = np.linspace(top, 0.3, len(chain) + 1)
    for (kind, below), *ends in zip(chain, heights[:-1], heights[1:], strict=True):
        upper, lower = map(float, ends)
        part(axes, SHAPE_OF.get(kind, kind), (x, upper), (x, lower), color=FORCES[kind])
        if kind == "damper" and len(chain) > 1:
            axes.plot([x + 0.4, x + 0.4], [upper, lower], color=JOINTS["prismatic"], lw=2.0)
        if below:
            box(axes, (x, lower), below)
    text = name.replace("_", " ").replace(" ", "\n", 1)
    axes.text(x + 0.3, top - 0.25, text, fontsize=7.5, va="top")


def topology(name: str) -> Figure:
    """Draw bodies, joints and force elements of a shipped machine, from its file and its SDF."""
    machine = wm.load_machine(name)
    chains = _chains(machine)
    joined = [(body, kind) for kind, parent, body in _joints(machine) if parent == "tub"]
    rings = [e.kind.replace("_", " ") for e in machine.elements.values() if hasattr(e, "y")]
    width = 2.1 * max(5, len(chains), len(joined))
    height = 6.4 if machine.telescopic_dampers else 3.2
    (axes,) = _bare(figure := Figure(figsize=(9.0, 9.0 / width * (height + 3.8))), 1, 1)
    for y, body in ((height, "tub"), (0.0, "housing")):
        axes.add_patch(Rectangle((0, y - 0.3), width, 0.6, facecolor="#cfe3f5", edgecolor="0.3"))
        axes.text(width / 2.0, y, body, ha="center", va="center", fontsize=9)
    for k, (body, kind) in enumerate(joined):
        x = width * (k + 0.5) / len(joined)
        part(axes, "rigid", (x, height + 0.3), (x, height + 1.5), color=JOINTS[kind], lw=2.0)
        text = body.replace("_counterweight", "\ncounterweight").replace("_", " ")
        text += "".join(f"\nwith {ring}" for ring in rings) if body == "drum" else ""
        box(axes, (x, height + 1.5), text)
    for k, (label, chain) in enumerate(chains.items()):
        _draw(axes, width * (k + 0.5) / len(chains) - 0.2, height - 0.3, label, chain)
    wall(axes, (0.3 * width, -0.3), (0.7 * width, -0.3))
    used = {kind for kind, *_ in (*_joints(machine), *(f for c in chains.values() for f in c))}
    for kinds, what in ((JOINTS, " joint"), (FORCES, "")):
        for kind in (kind for kind in kinds if kind in used):
            axes.plot([], [], color=kinds[kind], lw=2.0, label=f"{kind}{what}")
    axes.set(xlim=(-0.1, width + 0.1), ylim=(-1.0, height + 2.2))
    axes.legend(ncols=7, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, 0.02), frameon=False)
    return figure


for _name in ("free_stroke", "reference"):
    _register = picture(f"topology-{_name}", f"Bodies, joints and force elements of {_name}")
    _register(functools.partial(topology, _name))
