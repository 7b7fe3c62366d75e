"""Show a bench test: loops, what is derived from them, and the effect of masses."""

from collections import Counter
from collections.abc import Sequence

import xarray as xr

from wm_drake.report.formatting import MISSING
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import text_of
from wm_drake.rigs import ForceLoop, RigRun
from wm_drake.rigs.run import stroke_points
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.rig.figures import (
    amplitude_text,
    frequency_text,
    friction_law_figure,
    overlaid_figure,
    time_figure,
)
from wm_drake.studies.rig.quantities import loop_quantities
from wm_drake.studies.rig.section import section_plots
from wm_drake.studies.rig.study import loop_data

METHOD = (
    "Steady-state force loops under harmonic motion, computed with the force laws. The driven end "
    "moves as A sin(2 π f t). The loop shown is the steady state, in which every cycle is the "
    "same. The force is the force of the actuator on the component, positive in the direction of "
    "the displacement. A positive displacement lengthens a damper."
)


def rig_answer(
    run: RigRun,
    measures: xr.Dataset,
    masses: xr.Dataset | None,
    beyond: Sequence[str],
    verdict: str,
) -> Answer:
    """Return the answer of a bench test.

    Args:
        measures: As of `measures_data` in `wm_drake.studies.rig.study`.
        masses: As of `effect_of_masses` there; None without masses.
        beyond: Sentences on tables that the motions leave.
        verdict: Sentence on the errors that [A] prints; "" without.
    """
    derived = LabelledTable(
        "measures",
        measures,
        run.title,
        "Quantities derived from each loop. Energy: area of the loop. Equivalent damping: "
        "coefficient of the viscous damper that dissipates the same energy per cycle. Dynamic "
        "stiffness and loss angle: amplitude ratio and phase lead of the fundamental of the force "
        f"with respect to the motion. {verdict}".strip(),
        is_in_terminal=True,
    )
    key, value, source = zip(*run.numbers, strict=True)
    numbers = xr.Dataset(
        {"value": ("key", list(value)), "source": ("key", [text or MISSING for text in source])},
        {"key": list(key)},
    )
    loops = [
        LabelledTable(loop_name(loop), loop_data(loop), is_in_json=False) for loop in run.loops
    ]
    of_masses = [] if masses is None else [LabelledTable("masses", masses)]
    sentences = [_summary(run, measures), *([] if masses is None else [masses_sentence(masses)])]
    return Answer(
        f"Bench test: {run.title}",
        " ".join(sentences),
        None,
        (
            Part("Loops", _plots(run)),
            Part("Derived quantities", (derived, *of_masses, *loops)),
            Part(
                "Parameters",
                (
                    LabelledTable(
                        "parameters", numbers, "Parameters", "Parameters of the component."
                    ),
                ),
            ),
        ),
        (("Component", run.title), ("Loops", str(len(run.loops)))),
        METHOD,
        warned=tuple(beyond),
    )


def masses_sentence(masses: xr.Dataset) -> str:
    """Return a sentence on the loop that masses change most."""
    worst = masses.isel(loop=int(masses.largest_difference.values.argmax()))
    return (
        f"The masses change the force by up to {text_of(worst.largest_difference)}, "
        f"{text_of(worst.largest_difference_by_peak)} of the peak without them "
        f"({text_of(worst.frequency)}, {text_of(worst.amplitude)}; there "
        f"{text_of(worst.rms_difference)} root mean square)."
    )


def loop_name(loop: ForceLoop) -> str:
    """Return the name of a loop, made of its frequency and amplitude."""
    return f"loop_{frequency_text(loop)}_{amplitude_text(loop)}".replace(" ", "")


def _plots(run: RigRun) -> list[Plot]:
    largest = max(run.loops, key=lambda loop: (loop.motion.amplitude, -loop.motion.frequency))
    which = f"{frequency_text(largest)}, {amplitude_text(largest)}"
    points = stroke_points(run.bench, largest)
    letters = " A to B: free stroke; C: largest force; D: the motion turns." if points else ""
    plots = [
        Plot(
            time_figure(largest, points),
            f"Motion and force over one period, and the loop, at {which}.",
            f"One period at {which}: motion and force over time, and the force over displacement "
            f"and over velocity (form of [A] Figs. 5, 8, 12 and [C] Figs. 4, 5).{letters}",
        )
    ]
    if len(run.loops) > 1:
        plots += [
            Plot(
                overlaid_figure(run.loops, panel=frequency_text, line=amplitude_text, over=over),
                f"Force over {over}, one panel per frequency.",
                f"Force over {over} for all amplitudes, one panel per frequency (form of [C] Fig. "
                "6).",
            )
            for over in ("displacement", "velocity")
        ]
    counts = Counter(map(amplitude_text, run.loops))
    loops = [loop for loop in run.loops if counts[amplitude_text(loop)] > 1]
    if loops and len(set(map(frequency_text, run.loops))) > 1:
        plots.append(
            Plot(
                overlaid_figure(
                    loops, panel=amplitude_text, line=frequency_text, over="displacement"
                ),
                "Force over displacement, one panel per amplitude.",
                "Force over displacement for all frequencies, one panel per amplitude (form of [C] "
                "Figs. 7 and 14).",
            )
        )
    plots += section_plots(run.bench)
    law = friction_law_figure(run)
    if law is not None:
        plots.append(
            Plot(
                law,
                "Friction force over sliding velocity at several deformation rates.",
                "MSTV law: friction force over the sliding velocity of the sponge, at constant "
                "deformation rates (form of [C] Fig. 12).",
            )
        )
    return plots


def _summary(run: RigRun, measures: xr.Dataset) -> str:
    name = loop_quantities(run.bench.rotates)["load"].words
    peaks, energies = measures[f"peak_{name}"], measures.energy_per_cycle
    if len(run.loops) == 1:
        loop = run.loops[0]
        return (
            f"At {frequency_text(loop)} and {amplitude_text(loop)}, the peak {name} is "
            f"{text_of(peaks[0])}, and the energy per cycle is {text_of(energies[0])}."
        )
    (least, at_least), (most, at_most) = (
        (text_of(peaks[k]), f"{frequency_text(run.loops[k])}, {amplitude_text(run.loops[k])}")
        for k in (int(peaks.values.argmin()), int(peaks.values.argmax()))
    )
    return (
        f"{len(run.loops)} loops were computed. The peak {name} ranges from {least} ({at_least}) "
        f"to {most} ({at_most}). The energy per cycle ranges from "
        f"{text_of(energies.min(keep_attrs=True))} to {text_of(energies.max(keep_attrs=True))}."
    )
