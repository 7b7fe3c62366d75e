"""Pictures of the manual that are drawn from the code: curves of laws, geometry of machines.

A page asks for one by the mark `<!-- picture NAME -->`. Nothing is typed twice: a curve calls the
function that the engines call, and a machine is the one of its file.
"""

import functools
import io
import re
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from pydantic import TypeAdapter

import wm_drake as wm
from wm_drake.compiler.vectors import rotation_vector
from wm_drake.laws import foot_contact, friction, motor, rubber
from wm_drake.laws.bushing import bushing_force
from wm_drake.laws.feet import turning_margin
from wm_drake.laws.spring import spring_tension
from wm_drake.laws.strut import bending_moment
from wm_drake.laws.table import pack_number
from wm_drake.parameters.damper_laws import DAMPER_LAWS, DamperType
from wm_drake.parameters.elements import ForceTable
from wm_drake.rigs import Harmonic, damper_bench, force_loops

PICTURES: dict[str, tuple[str, Callable[[], Figure]]] = {}
"""Alternative text and function of each picture by its name."""

COORDINATE = {"x": 0, "y": 1, "z": 2}
VIEWS = (("x", "z", "from the door"), ("y", "z", "from the right"), ("x", "y", "from above"))
BLUE, ORANGE, GREEN, RED = "tab:blue", "tab:orange", "tab:green", "tab:red"


def picture(name: str, alternative: str) -> Callable[[Callable[[], Figure]], Callable[[], Figure]]:
    """Register a function that draws a picture."""

    def registered(draw: Callable[[], Figure]) -> Callable[[], Figure]:
        PICTURES[name] = alternative, draw
        return draw

    return registered


def svg_of(name: str) -> str:
    """Return a picture as SVG on white ground, with its alternative text."""
    alternative, draw = PICTURES[name]
    file = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "font.size": 9, "svg.fonttype": "path"}):
        figure = draw()
        figure.set_layout_engine("tight")
        figure.savefig(file, format="svg", metadata={"Date": None})
    svg = file.getvalue()
    svg = re.sub(r"\n\s*", " ", svg[svg.index("<svg ") :])
    svg = re.sub(r'(id="|xlink:href="#|url\(#)(?=DejaVu)', rf"\g<1>{name}-", svg)
    title = f'role="img" aria-label="{alternative}"'
    return f'<div class="drawn">{svg.replace("<svg ", f"<svg {title} ", 1)}</div>'


def _axes(columns: int = 1, height: float = 3.0, **options: Any) -> tuple[Figure, Any]:
    figure = Figure(figsize=(9.0, height))
    axes = figure.subplots(1, columns, **options)
    for one in np.atleast_1d(axes):
        one.grid(alpha=0.3)
    return figure, axes


# curves of laws ---------------------------------------------------------------------------------


@picture("friction", "Friction force over velocity for four laws")
def friction_curves() -> Figure:
    """Draw the friction laws over the velocity."""
    v = np.linspace(-20e-3, 20e-3, 801)
    figure, axes = _axes()
    for name, force in {
        "Coulomb": [friction.coulomb_friction(x, 40.0) for x in v],
        "STV, full at 8 mm/s": [friction.stv_friction(x, 8e-3, 40.0) for x in v],
        "HAVSIN, full at 8 mm/s": [friction.havsin_friction(x, 8e-3, 40.0) for x in v],
        "MSTV, strut at 8 mm/s": [friction.mstv_friction(x, 8e-3 - x, 40.0, 0.0, 1e-6) for x in v],
    }.items():
        axes.plot(1e3 * v, force, label=name)
    axes.set(xlabel="velocity of the slider, mm/s", ylabel="friction, N")
    axes.legend()
    return figure


NUMBERS = {
    "friction_force": "40 N",
    "damping": "0.1 N s/mm",
    "transition_velocity": "8 mm/s",
    "full_friction_velocity": "8 mm/s",
    "sponge_stiffness": "100 N/mm",
    "sponge_damping": "0.1 N s/mm",
    "slider_damping": "0.2 N s/mm",
    "friction_damping": "0.05 N s/mm",
    "basic_friction_force": "10 N",
    "basic_full_friction_velocity": "90 mm/s",
    "sponge": {"displacement": "(-0.8, -0.3, 0.3, 0.8) mm", "force": "(-60, 0, 0, 60) N"},
}
"""Numbers of the damper laws, in the range of the papers."""


