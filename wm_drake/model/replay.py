"""3D replay of a motion: one HTML page with bodies, springs, dampers, gasket and unbalances.

The page is Drake's Meshcat with a recorded animation. A caption shows title, time and drum speed.
"""

import gc
import html
import json
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from wm_drake.elements.kind import Ends, element_kind
from wm_drake.model.frame_poses import FramePoses
from wm_drake.model.placed_elements import placed_elements
from wm_drake.model.scene import Scene, with_fixed_cabinet
from wm_drake.model.visualization import SHAPES, add_floor, cabinet_pose
from wm_drake.parameters import Load, MachineParameters
from wm_drake.parameters.element_kinds import DrumElement
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit

SPRING_COLOUR = Rgba(0.0, 0.447, 0.698, 1.0)
DAMPER_COLOUR, ROD_COLOUR = Rgba(0.90, 0.62, 0.0, 1.0), Rgba(0.25, 0.25, 0.25, 1.0)
GASKET_COLOUR, RING_COLOUR = Rgba(0.0, 0.62, 0.45, 0.35), Rgba(0.0, 0.45, 0.33, 1.0)
UNBALANCE_COLOUR, WATER_COLOUR = Rgba(0.835, 0.369, 0.0, 1.0), Rgba(0.0, 0.32, 0.80, 1.0)
BALL_COLOUR, RACE_COLOUR = Rgba(0.25, 0.25, 0.28, 1.0), Rgba(0.2, 0.2, 0.2, 1.0)

COILS, COIL_RADIUS, WIRE_RADIUS = 9, 0.017, 0.0028
"""Coils of a drawn spring, radius of the coil and of the wire. [m] For drawing only."""

TUBE_RADIUS, ROD_RADIUS = 0.014, 0.007
"""Radii of the two tubes of a drawn damper. [m] For drawing only."""

RACE_WIRE = 0.0015
"""Radius of the line of a drawn ring on the drum. [m]"""

TUBE_SHARE, ROD_SHARE = 0.55, 0.75
"""Lengths of the two tubes of a drawn damper, as shares of its length at rest; they overlap."""

GASKET_RADIUS, GASKET_DEPTH = 0.15, 0.06
"""Radius and depth of the drawn gasket. [m]

The machine file does not have them: its gasket is a law at a point. They are those of a usual door
opening, and no result depends on them.
"""

STAVES = 24
"""Number of strips of which the drawn gasket consists."""

DENSITY = 1000.0
"""Density that gives the size of the ball of an unbalance: that of wet laundry, about. [kg/m^3]"""


@dataclass(frozen=True)
class Motion:
    """The motion that a replay shows.

    Attributes:
        time: (n,) [s]
        positions: (n, >= 7) Positions of the plant: roll, pitch, yaw, x, y, z of the tub, drum
            angle, then those of damper tubes. [rad, m]
        speed: (n,) Drum speed. [rad/s]
        cabinet: (n, 6) Roll, pitch, yaw and position of a cabinet that moves; the positions are
            seen from it. None for a fixed one. [rad, m]
        left: (wet,) Share of water that is left in each wet mass of the load; None for all of it.
        balls: (n, balls, 3) places in D of the balls of each ring on the drum, by its name. [m]
    """

    time: FloatArray
    positions: FloatArray
    speed: FloatArray
    cabinet: FloatArray | None = None
    left: FloatArray | None = None
    balls: Mapping[str, FloatArray] = field(default_factory=dict)


def replay_page(
    parameters: MachineParameters,
    motion: Motion,
    *,
    title: str = "",
    load: Load | None = None,
    gasket: bool = True,
) -> str:
    """Return a self-contained HTML page that replays a motion in 3D.

    Args:
        motion: The motion, with at least one sample.
        title: Title of the page; that of the machine if empty.
        load: Point masses in the drum; they turn with it.
    """
    try:
        return _drawn_page(parameters, motion, title, load, gasket)
    finally:
        # The diagram and its Meshcat refer to each other, and a Meshcat that the garbage collector
        # finds in another thread ends the process.
        gc.collect()


