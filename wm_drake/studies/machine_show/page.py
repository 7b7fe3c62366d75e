"""Page of a machine: its parts in space at rest, natural frequencies, tensions, warnings."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from wm_drake.model.machine import Machine
from wm_drake.model.scene import Outline, Scene
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import listed, number, shape_name, significant
from wm_drake.report.page import Section, SectionedPage, as_json, fragment
from wm_drake.report.table import Column, Table, line
from wm_drake.studies.machine_show.description import describe

MM, STIFFNESS, DEG = Unit("m", "mm"), Unit("N/m", "N/mm"), Unit("rad", "deg")

KINDS = {
    "housing": "housing",
    "tub": "moves with the tub",
    "drum": "drum",
    "spring": "springs",
    "damper": "dampers",
    "gasket": "gasket and bushings",
    "sensor": "sensors",
    "centre": "centres of mass",
}
"""Kinds of what is drawn, and their words."""

VIEWS = (("oblique", -0.55, 0.3), ("from the door", 0, 0), ("from the right", -1.5708, 0),
         ("from above", 0, 1.5708))  # fmt: skip
"""Words, turn about z and tilt of the views. [rad]"""

ROUND = 36
"""Points of a drawn circle."""

MARK_M = 0.008
"""Half length of the arms of a drawn point. [m]"""

Thing = dict[str, Any]
"""What is drawn: kind, name, words for the pointer, lines of points in W [m], label."""


def machine_page(machine: Machine, warnings: Sequence[str]) -> str:
    """Return the page of a machine as text of one self-contained file.

    Args:
        warnings: What is allowed but unusual.
    """
    shown = describe(machine)
    things = [*_things(Scene(machine.parameters), shown)]
    names = ", ".join(thing["name"] for thing in things if thing["kind"] != "housing")
    view = fragment(
        Path(__file__).with_name("view.html"),
        things=as_json(things),
        views=VIEWS,
        kinds=[(k, w) for k, w in KINDS.items() if any(t["kind"] == k for t in things)],
        alternative=f"The machine at rest with its parts: {names}.",
    )
    valid = f"Machine '{machine.parameters.name}' is valid"
    return SectionedPage(
        f"Machine {machine.parameters.name}",
        f"{valid}; {len(warnings)} unusual values are named above." if warnings else f"{valid}.",
        [
            Section("machine", "The machine at rest", body=view),
            Section("springs", "Springs and dampers at rest", tables=(_mounts(shown),)),
            Section("bodies", "Bodies", tables=(_bodies(shown),)),
        ],
        [("SDF model", Path(machine.parameters.model).name)],
        machine.parameters,
        warnings,
        advice=Section("", "In short", facts=_facts(machine, shown)),
        script=Path(__file__).with_name("view.js"),
    ).html()


def _facts(machine: Machine, shown: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return mass, rest pose and natural frequencies in words."""
    pose = shown["rest_pose"]
    angles = [f"{name} {number(DEG.from_si(pose[name]), 2)}°" for name in ("roll", "pitch", "yaw")]
    places = [f"{name} {number(MM.from_si(pose[name]), 1)} mm" for name in "xyz"]
    frequencies = [f"{number(hz, 2)}" for hz in shown["natural_frequencies_hz"]]
    critical = [f"{number(60.0 * hz, 0)}" for hz in shown["natural_frequencies_hz"]]
    slack = [n for n, s in shown["springs"].items() if s["tension_at_rest"] <= 0.0]
    return [
        ("Oscillating mass", f"{significant(shown['oscillating_mass_kg'])} kg"),
        ("Rest pose", f"{', '.join(angles)}, {', '.join(places)} from the pose as drawn"),
        ("Natural frequencies", f"{', '.join(frequencies)} Hz"),
        ("Resonance speeds", f"{', '.join(critical)} rpm, where the unbalance turns as fast"),
        ("Slack springs", listed(slack) if slack else "none"),
        ("Loads", ", ".join(machine.parameters.loads)),
    ]


def _mounts(shown: Mapping[str, Any]) -> Table:
    """Return stiffness or law, tension and length of springs and dampers."""
    springs = (
        line(
            f"spring {name}",
            (
                f"{significant(STIFFNESS.from_si(spring['stiffness']))} N/mm",
                spring["tension_at_rest"],
                MM.from_si(spring["length_at_rest"]),
            ),
        )
        for name, spring in shown["springs"].items()
    )
    dampers = (
        line(f"damper {name}", (of["law"], np.nan, MM.from_si(of["length_at_rest"])))
        for name, of in shown["dampers"].items()
    )
    columns = ("part", "stiffness or law", Column("tension", "N", 1), Column("length", "mm", 1))
    return Table("Springs and dampers at rest.", columns, (*springs, *dampers), text_columns=2)