@picture("dampers", "Force loops of each damper law at 1 mm, 1 and 10 Hz")
def damper_loops() -> Figure:
    """Draw a force loop of each law of the registry."""
    figure = Figure(figsize=(9.0, 5.5))
    all_axes = figure.subplots(2, 3, sharex=True, sharey=True)
    for axes, law in zip(all_axes.flat, DAMPER_LAWS.values(), strict=True):
        numbers = {name: NUMBERS[name] for name in law.fields if name in NUMBERS}
        damper = TypeAdapter(DamperType).validate_python({"law": law.name, **numbers})
        motions = [Harmonic(frequency, 1e-3) for frequency in (1.0, 10.0)]
        loops = force_loops(damper_bench(damper), motions)
        for motion, loop in zip(motions, loops, strict=True):
            axes.plot(1e3 * loop.displacement, loop.force, label=f"{motion.frequency:g} Hz")
        axes.set_title(f"{law.name}: {law.equations}", fontsize=8)
        axes.grid(alpha=0.3)
    all_axes[0, 0].legend()
    figure.supxlabel("displacement, mm")
    figure.supylabel("force, N")
    return figure


@picture("table", "Force over displacement of a stiffness given as a table")
def table_curve() -> Figure:
    """Draw a stiffness that is a table."""
    table = ForceTable(displacement="(-20, -10, 0, 10, 20) mm", force="(-70, -30, 0, 30, 70) N")
    x = np.linspace(-28e-3, 28e-3, 300)
    figure, axes = _axes()
    axes.plot(1e3 * x, table.values(x), label="monotone cubic, straight beyond the ends")
    axes.plot([-20, -10, 0, 10, 20], [-70, -30, 0, 30, 70], "o", label="points of the table")
    axes.set(xlabel="displacement, mm", ylabel="force, N")
    axes.legend()
    return figure


@picture("bushing", "Force and torque of a bushing over displacement, rate and angle")
def bushing_curves() -> Figure:
    """Draw force and torque of one axis of a bushing."""
    names = [f"{kind}{axis}" for axis in "xyz" for kind in ("", "rotational_")]
    numbers: dict[str, Any] = {}
    for name in names:
        kind, axis = name[:-1], name[-1]
        numbers[f"{kind}stiffness_{axis}"] = (pack_number(3000.0 if not kind else 20.0), 0)
        numbers[f"{kind}damping_{axis}"] = 20.0 if not kind else 0.5
    for axis in "xyz":
        numbers[f"friction_torque_{axis}"] = 0.8
        numbers[f"full_friction_rate_{axis}"] = 0.3
    law = SimpleNamespace(**numbers)
    none = (0.0, 0.0, 0.0)
    figure, (left, right) = _axes(2)
    d = np.linspace(-5e-3, 5e-3, 50)
    for rate in (-0.1, 0.0, 0.1):
        force = [
            bushing_force.py_func((x, 0.0, 0.0), (rate, 0.0, 0.0), none, none, law)[0][0] for x in d
        ]
        left.plot(1e3 * d, force, label=f"rate {1e3 * rate:g} mm/s")
    left.set(
        xlabel="displacement d, mm", ylabel="force F, N", title="along an axis: spring, dashpot"
    )
    w = np.linspace(-1.0, 1.0, 201)
    for angle in (-0.02, 0.0, 0.02):
        turned = (angle, 0.0, 0.0)
        torque = [bushing_force.py_func(none, none, turned, (x, 0.0, 0.0), law)[1][0] for x in w]
        right.plot(w, torque, label=f"angle {angle:g} rad")
    right.set(xlabel="rate r', rad/s", ylabel="torque T, N m", title="about an axis: with friction")
    left.legend()
    right.legend()
    return figure


@picture("rotation-vector", "A bushing's rotation vector beside roll, pitch and yaw")
def rotation_vector_curves() -> Figure:
    """Draw the rotation vector of a frame that is rolled and yawed, beside the angles."""
    from pydrake.math import RollPitchYaw

    angle = np.linspace(0.0, 0.6, 40)
    matrices = [RollPitchYaw(x, 0.0, x).ToRotationMatrix().matrix() for x in angle]
    vectors = np.array([rotation_vector(tuple(matrix.ravel())) for matrix in matrices])
    figure, axes = _axes()
    for k, name in enumerate("xyz"):
        axes.plot(np.rad2deg(angle), np.rad2deg(vectors[:, k]), label=f"rotation vector, {name}")
    axes.plot(np.rad2deg(angle), np.rad2deg(angle), "k:", label="roll and yaw (pitch is 0)")
    axes.set(xlabel="roll = yaw, degrees", ylabel="degrees")
    axes.legend()
    return figure