def _drawn_page(
    parameters: MachineParameters, motion: Motion, title: str, load: Load | None, gasket: bool
) -> str:
    logging.getLogger("drake").setLevel(logging.WARNING)  # it would print the address of Meshcat
    meshcat = Meshcat(MeshcatParams(host="localhost"))  # reachable from this computer only
    for hidden in ("/Grid", "/Axes"):
        meshcat.SetProperty(hidden, "visible", False)
    meshcat.SetProperty("/Background", "top_color", [1.0, 1.0, 1.0])
    meshcat.SetProperty("/Background", "bottom_color", [0.86, 0.88, 0.91])
    meshcat.SetCameraPose(camera_in_world=[0.5, -1.15, 0.34], target_in_world=[0.0, 0.0, -0.04])
    parameters = with_fixed_cabinet(parameters)
    scene = Scene(parameters, meshcat)
    parts = [
        *_parts(scene, parameters, gasket),
        *_rings(parameters, motion.balls),
        *_unbalances(load, motion.left),
    ]
    for part in parts:
        part.add(meshcat)

    def move_parts(moment: float) -> None:
        number = int(np.argmin(np.abs(motion.time - motion.time[0] - moment)))
        poses = scene.pose_in_world("tub"), scene.pose_in_world("drum")
        frame = _Frame(moment, *poses, number)
        for part in parts:
            part.move(meshcat, frame)
        _move_cabinet(meshcat, motion, frame)

    if motion.cabinet is not None and parameters.cabinet is not None:
        add_floor(meshcat, parameters.cabinet.floor)
    scene.animate(meshcat, motion.time, motion.positions, move_parts)
    title = title or f"Machine {parameters.name}"
    return _with_caption(str(meshcat.StaticHtml()), motion, title, [part.kind for part in parts])


@dataclass(frozen=True)
class _Frame:
    """One frame of a replay: time in the animation [s], poses of tub and drum, number of sample."""

    moment: float
    X_WT: RigidTransform
    X_WD: RigidTransform
    number: int = 0


def _move_cabinet(meshcat: Meshcat, motion: Motion, frame: _Frame) -> None:
    """Record the pose of a cabinet that moves, with all that is drawn in its frame."""
    if motion.cabinet is None:
        return
    X_WC = cabinet_pose(motion.cabinet[frame.number])
    for path in (SHAPES, "/elements"):
        meshcat.SetTransform(path, X_WC, frame.moment)


class _Part:
    """A drawn part: what it is, its shapes, and where they are at a pose."""

    kind = ""

    def add(self, meshcat: Meshcat) -> None:
        """Add the shapes."""

    def move(self, meshcat: Meshcat, frame: _Frame) -> None:
        """Record the poses of the shapes in a frame of the replay."""


@dataclass(frozen=True)
class _Strut(_Part):
    """Part between a point of the tub and a point of the housing."""

    path: str
    p_ToA_T: FloatArray
    p_WH: FloatArray
    rest_length: float

    def line(self, X_WT: RigidTransform) -> tuple[FloatArray, float, RotationMatrix]:
        """Return tub end, length and a rotation whose z axis points to the tub end, in W."""
        p_WA = X_WT @ self.p_ToA_T
        length = float(np.linalg.norm(p_WA - self.p_WH))
        return p_WA, length, RotationMatrix.MakeFromOneVector(p_WA - self.p_WH, 2)


class _Spring(_Strut):
    kind = "spring"

    def add(self, meshcat: Meshcat) -> None:
        vertices, faces = coil(self.rest_length)
        meshcat.SetTriangleMesh(self.path, vertices, faces, SPRING_COLOUR)

    def move(self, meshcat: Meshcat, frame: _Frame) -> None:
        _, length, rotation = self.line(frame.X_WT)
        meshcat.SetTransform(self.path, RigidTransform(rotation, self.p_WH), frame.moment)
        _stretch(meshcat, self.path, length / self.rest_length, frame.moment)