def _bodies(shown: Mapping[str, Any]) -> Table:
    """Return mass and centre of mass of the bodies."""
    groups = tuple(
        line(
            shape_name(name),
            (body["turns_with"], body["mass"], *map(MM.from_si, body["centre_of_mass_T"])),
        )
        for name, body in shown["bodies"].items()
        if "centre_of_mass_T" in body
    )
    numbers = (Column("mass", "kg"), *(Column(axis, "mm", 1) for axis in "xyz"))
    caption = "Mass and centre of mass of each body, in the frame of the tub."
    return Table(caption, ("body", "moves with", *numbers), groups, text_columns=2)


def _things(scene: Scene, shown: Mapping[str, Any]) -> Iterator[Thing]:
    """Yield all that is drawn: shapes, elements, sensors, centres of mass, axes."""
    pose = shown["rest_pose"]
    angles, place = [[pose[k] for k in keys] for keys in (("roll", "pitch", "yaw"), "xyz")]
    tub = RigidTransform(RollPitchYaw(angles), place)
    fixed = RigidTransform()
    for name, outline in scene.outlines("housing").items():
        yield _thing("housing", name, shape_name(name), _edges(outline, fixed))
    for name, outline in scene.tub_outlines().items():
        kind = "drum" if name.startswith("drum") else "tub"
        yield _thing(kind, name, shape_name(name), _edges(outline, tub))
    yield from _elements(shown, tub)
    for name, sensor in shown["sensors"].items():
        words = f"sensor {name}, along {sensor['axis_W']}"
        yield {**_thing("sensor", name, words, _mark(tub @ _vector(sensor["point_T"]))),
               "label": name}  # fmt: skip
    for name, body in shown["bodies"].items():
        if "centre_of_mass_T" in body:
            words = f"centre of mass of {shape_name(name)}, {significant(body['mass'])} kg"
            lines = _mark(tub @ _vector(body["centre_of_mass_T"]))
            yield _thing("centre", name, words, lines)
    for axis, end in zip("xyz", 0.12 * np.eye(3), strict=True):
        words = f"axis {axis} of the housing"
        yield {**_thing("axis", axis, words, [[[0.0, 0.0, 0.0], end.tolist()]]), "label": axis}


def _elements(shown: Mapping[str, Any], tub: RigidTransform) -> Iterator[Thing]:
    """Yield springs, dampers, bushings and telescopic dampers."""
    for name, spring in shown["springs"].items():
        words = (
            f"spring {name}: {significant(STIFFNESS.from_si(spring['stiffness']))} N/mm, tension "
            f"at rest {number(spring['tension_at_rest'])} N"
        )
        yield _thing("spring", name, words, [_between(spring, tub)])
    for table in ("dampers", "telescopic_dampers"):
        for name, damper in shown[table].items():
            if "tub_point_T" in damper:
                law = f": {damper['law']}" if "law" in damper else ""
                yield _thing("damper", name, f"damper {name}{law}", [_between(damper, tub)])
    for name, bushing in shown["bushings"].items():
        lines = _mark(tub @ _vector(bushing["tub_point_T"]), 3.0 * MARK_M)
        words = name if name == "gasket" else f"bushing {name}"
        yield _thing("gasket", name, words, lines)


def _thing(kind: str, name: str, words: str, lines: Sequence[Sequence[Sequence[float]]]) -> Thing:
    return {"kind": kind, "name": name, "words": words, "lines": lines}


def _vector(values: Sequence[float]) -> FloatArray:
    return np.asarray(values, dtype=float)


def _between(element: Mapping[str, Any], tub: RigidTransform) -> list[list[float]]:
    """Return the line of an element from the tub at rest to the housing."""
    end = tub @ _vector(element["tub_point_T"])
    return [end.tolist(), list(element["housing_point_W"])]


def _mark(place: FloatArray, arm: float = MARK_M) -> list[list[list[float]]]:
    """Return a cross of three lines about a point."""
    return [[(place - end).tolist(), (place + end).tolist()] for end in arm * np.eye(3)]


def _edges(outline: Outline, pose: RigidTransform) -> list[list[list[float]]]:
    """Return the edges of a box or cylinder in W."""
    u, v, w = outline.axes * outline.half[:, None]
    if outline.is_round:
        angle = np.linspace(0.0, 2.0 * np.pi, ROUND + 1)[:, None]
        circle = outline.centre + np.cos(angle) * u + np.sin(angle) * v
        sides = [np.stack([p - w, p + w]) for p in circle[: -1 : ROUND // 6]]
        lines = [circle - w, circle + w, *sides]
    else:
        corner = {
            (i, j, k): outline.centre + i * u + j * v + k * w
            for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)
        }  # fmt: skip
        lines = [
            np.stack([corner[a], corner[b]])
            for a in corner
            for b in corner
            if a < b and sum(x != y for x, y in zip(a, b, strict=True)) == 1
        ]
    rotation, place = pose.rotation().matrix(), pose.translation()
    return [np.round(line_ @ rotation.T + place, 5).tolist() for line_ in lines]