@picture("rubber", "Force loops of Dahl friction and of a Maxwell branch")
def rubber_loops() -> Figure:
    """Draw loops of the branches of rubber."""
    figure, (left, right) = _axes(2)
    limit, x_c = 4.0, 0.5e-3
    for amplitude in (0.2e-3, 1e-3, 2e-3):
        phase = np.linspace(0.0, 4.0 * np.pi, 1601)
        x = amplitude * np.sin(phase)
        z = np.zeros_like(x)
        for i in range(1, len(x)):
            z[i] = rubber.dahl_after_path(z[i - 1], x[i] - x[i - 1], x_c)
        left.plot(1e3 * x[800:], limit * z[800:] / x_c, label=f"{1e3 * amplitude:g} mm")
    left.set(xlabel="displacement, mm", ylabel="force, N", title="Dahl friction, at any frequency")
    stiffness, damping = 800.0, 40.0
    for frequency in (0.3, 3.0, 30.0):
        time = np.linspace(0.0, 6.0 / frequency, 2401)
        x = 1e-3 * np.sin(2.0 * np.pi * frequency * time)
        z = np.zeros_like(x)
        for i in range(1, len(x)):
            step = time[i] - time[i - 1]
            z[i] = rubber.maxwell_after_path(z[i - 1], x[i] - x[i - 1], step, stiffness, damping)
        right.plot(1e3 * x[2000:], stiffness * z[2000:], label=f"{frequency:g} Hz")
    right.set(xlabel="displacement, mm", title="Maxwell branch, 1 mm")
    left.legend()
    right.legend()
    return figure


@picture("springs", "Tension of a spring over its length, and bending moment of a strut")
def spring_curves() -> Figure:
    """Draw the tension of a spring that may go slack, and the moment of an end bushing."""
    figure, (left, right) = _axes(2)
    length = np.linspace(0.16, 0.24, 300)
    for name, taut in (("tension-only", 5.7), ("tension-compression", -np.inf)):
        tension = [spring_tension(x, 0.209, 133.0, taut, (pack_number(5664.0), 0)) for x in length]
        left.plot(1e3 * length, tension, label=name, ls="-" if taut > 0 else "--")
    left.set(xlabel="length, mm", ylabel="tension t, N", title="suspension spring")
    left.legend()
    rates = np.linspace(-0.5, 0.5, 201)
    for angle in (-0.1, 0.0, 0.1):
        axis = (0.0, -np.sin(angle), np.cos(angle))
        numbers = (7.5, 0.5, 0.8, 0.1)
        moment = [bending_moment((0.0, 0.0, 1.0), (x, 0.0, 0.0), axis, *numbers)[0] for x in rates]
        right.plot(rates, moment, label=f"bent by {angle:g} rad")
    right.set(
        xlabel="rate a', rad/s", ylabel="moment m, N m", title="bushing at the end of a strut"
    )
    right.legend()
    return figure


@picture("drive", "Torque limit of a motor over its speed, and friction of the drum's bearing")
def drive_curves() -> Figure:
    """Draw the limit of a motor's torque and the friction of the drum."""
    drive = wm.load_machine("motor").drive
    limit = SimpleNamespace(
        torque=drive.torque_limit.torque,
        base_speed=drive.torque_limit.power / drive.torque_limit.torque,
        table=(pack_number(0.0), 0),
    )
    figure, (left, right) = _axes(2)
    rpm = np.linspace(0.0, 12000.0, 300)
    left.plot(rpm, [motor.torque_limit.py_func(x * np.pi / 30.0, limit) for x in rpm])
    left.set(
        xlabel="speed of the motor, rpm", ylabel="N m", title="torque limit T_max", ylim=(0, None)
    )
    rate = np.linspace(-5.0, 5.0, 401)
    values = SimpleNamespace(
        friction_torque=drive.bearing_friction.friction_torque,
        full_friction_rate=drive.bearing_friction.full_friction_rate,
        damping=drive.bearing_friction.damping,
    )
    right.plot(rate, [motor.drum_friction.py_func(x, values) for x in rate])
    right.set(xlabel="rate of the drum, rad/s", ylabel="N m", title="friction of bearing and seal")
    return figure