class _Damper(_Strut):
    kind = "damper"

    def add(self, meshcat: Meshcat) -> None:
        tube, rod = TUBE_SHARE * self.rest_length, ROD_SHARE * self.rest_length
        for name, length, radius, colour, side in (
            ("tube", tube, TUBE_RADIUS, DAMPER_COLOUR, -1.0),
            ("rod", rod, ROD_RADIUS, ROD_COLOUR, 1.0),
        ):
            shape = f"{self.path}/{name}/shape"
            meshcat.SetObject(shape, Cylinder(radius, length), colour)
            meshcat.SetTransform(shape, RigidTransform([0.0, 0.0, 0.5 * side * length]))

    def move(self, meshcat: Meshcat, frame: _Frame) -> None:
        p_WA, _, rotation = self.line(frame.X_WT)
        meshcat.SetTransform(f"{self.path}/tube", RigidTransform(rotation, p_WA), frame.moment)
        meshcat.SetTransform(f"{self.path}/rod", RigidTransform(rotation, self.p_WH), frame.moment)


@dataclass(frozen=True)
class _Gasket(_Part):
    """Two rings, on the tub and on the housing, and the hose between them as staves."""

    path: str
    X_TG: RigidTransform
    X_WH: RigidTransform
    kind = "gasket"

    def add(self, meshcat: Meshcat) -> None:
        for end in ("tub", "housing"):
            vertices, faces = ring(GASKET_RADIUS, 0.006)
            meshcat.SetTriangleMesh(f"{self.path}/{end}", vertices, faces, RING_COLOUR)
        width = 2.0 * np.pi * GASKET_RADIUS / STAVES
        for name in self._staves():
            shape = f"{name}/shape"
            meshcat.SetObject(shape, Box(width, 0.002, GASKET_DEPTH), GASKET_COLOUR)
            meshcat.SetTransform(shape, RigidTransform([0.0, 0.0, 0.5 * GASKET_DEPTH]))
            # drawn before the transparent walls, which would hide it otherwise
            meshcat.SetProperty(shape, "renderOrder", -1.0)

    def _staves(self) -> list[str]:
        return [f"{self.path}/stave_{index}" for index in range(STAVES)]

    def move(self, meshcat: Meshcat, frame: _Frame) -> None:
        X_WG = frame.X_WT @ self.X_TG @ RigidTransform([0.0, GASKET_DEPTH, 0.0])
        meshcat.SetTransform(f"{self.path}/tub", X_WG, frame.moment)
        meshcat.SetTransform(f"{self.path}/housing", self.X_WH, frame.moment)
        for index, name in enumerate(self._staves()):
            turn = 2.0 * np.pi * index / STAVES
            radial = np.array([np.cos(turn), 0.0, np.sin(turn)])
            begin, end = self.X_WH @ (GASKET_RADIUS * radial), X_WG @ (GASKET_RADIUS * radial)
            along = (end - begin) / max(float(np.linalg.norm(end - begin)), 1e-9)
            tangent = self.X_WH.rotation() @ np.array([-np.sin(turn), 0.0, np.cos(turn)])
            across = np.cross(along, tangent)
            across /= np.linalg.norm(across)
            rotation = RotationMatrix(np.column_stack([np.cross(across, along), across, along]))
            meshcat.SetTransform(name, RigidTransform(rotation, begin), frame.moment)
            _stretch(meshcat, name, float(np.linalg.norm(end - begin)) / GASKET_DEPTH, frame.moment)


@dataclass(frozen=True)
class _Ball(_Part):
    """Point mass in the drum, as a ball: its places (n, 3) or (1, 3) in D."""

    path: str
    places: FloatArray
    radius: float
    colour: Rgba
    kind: str = "unbalance"

    def add(self, meshcat: Meshcat) -> None:
        meshcat.SetObject(self.path, Sphere(self.radius), self.colour)

    def move(self, meshcat: Meshcat, frame: _Frame) -> None:
        X_DU = RigidTransform(self.places[min(frame.number, len(self.places) - 1)])
        meshcat.SetTransform(self.path, frame.X_WD @ X_DU, frame.moment)


@dataclass(frozen=True)
class _Circle(_Part):
    """Circle about the drum axis."""

    path: str
    p_DoC_D: FloatArray
    radius: float
    kind = "balancer"

    def add(self, meshcat: Meshcat) -> None:
        meshcat.SetTriangleMesh(self.path, *ring(self.radius, RACE_WIRE), RACE_COLOUR)

    def move(self, meshcat: Meshcat, frame: _Frame) -> None:
        meshcat.SetTransform(self.path, frame.X_WD @ RigidTransform(self.p_DoC_D), frame.moment)


