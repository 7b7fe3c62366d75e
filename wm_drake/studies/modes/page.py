"""Show the study of modes: figures, sentences and tables of its datasets."""

import re
from collections.abc import Mapping

import xarray as xr

from wm_drake.model.scene import Scene
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.modes import quantities as q
from wm_drake.studies.modes.data import of_gaps, of_names
from wm_drake.studies.modes.figures import (
    TITLES,
    amplitude_figure,
    campbell_figure,
    energy_figure,
    sensitivity_figure,
    shapes_figure,
)
from wm_drake.studies.modes.linearisation import AMPLITUDE, SLIDING, STUCK
from wm_drake.studies.modes.shapes import ANGLE_ARM, Nearness, about_nearness, nearness
from wm_drake.studies.modes.study import MachineModes, NaturalModes

AXES = (
    "Axes: for a person who faces the door, x points to the right, y along the drum axis from "
    "front to rear, and z up. Sway is along x, fore-aft along y, bounce along z; roll, pitch and "
    "yaw turn about x, y and z."
)


def modes_answer(result: MachineModes, replays: Mapping[str, str]) -> Answer:
    """Return the answer of the study.

    Args:
        replays: Pages of animations by name of the mode.
    """
    scene = Scene(result.parameters)
    every = {
        name: nearness(scene, result.rest_pose, result.modes[name], result.amplitude)
        for name in (SLIDING, STUCK)
    }
    gaps = {name: near for name, near in every.items() if near is not None}
    sentences = [summary(result), about_damping(result)]
    if SLIDING in gaps:
        sentences.append(about_nearness(gaps[SLIDING]))
    files = {f"replay_{re.sub('[^a-z]', '_', name)}.html": text for name, text in replays.items()}
    links = [
        (file, f"Animation of {name} in 3D") for file, name in zip(files, replays, strict=True)
    ]
    return Answer(
        f"Modes of machine {result.parameters.name}",
        " ".join(filter(None, sentences)),
        result.parameters,
        (
            over_speed_and_amplitude(result),
            shapes_part(result, scene, links),
            sensitivity_part(result),
            Part("Modes", (natural_modes_table(result), settings(result))),
            Part("Critical speeds", (critical_table(result),)),
            Part("Gap to the housing", (gap_table(result, gaps),) if gaps else ()),
            Part("Participation", (shapes_table(result),)),
        ),
        (("Load", result.load or "empty drum"), ("Gasket", "yes" if result.gasket else "no")),
        AXES,
        files,
    )


def settings(result: MachineModes) -> LabelledTable:
    """Return load, gasket and amplitude, for files."""
    values = {"load": ((), result.load), "gasket": ((), result.gasket)}
    amplitude = q.AMPLITUDE.variable((), result.amplitude)
    return LabelledTable("settings", xr.Dataset({**values, "amplitude": amplitude}))


def summary(result: MachineModes) -> str:
    """Return one paragraph about the modes."""
    sliding, stuck = (
        f"{q.FREQUENCY.number(modes[0].frequency_hz)} to {q.FREQUENCY.text(modes[-1].frequency_hz)}"
        for modes in (result.modes[SLIDING], result.modes[STUCK])
    )
    speeds = ", ".join(map(SPEED.number, result.critical_speeds))
    load = f"with load {result.load}" if result.load else "with an empty drum"
    meets = f"them at {speeds} {SPEED.unit_text}" if speeds else "none of them"
    return (
        f"{len(result.modes[SLIDING])} modes of the machine {load}"
        f"{'' if result.gasket else ' without gasket'}: {sliding} while friction slides, {stuck} "
        f"while it sticks. With sliding friction the unbalance meets {meets}."
    )


def about_damping(result: NaturalModes) -> str:
    """Return the sentence on modes without damping; "" if all modes have some."""
    when = {SLIDING: "while friction slides", STUCK: "while it sticks"}
    cases = []
    for name, words in when.items():
        modes = result.modes[name]
        undamped = [mode.name for mode in modes if not mode.is_damped]
        if undamped:
            which = "all modes" if len(undamped) == len(modes) else listed(undamped)
            cases.append(f"{which} {words}")
    if not cases:
        return ""
    return f"Undamped, as no damper and no gasket dissipates energy in them: {listed(cases)}."


def over_speed_and_amplitude(result: MachineModes) -> Part:
    """Return Campbell diagram and curves over the amplitude."""
    run_up = (
        " Triangles: speeds at which a sensor has its largest amplitude in a run-up with one of "
        "the machine's loads, computed with all forces."
    )
    campbell = Plot(
        campbell_figure(result),
        "Natural frequencies over the drum speed.",
        "Campbell diagram. The gyroscopic effect of the drum bends the curves. Names at the left: "
        "shapes of a drum that stands still; at the right: shapes at the highest speed. Where two "
        "curves come near each other, they exchange their shapes. Whirl: roll and yaw together, "
        "the axis of the drum goes round with the drum (forward) or against it (backward). "
        "Circles: critical speeds of the orders 1 and 2, with the speed for order 1."
        f"{'' if result.run_up is None else run_up}",
    )
    over_amplitude = Plot(
        amplitude_figure(result),
        "Frequency and damping over amplitude.",
        "By harmonic balance of the free motion. Small amplitudes: friction sticks. Between: it "
        "dissipates most. The amplitude is the displacement of the middle of the tub, with angles "
        f"times {q.AMPLITUDE.text(ANGLE_ARM)}. A curve ends where the motion cannot be followed.",
    )
    tables = (
        LabelledTable("amplitudes", result.over_amplitude, is_in_json=False),
        LabelledTable("campbell", result.over_speed),
    )
    return Part("Frequencies over speed and amplitude", (campbell, over_amplitude, *tables))


