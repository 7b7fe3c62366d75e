"""Quasi-static test on the bench: its options, and what it shows."""

import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MeasuredLoop
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import TIME
from wm_drake.rigs import BushingBench, beyond_tables
from wm_drake.rigs.static import static_test
from wm_drake.studies.answer import Answer, Part
from wm_drake.studies.identify.static import static_curve
from wm_drake.studies.identify.static_page import curve_parts, summary
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.rig.options import RigAxisOptions
from wm_drake.studies.rig.quantities import loop_quantities

RATE_OF_B = "100 mm/min"
"""Rate of the tests of [B] section 3.1.1."""

METHOD = (
    "The driven end goes from the place where the component is clamped to one end of its way, "
    "through to the other end, back to the first one, and back to rest, at a constant rate. The "
    "force is that of the law, with its damping at this rate. It is read as `wm-drake identify "
    "--static` reads a measured test; test.csv is such a file."
)


def static_numbers(
    bench: BushingBench, options: RigAxisOptions
) -> tuple[float, float, float] | None:
    """Return amplitude, rate and preload of a quasi-static test. [m, m/s, m; rad, rad/s, rad]

    The result is None without `--static`.
    """
    others = ("frequency", "matrix", "arm") if options.static else ("rate", "preload")
    for name in others:
        if getattr(options, name):
            kind = "harmonic" if options.static else "quasi-static"
            raise input_error(f"is of {kind} tests only (--static)", where=f"--{name}")
    if not options.static:
        return None
    if options.amplitude is None:
        raise input_error("is needed: the way to each side, as '20 mm'", where="--amplitude")
    if bench.rotates and options.rate is None:
        raise input_error("is needed for a rotation, as '30 deg/min'", where="--rate")
    quantities = loop_quantities(bench.rotates)

    def number(name: str, text: str, quantity: str) -> float:
        (value, *more) = quantities_of(text, quantities[quantity].unit, f"--{name}")
        if more or not (value > 0.0 or name == "preload"):
            raise input_error(f"is {text}; allowed is one number > 0", where=f"--{name}")
        return value

    preload = options.preload or quantities["displacement"].text(0.0)
    return (
        number("amplitude", options.amplitude, "displacement"),
        number("rate", options.rate or RATE_OF_B, "velocity"),
        number("preload", preload, "displacement"),
    )


def static_rig_answer(
    title: str, bench: BushingBench, numbers: tuple[float, float, float]
) -> Answer:
    """Run a quasi-static test, and return its answer.

    Args:
        title: What is on the bench.
        bench: Component on the bench.
        numbers: As of `static_numbers`.
    """
    amplitude, rate, preload = numbers
    test = static_test(bench, amplitude, rate, preload)
    curve = static_curve(bench.axis, [test])
    quantities = loop_quantities(bench.rotates)
    motion, load = quantities["displacement"], quantities["load"]
    picture, values = curve_parts([curve], {bench.axis: [test]})
    samples = LabelledTable("test", _samples(test), is_in_json=False)
    rest = (
        f" Clamped at {motion.text(preload)}, where it takes {load.text(float(test.force[0]))}; "
        "displacement and force of the table count from there."
    )
    return Answer(
        f"Quasi-static test: {title}",
        summary([curve]) + (rest if preload else ""),
        None,
        (picture, values, Part("Samples", (samples,))),
        (("Component", title), ("Rate", quantities["velocity"].text(rate))),
        METHOD,
        warned=tuple(beyond_tables(bench, amplitude + abs(preload))),
    )


def _samples(test: MeasuredLoop) -> xr.Dataset:
    """Return a test over its samples, as a file that `identify --static` reads."""
    quantities = loop_quantities(test.rotates)
    values = {
        TIME: test.time,
        quantities["displacement"]: test.displacement,
        quantities["load"]: test.force,
    }
    return xr.Dataset({q.words: q.variable("sample", signal) for q, signal in values.items()})