def _parts(scene: Scene, parameters: MachineParameters, gasket: bool) -> Iterator[_Part]:
    """Yield the drawn parts of a machine; damper tubes that are bodies are shapes of the SDF."""
    elements = placed_elements(scene.plant, FramePoses(scene.plant, parameters), parameters)
    for kind, of_kind, placed in (
        ("springs", _Spring, elements.springs),
        ("dampers", _Damper, elements.dampers),
    ):
        for name, element in placed.items():
            length = float(np.linalg.norm(element.p_ToA_T - element.p_WH))
            yield of_kind(f"/elements/{kind}/{name}", element.p_ToA_T, element.p_WH, length)
    for name, other in elements.others.items():
        if other.kind.picture == "strut" and isinstance(other.ends, Ends):
            ends = other.ends.tub_point, other.ends.housing_point
            length = float(np.linalg.norm(ends[0] - ends[1]))
            yield _Damper(f"/elements/others/{name}", *ends, length)
    if gasket and "gasket" in elements.bushings:
        poses, law = FramePoses(scene.plant, parameters), parameters.gasket
        assert law is not None  # the placed elements have it
        tub, housing = (
            RigidTransform(RotationMatrix(rotation), point)
            for point, rotation in (poses("tub", law.tub_frame), poses("world", law.housing_frame))
        )
        yield _Gasket("/elements/gasket", tub, housing)


def _rings(parameters: MachineParameters, balls: Mapping[str, FloatArray]) -> Iterator[_Part]:
    """Yield the rings on the drum and what moves in them; `balls` as in `Motion`."""
    for name, element in parameters.elements.items():
        drawn, path = element_kind(element.kind).ring, f"/elements/rings/{name}"
        if drawn is None or not isinstance(element, DrumElement):
            continue
        for number, field_name in enumerate(drawn.radii):
            centre, radius = np.array([0.0, element.y, 0.0]), getattr(element, field_name)
            yield _Circle(f"{path}/circle_{number}", centre, radius)
        colour, kind = (WATER_COLOUR, "liquid") if drawn.is_liquid else (BALL_COLOUR, "ball")
        for number, places in enumerate(np.moveaxis(balls.get(name, np.empty((0, 0, 3))), 1, 0)):
            across = 0.5 * getattr(element, drawn.across)
            yield _Ball(f"{path}/ball_{number}", places, across, colour, kind)


def ball_radius(mass: float) -> float:
    """Return the radius of the ball that stands for a mass of laundry. [m]"""
    return float((3.0 * mass / (4.0 * np.pi * DENSITY)) ** (1.0 / 3.0))


def _unbalances(load: Load | None, left: FloatArray | None) -> Iterator[_Part]:
    """Yield the masses of a load: the more water is in one, the larger and bluer it is."""
    if load is None:
        return
    left = np.ones(len(load.wet)) if left is None else left
    water = dict(zip(load.wet, left.tolist(), strict=True))
    for index, (unbalance, mass) in enumerate(zip(load.unbalances, load.masses(left), strict=True)):
        radius = ball_radius(mass)
        wet = water.get(index, 0.0)
        ends = zip(UNBALANCE_COLOUR.rgba, WATER_COLOUR.rgba, strict=True)
        colour = Rgba(*(dry + wet * (blue - dry) for dry, blue in ends))
        place = np.array([unbalance.position()])
        yield _Ball(f"/elements/unbalance/{index}", place, radius, colour)


def _stretch(meshcat: Meshcat, path: str, factor: float, moment: float) -> None:
    """Record the stretch of a shape along its z axis."""
    meshcat.SetProperty(path, "scale", [1.0, 1.0, factor], moment)


def coil(length: float) -> tuple[FloatArray, np.ndarray]:
    """Return vertices (3, n) [m] and faces (3, m) of a spring of wire along z, from 0 to length."""
    turns = np.linspace(0.0, 2.0 * np.pi * COILS, 16 * COILS + 1)
    centre = np.stack(
        [COIL_RADIUS * np.cos(turns), COIL_RADIUS * np.sin(turns), length * turns / turns[-1]]
    )
    outwards = np.stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    upwards = np.tile([[0.0], [0.0], [1.0]], len(turns))
    return _tube(centre, outwards, upwards, WIRE_RADIUS)