@picture("feet", "Turning margin over the horizontal load; forces of a pad")
def feet_curves() -> Figure:
    """Draw the turning margin of four feet, and the laws of a pad."""
    figure, (first, second, third) = _axes(3)
    x, y = (-0.26, 0.26, 0.26, -0.26), (-0.26, -0.26, 0.26, 0.26)
    force = np.linspace(0.0, 119.0, 60)
    for moment in (0.0, 15.0, 30.0):
        margin = [turning_margin(f, 0.0, moment, (30.0,) * 4, x, y) for f in force]
        first.plot(force, margin, label=f"moment {moment:g} N m")
    first.set(xlabel="horizontal force, N", ylabel="N m", title="turning margin of four feet")
    first.legend()
    d = np.linspace(-0.5e-3, 1e-3, 300)
    for rate in (-0.05, 0.0, 0.05):
        normal = [foot_contact.pad_normal_force(c, rate, 150e3, 400.0, 5e3) for c in d]
        second.plot(1e3 * d, normal, label=f"{1e3 * rate:g} mm/s")
    second.set(xlabel="compression d, mm", ylabel="N", title="normal force of a pad")
    second.legend()
    s = np.linspace(-2e-3, 2e-3, 300)
    pulled = [foot_contact.pad_friction((z, 0.0), (0.0, 0.0), 50e3, 200.0, 40.0)[0] for z in s]
    third.plot(1e3 * s, pulled)
    third.set(xlabel="shear s, mm", ylabel="N", title="friction of a pad, limit 40 N")
    return figure


# machines ---------------------------------------------------------------------------------------


@functools.cache
def described(name: str) -> dict[str, Any]:
    """Return the description of a shipped machine."""
    return wm.describe(wm.build_machine(wm.load_machine(name)))


def _three_views(height: float) -> tuple[Figure, list[tuple[Axes, list[int], str]]]:
    figure = Figure(figsize=(11.0, height))
    all_axes = figure.subplots(1, 3, width_ratios=(1.4, 1, 1))
    views = []
    for axes, (right, up, title) in zip(all_axes, VIEWS, strict=True):
        axes.set(title=title, xlabel=f"{right}, mm", ylabel=f"{up}, mm")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.2)
        axes.grid(alpha=0.2)
        views.append((axes, [COORDINATE[right], COORDINATE[up]], title))
    return figure, views


def _named(axes: Axes, text: str, place: Any, colour: str) -> None:
    axes.annotate(
        text.replace("_", " "),
        place,
        xytext=(7, -3),
        textcoords="offset points",
        fontsize=8,
        color=colour,
    )


@picture("geometry", "Springs, dampers, gasket, sensors and feet of the reference machine")
def geometry() -> Figure:
    """Draw the attachment points of the reference machine, in three views."""
    shown = described("reference")
    figure, views = _three_views(4.6)
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    for axes, pair, title in views:
        is_front = title == "from the door"
        for kind, colour, seen_from in (
            ("springs", BLUE, "from the door"),
            ("dampers", ORANGE, "from above"),
        ):
            for name, element in shown[kind].items():
                ends = 1e3 * np.array([element["tub_point_T"], element["housing_point_W"]])
                axes.plot(*ends[:, pair].T, "o-", color=colour, ms=3)
                if title == seen_from:
                    _named(axes, name, ends[1, pair], colour)
        for name, sensor in shown["sensors"].items():
            place = 1e3 * np.array(sensor["point_T"])[pair]
            axes.plot(*place, "s", color=GREEN, ms=3)
            _named(axes, name, place, GREEN)
        gasket = 1e3 * np.array(shown["bushings"]["gasket"]["tub_point_T"])[pair]
        axes.plot(*gasket, "D", color=RED, ms=5)
        if not is_front:
            _named(axes, "gasket", gasket, RED)
        if is_front:
            axes.plot(250.0 * np.cos(angle), 250.0 * np.sin(angle), color="0.7", lw=1)
        for tip in ((110, 0), (0, 110)):
            axes.annotate("", tip, (0, 0), arrowprops={"arrowstyle": "->"})
        axes.text(115, 0, "xyz"[pair[0]], va="center")
        axes.text(0, 115, "xyz"[pair[1]], ha="center")
    return figure