def shapes_part(result: MachineModes, scene: Scene, links: list[tuple[str, str]]) -> Part:
    """Return pictures of the shapes, shares of the elements, and links to animations."""
    outlines = scene.tub_outlines()
    shapes = [
        Plot(
            shapes_figure(result.modes[name], outlines),
            f"Outlines of the tub in each mode, {TITLES[name]}.",
            f"Mode shapes, {TITLES[name]}. Grey: at rest. Blue and vermilion: both ends of the "
            "motion, enlarged. Rows: seen from the front, from the right, from above.",
        )
        for name in (SLIDING, STUCK)
    ]
    energy = Plot(
        energy_figure(result),
        "Bars with the shares of the elements in strain energy and dissipation of each mode.",
        "Share of each element in the strain energy and in the dissipated energy of each mode. "
        "Negative shares, which preload can cause, are not drawn; shapes.csv has them.",
    )
    return Part("Mode shapes", (*shapes, energy), links=links)


def sensitivity_part(result: MachineModes) -> Part:
    """Return the numbers that move each mode most."""
    causes = [
        Plot(
            sensitivity_figure(result, SLIDING, name),
            f"Sorted bars of the numbers that change the {words} of each mode most.",
            f"Numbers of the machine file that change the {words} most, {TITLES[SLIDING]}. A table "
            "is scaled as a whole. sensitivities.csv has all numbers and both linearisations.",
        )
        for name, words in (
            ("relative_change_of_frequency", q.FREQUENCY.words),
            ("change_of_damping_ratio", q.DAMPING.words),
        )
    ]
    table = LabelledTable("sensitivities", result.sensitivities, is_in_json=False)
    return Part("Sensitivity: what moves a mode", (*causes, table))


def natural_modes_table(result: NaturalModes) -> LabelledTable:
    """Return natural frequencies and damping ratios of all linearisations."""
    size = q.AMPLITUDE.text(result.amplitude)
    return LabelledTable(
        "modes",
        three_linearisations_of(result),
        f"Modes of machine '{result.parameters.name}'",
        "Natural frequency and damping of each mode. Sticks: friction holds, so that the sponges "
        f"of dampers are springs. {size}: harmonic balance of the free motion at this amplitude; "
        "its mode continues the one that sticks. Slides: friction is saturated, only dashpots "
        "damp; its mode is the one of the same name. Roll, pitch and yaw turn about x, y and z.",
        across="linearisation",
        words={STUCK: "sticks", AMPLITUDE: size, SLIDING: "slides"},
        is_in_terminal=True,
    )


def three_linearisations_of(result: NaturalModes) -> xr.Dataset:
    """Return frequency [Hz] and damping ratio over `linearisation` and `mode`.

    The modes are those with stuck friction, then others; NaN where there is none of the name.
    """
    stuck, sliding = (
        of_names(
            [mode.name for mode in modes],
            [mode.frequency_hz for mode in modes],
            [mode.damping_ratio for mode in modes],
        )
        for modes in (result.modes[STUCK], result.modes[SLIDING])
    )
    names = list(dict.fromkeys([*stuck.mode.values.tolist(), *sliding.mode.values.tolist()]))
    three = [one.reindex(mode=names) for one in (stuck, result.at_amplitude, sliding)]
    return xr.concat(three, xr.Variable("linearisation", [STUCK, AMPLITUDE, SLIDING]))


def critical_table(result: MachineModes) -> LabelledTable:
    """Return the critical speeds."""
    return LabelledTable(
        "critical",
        result.critical,
        "Critical speeds",
        "An order of the drum speed equals a natural frequency. A mode has the name of its shape "
        "at this speed.",
        words=TITLES,
    )


def gap_table(result: MachineModes, gaps: Mapping[str, Nearness]) -> LabelledTable:
    """Return the smallest gap in each mode."""
    size, arm = (q.AMPLITUDE.text(length) for length in (result.amplitude, ANGLE_ARM))
    return LabelledTable(
        "gaps",
        of_gaps(gaps),
        "Gap to the housing",
        "Smallest distance between tub and housing over the cycle of each mode, all at an "
        f"amplitude of {size}, with angles times {arm}. Bold: the mode that brings them nearest. "
        "How large a mode becomes in a run depends on load and speed.",
        marked=("is_nearest", "ours"),
        words=TITLES,
    )


def shapes_table(result: MachineModes) -> LabelledTable:
    """Return participation, and for files shapes and shares of the elements."""
    return LabelledTable(
        "shapes",
        result.labelled(),
        "Participation",
        "Participation of each coordinate of the tub. A mode has the name of a coordinate with a "
        "large part in it; no two have the same.",
        across="element",
        words=TITLES,
    )
