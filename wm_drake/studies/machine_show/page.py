"""Page of a machine: its parts in space at rest, natural frequencies, tensions, warnings."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from pydrake.math import RigidTransform, RollPitchYaw

from wm_drake.model.machine import Machine
from wm_drake.model.scene import Outline, Scene
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import listed, shape_name
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.page import as_json, fragment
from wm_drake.report.quantity import MASS, SPEED, Quantity
from wm_drake.studies.answer import Answer, Part
from wm_drake.studies.machine_show.description import Description, description_of
from wm_drake.studies.machine_show.elements import Damper, Spring, TelescopicDamper
from wm_drake.studies.modes.quantities import FREQUENCY

LENGTH = Quantity("length", Unit("m", "mm"), 1)
ANGLE = Quantity("angle", Unit("rad", "deg"), 2)
TENSION = Quantity("tension", Unit("N", "N"), 1)
STIFFNESS = Quantity("stiffness", Unit("N/m", "N/mm"))

KINDS = {
    "housing": "housing",
    "tub": "moves with the tub",
    "drum": "drum",
    "spring": "springs",
    "damper": "dampers",
    "gasket": "gasket and bushings",
    "element": "other elements",
    "sensor": "sensors",
    "centre": "centres of mass",
}
"""Kinds of what is drawn, and their words."""

VIEWS = (("oblique", -0.55, 0.3), ("from the door", 0, 0), ("from the right", -1.5708, 0),
         ("from above", 0, 1.5708))  # fmt: skip
"""Words, turn about z and tilt of the views. [rad]"""

ROUND = 36
"""Points of a drawn circle."""

MARK_ARM = 0.008
"""Half length of the arms of a drawn point. [m]"""

Thing = dict[str, Any]
"""What is drawn: kind, name, words for the pointer, lines of points in W [m], label."""


def machine_answer(machine: Machine, warnings: Sequence[str]) -> Answer:
    """Return what is shown of a machine that has been checked.

    Args:
        warnings: What is allowed but unusual.
    """
    parameters, shown = machine.parameters, description_of(machine)
    things = [*_things(Scene(parameters), shown)]
    unusual = f"; {len(warnings)} unusual values are named above" if warnings else ""
    slowest, *_, fastest = shown.natural_frequencies_hz
    return Answer(
        f"Machine {parameters.name}",
        f"Machine '{parameters.name}' is valid{unusual}. {MASS.text(shown.oscillating_mass_kg)} "
        f"oscillate, at natural frequencies from {FREQUENCY.number(slowest)} to "
        f"{FREQUENCY.text(fastest)}.",
        parameters,
        (
            Part("The machine at rest", body=lambda: _view(things)),
            Part("Springs and dampers at rest", _mounts(shown)),
            Part("Bodies", (_bodies(shown),)),
        ),
        (("SDF model", Path(parameters.model).name),),
        warned=tuple(warnings),
        short=Part("In short", facts=_facts(shown)),
        script=Path(__file__).with_name("view.js"),
    )


def _view(things: Sequence[Thing]) -> str:
    """Return the picture of the machine that a reader turns, as HTML."""
    names = ", ".join(thing["name"] for thing in things if thing["kind"] != "housing")
    return fragment(
        Path(__file__).with_name("view.html"),
        things=as_json(things),
        views=VIEWS,
        kinds=[(k, w) for k, w in KINDS.items() if any(t["kind"] == k for t in things)],
        alternative=f"The machine at rest with its parts: {names}.",
    )


def _facts(shown: Description) -> list[tuple[str, str]]:
    """Return mass, rest pose and natural frequencies in words."""
    pose, frequencies = shown.rest_pose, np.array(shown.natural_frequencies_hz)
    angles = [f"{name} {ANGLE.text(getattr(pose, name))}" for name in ("roll", "pitch", "yaw")]
    places = [f"{name} {LENGTH.text(getattr(pose, name))}" for name in "xyz"]
    critical = map(SPEED.number, 2.0 * np.pi * frequencies)
    slack = [name for name, spring in shown.springs.items() if spring.tension_at_rest <= 0.0]
    return [
        ("Oscillating mass", MASS.text(shown.oscillating_mass_kg)),
        ("Rest pose", f"{', '.join([*angles, *places])} from the pose as drawn"),
        (
            "Natural frequencies",
            f"{', '.join(map(FREQUENCY.number, frequencies))} {FREQUENCY.unit_text}",
        ),
        (
            "Resonance speeds",
            f"{', '.join(critical)} {SPEED.unit_text}, where the unbalance turns as fast",
        ),
        ("Slack springs", listed(slack) if slack else "none"),
        ("Loads", ", ".join(shown.loads)),
    ]


def _mounts(shown: Description) -> tuple[LabelledTable, ...]:
    """Return stiffness or law, tension and length of springs and dampers; nothing without any."""
    springs, dampers = shown.springs, shown.dampers
    names = [*(f"spring {name}" for name in springs), *(f"damper {name}" for name in dampers)]
    struts: list[Spring | Damper] = [*springs.values(), *dampers.values()]
    laws = [*map(_stiffness, springs.values()), *(damper.law for damper in dampers.values())]
    tensions = [spring.tension_at_rest for spring in springs.values()] + [np.nan] * len(dampers)
    data = xr.Dataset(
        {
            "stiffness_or_law": ("part", laws),
            "tension": TENSION.variable("part", tensions),
            "length": LENGTH.variable("part", [strut.length_at_rest for strut in struts]),
        },
        {"part": names},
    )
    title = "Springs and dampers at rest"
    return (LabelledTable("mounts", data, title, f"{title}."),) if names else ()


def _stiffness(spring: Spring) -> str:
    """Return the stiffness of a spring in words; that of a table is its slope about the drawing."""
    of = spring.stiffness
    return STIFFNESS.text(of.nominal_stiffness if isinstance(of, CurveTable) else of)


def _bodies(shown: Description) -> LabelledTable:
    """Return mass and centre of mass of the bodies."""
    bodies = shown.bodies.values()
    centres = [body.centre_of_mass_T for body in bodies]
    data = xr.Dataset(
        {
            "moves_with": ("body", [body.turns_with for body in bodies]),
            "mass": MASS.variable("body", [body.mass for body in bodies]),
            "centre_of_mass": LENGTH.variable(("body", "axis"), centres),
        },
        {"body": [*map(shape_name, shown.bodies)], "axis": list("xyz")},
    )
    return LabelledTable(
        "bodies",
        data,
        "Bodies",
        "Mass and centre of mass of each body, in the frame of the tub.",
        across="axis",
    )


def _things(scene: Scene, shown: Description) -> Iterator[Thing]:
    """Yield all that is drawn: shapes, elements, sensors, centres of mass, axes."""
    pose = shown.rest_pose
    angles = RollPitchYaw(pose.roll, pose.pitch, pose.yaw)
    tub, fixed = RigidTransform(angles, [pose.x, pose.y, pose.z]), RigidTransform()
    for name, outline in scene.outlines("housing").items():
        yield _thing("housing", name, shape_name(name), _edges(outline, fixed))
    for name, outline in scene.tub_outlines().items():
        kind = "drum" if name.startswith("drum") else "tub"
        yield _thing(kind, name, shape_name(name), _edges(outline, tub))
    yield from _elements(shown, tub)
    for name, sensor in shown.sensors.items():
        words = f"sensor {name}, along {sensor.axis_W}"
        yield {**_thing("sensor", name, words, _mark(tub @ np.array(sensor.point_T))),
               "label": name}  # fmt: skip
    for name, body in shown.bodies.items():
        words = f"centre of mass of {shape_name(name)}, {MASS.text(body.mass)}"
        yield _thing("centre", name, words, _mark(tub @ np.array(body.centre_of_mass_T)))
    for axis, end in zip("xyz", 0.12 * np.eye(3), strict=True):
        words = f"axis {axis} of the housing"
        yield {**_thing("axis", axis, words, [[[0.0, 0.0, 0.0], end.tolist()]]), "label": axis}


def _elements(shown: Description, tub: RigidTransform) -> Iterator[Thing]:
    """Yield the elements, those of a user's own kind too."""
    for name, spring in shown.springs.items():
        tension = TENSION.text(spring.tension_at_rest)
        words = f"spring {name}: {_stiffness(spring)}, tension at rest {tension}"
        yield _thing("spring", name, words, [_between(spring, tub)])
    dampers: dict[str, Damper | TelescopicDamper] = {**shown.dampers, **shown.telescopic_dampers}
    for name, damper in dampers.items():
        yield _thing("damper", name, f"damper {name}: {damper.law}", [_between(damper, tub)])
    for name, bushing in shown.bushings.items():
        lines = _mark(tub @ np.array(bushing.tub_point_T), 3.0 * MARK_ARM)
        words = name if name == "gasket" else f"bushing {name}"
        yield _thing("gasket", name, words, lines)
    others: dict[str, Any] = dict(shown.elements)
    for name, element in others.items():
        is_strut = hasattr(element, "length_at_rest")
        place = tub @ np.array(element.tub_point_T)
        lines = [_between(element, tub)] if is_strut else _mark(place, 3.0 * MARK_ARM)
        yield _thing("element", name, f"{name}: {element.law}", lines)


def _thing(kind: str, name: str, words: str, lines: Sequence[Sequence[Sequence[float]]]) -> Thing:
    return {"kind": kind, "name": name, "words": words, "lines": lines}


def _between(element: Any, tub: RigidTransform) -> list[list[float]]:
    """Return the line of an element from the tub at rest to the housing."""
    end = tub @ np.array(element.tub_point_T)
    return [end.tolist(), list(element.housing_point_W)]


def _mark(place: FloatArray, arm: float = MARK_ARM) -> list[list[list[float]]]:
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