@picture(
    "load", "Radius, phase and place along the drum of an unbalance, and the sense of rotation"
)
def load_picture() -> Figure:
    """Draw where the unbalance of a load is."""
    figure = Figure(figsize=(9.0, 3.8))
    front, side = figure.subplots(1, 2, width_ratios=(1, 1))
    radius, phase, y = 235.0, np.deg2rad(40.0), -80.0
    place = radius * np.array([np.sin(phase), np.cos(phase)])
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    front.plot(250.0 * np.sin(turn), 250.0 * np.cos(turn), color="0.6")
    front.plot([0, place[0]], [0, place[1]], color=RED)
    front.plot(*place, "o", color=RED, ms=9)
    front.plot([0, 0], [0, 250], "--", color="0.5", lw=1)
    front.add_patch(Arc((0, 0), 160, 160, theta1=50, theta2=90, color=RED))
    front.text(30, 95, "phase", color=RED, ha="center")
    front.text(85, 60, "radius", color=RED, rotation=50)
    front.annotate(
        "", (275 * np.sin(2.2), 275 * np.cos(2.2)), (275 * np.sin(1.3), 275 * np.cos(1.3)),
        arrowprops={"arrowstyle": "->", "connectionstyle": "arc3,rad=-0.25", "color": BLUE},
    )  # fmt: skip
    front.text(300, -40, "positive\nspeed", color=BLUE)
    front.set(title="from the door", xlabel="x, mm", ylabel="z, mm", xlim=(-320, 420))
    front.set_aspect("equal")
    side.plot([-170, 150, 150, -170, -170], [-250, -250, 250, 250, -250], color="0.6")
    side.axhline(0.0, color="0.5", lw=1, ls="--")
    side.plot(y, place[1], "o", color=RED, ms=9)
    side.annotate("", (y, -40), (0, -40), arrowprops={"arrowstyle": "<->", "color": RED})
    side.text(y / 2, -75, "y < 0", color=RED, ha="center")
    side.axvline(0.0, color="0.5", lw=1, ls=":")
    side.set(title="from the right (door: left)", xlabel="y, mm", ylabel="z, mm")
    side.set_aspect("equal")
    return figure


@picture("tubes", "Telescopic dampers of the machine free_stroke: tubes and their bushings")
def tubes() -> Figure:
    """Draw the telescopic dampers of a machine."""
    shown = described("free_stroke")
    figure, views = _three_views(3.8)
    for axes, pair, title in views:
        for name, element in shown["telescopic_dampers"].items():
            ends = 1e3 * np.array([element["tub_point_T"], element["housing_point_W"]])
            middle = ends.mean(axis=0)
            axes.plot(*np.array([ends[0], middle])[:, pair].T, color=ORANGE, lw=7, alpha=0.5)
            axes.plot(*np.array([middle, ends[1]])[:, pair].T, color=ORANGE, lw=3)
            axes.plot(*ends[:, pair].T, "o", color=RED, ms=6)
            if title == "from the right":
                _named(axes, name, ends[1, pair], ORANGE)
    axes, pair, _ = views[0]
    axes.plot([], [], color=ORANGE, lw=7, alpha=0.5, label="outer tube, at the tub")
    axes.plot([], [], color=ORANGE, lw=3, label="inner tube, at the housing")
    axes.plot([], [], "o", color=RED, label="bushings")
    axes.legend(fontsize=8)
    return figure


@picture("cabinet", "Feet, centre of mass and floor of the cabinet of the reference machine")
def cabinet() -> Figure:
    """Draw the cabinet of the reference machine on its feet."""
    values = described("reference")["cabinet"]
    centre = 1e3 * np.array(values["centre_of_mass"])
    floor = 1e3 * values["floor"]
    figure = Figure(figsize=(9.0, 3.6))
    above, front = figure.subplots(1, 2)
    for name, foot in values["feet"].items():
        place = 1e3 * foot["x"], 1e3 * foot["y"]
        above.plot(*place, "o", color=ORANGE, ms=8)
        _named(above, name, place, ORANGE)
        front.plot(place[0], floor, "^", color=ORANGE, ms=8)
    above.plot(*centre[:2], "x", color=RED)
    _named(above, "centre_of_mass", centre[:2], RED)
    above.set(title="from above; the door is below", xlabel="x, mm", ylabel="y, mm")
    front.axhline(floor, color="0.5")
    front.text(0, floor + 12, "floor", ha="center")
    front.plot(centre[0], centre[2], "x", color=RED)
    front.plot(0, 0, "+", color="k", ms=12)
    front.text(8, 8, "origin of W: drum axis")
    front.set(title="from the door", xlabel="x, mm", ylabel="z, mm")
    for axes in (above, front):
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.35)
    return figure


@picture("profile", "Spin profile of the reference machine")
def profile() -> Figure:
    """Draw the spin profile of the reference machine."""
    values = described("reference")["profile"]
    figure, axes = _axes(height=2.4)
    axes.plot(values["time"], np.array(values["speed"]) * 30.0 / np.pi, "o-")
    axes.set(xlabel="time, s", ylabel="drum speed, rpm")
    return figure