def ring(radius: float, wire: float) -> tuple[FloatArray, np.ndarray]:
    """Return vertices (3, n) [m] and faces (3, m) of a ring about the y axis."""
    turns = np.linspace(0.0, 2.0 * np.pi, 49)
    outwards = np.stack([np.cos(turns), 0.0 * turns, np.sin(turns)])
    along = np.tile([[0.0], [1.0], [0.0]], len(turns))
    return _tube(radius * outwards, outwards, along, wire)


def _tube(
    centre: FloatArray, first: FloatArray, second: FloatArray, radius: float, sides: int = 6
) -> tuple[FloatArray, np.ndarray]:
    """Return the mesh of a tube around a line; first and second span its cross sections. (3, n)"""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    vertices = centre[:, :, None] + radius * (
        first[:, :, None] * np.cos(angles) + second[:, :, None] * np.sin(angles)
    )
    count = centre.shape[1]
    near = np.arange((count - 1) * sides)
    neighbour = near - near % sides + (near + 1) % sides
    faces = np.hstack(
        [[near, neighbour, near + sides], [neighbour, neighbour + sides, near + sides]]
    )
    return vertices.reshape(3, -1), faces.astype(np.int32)


def _with_caption(page: str, motion: Motion, title: str, kinds: list[str]) -> str:
    """Return a Meshcat page with a title, a legend, and the time and drum speed of the replay.

    The numbers are read from the viewer's animation before each frame. An address that ends with
    `#t=12.5` opens the page at that time of the run, paused.
    """
    rpm = Unit("rad/s", "rpm").from_si(1.0)
    data = {
        "time": [round(float(t), 4) for t in motion.time],
        "rpm": [round(float(rpm * speed), 1) for speed in motion.speed],
    }
    is_wet = motion.left is not None and motion.left.size > 0
    kinds = [*kinds, "water"] if is_wet else kinds
    shown = [
        f'<span style="color:{colour}">&#9632;</span> {kind}'
        for kind, colour in LEGEND.items()
        if kind in kinds
    ]
    caption = CAPTION.replace("TITLE", html.escape(title)).replace("LEGEND", " ".join(shown))
    caption = caption.replace("DATA", json.dumps(data))
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{html.escape(title)}</title>", 1)
    body, end, rest = page.rpartition("</body>")
    return f"{body}{caption}{end}{rest}"


LEGEND = {
    "spring": "#0072b2",
    "damper": "#e69f00",
    "gasket": "#009e73",
    "unbalance": "#d55e00",
    "balancer": "#333333",
    "ball": "#404047",
    "liquid": "#0052cc",
    "water": "#0052cc",
}
"""Colours of the legend, the same as those of the shapes."""

CAPTION = """
<div id="caption" style="position:fixed;left:14px;top:12px;padding:8px 12px;border-radius:4px;
background:rgba(255,255,255,.85);color:#1f2933;font:15px/1.5 system-ui,sans-serif;
max-width:60vw;pointer-events:none">
<div style="font-weight:600">TITLE</div>
<div id="moment" style="font-variant-numeric:tabular-nums"></div>
<div style="font-size:13px">LEGEND</div>
</div>
<script>
(function () {
  const motion = DATA, begin = motion.time[0], last = motion.time.length - 1;
  const wanted = /[#&]t=([0-9.]+)/.exec(location.hash);
  let waiting = wanted !== null;
  function show() {
    const animator = viewer.animator;
    if (waiting && animator.actions.length) {
      const time = Math.max(0, parseFloat(wanted[1]) - begin);
      animator.pause(); animator.seek(time); animator.time = time; waiting = false;
    }
    const time = begin + Math.min(animator.time, motion.time[last] - begin);
    let next = motion.time.findIndex(t => t >= time);
    if (next < 0) next = last;
    const before = Math.max(0, next - 1), span = motion.time[next] - motion.time[before];
    const part = span > 0 ? (time - motion.time[before]) / span : 1;
    const rpm = motion.rpm[before] + part * (motion.rpm[next] - motion.rpm[before]);
    document.getElementById("moment").textContent =
      "time " + time.toFixed(2) + " s, drum speed " + rpm.toFixed(0) + " rpm";
    requestAnimationFrame(show);
  }
  show();
})();
</script>
"""
"""Caption of a replay; the words in capitals are replaced."""
