"""Show the fit of one law to measured loops: loops, values, errors."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters.units import Unit
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import HIDDEN, TIME, Quantity
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.fitting.page import errors_of, fit_parts, search_facts
from wm_drake.studies.identify.comparison import FittedLaw
from wm_drake.studies.identify.figures import loops_figure
from wm_drake.studies.identify.fragment import FittedComponent, fragment
from wm_drake.studies.identify.judgement import LACK
from wm_drake.studies.identify.problem import motion_sentences
from wm_drake.studies.rig.quantities import loop_quantities
from wm_drake.studies.rig.section import section_plots
from wm_drake.studies.rig.study import ENERGY, FREQUENCY

PHASE = Quantity("phase", Unit("rad", "rad"))
SAMPLES = Quantity("samples", decimals=0)
CONDITION = Quantity("condition number")

METHOD = (
    "The RMSE is that of [A] Eq. (1) and [C] Eq. (5), over all samples of all files. The offset "
    "and drift of each force signal are removed from its residuals. The offset and drift of each "
    "displacement signal are removed from its motion; the middle of the motion is taken as the "
    "zero position of the component. The intervals are valid if the model is right. They take the "
    "correlation of neighbouring residuals into account. Covariance and condition number follow "
    "from the derivatives of the residuals at the end of the search."
)


def fit_answer(
    component: FittedComponent, law: FittedLaw, motions: Sequence[MeasuredMotion]
) -> Answer:
    """Return the answer of the fit of one law."""
    fit = law.fit
    plots = [
        Plot(
            loops_figure(fit, motions, over=over),
            f"Measured samples and the fitted loop, one panel per file, over {over}.",
            f"Force over {over}: measured samples and fitted loop. The offset and drift of the "
            "instrument are removed from both.",
        )
        for over in ("displacement", "velocity")
    ]
    bench = law.model.bench(np.array([e.value for e in fit.estimates]))
    plots += section_plots(bench)
    load = load_of(motions)
    loops = LabelledTable("loops", _samples(law, motions), is_in_json=False)
    search, values, correlations, _ = fit_parts(fit, load, fixed=law.model.fixed_numbers)
    laws = {"identified.yaml": law}
    return Answer(
        f"Identification of {component.title}, law {law.law}",
        _summary(law, load),
        None,
        (
            Part("Measured and fitted loops", (*plots, loops), remarks=motion_sentences(motions)),
            search,
            values,
            Part("Errors", (_errors(law, motions), LabelledTable("fit", _whole(law, load)))),
            correlations,
        ),
        (*search_facts(fit), ("Loops", str(len(motions)))),
        METHOD,
        files_of(component, laws),
        (*_warnings(law), *missing_files(component, laws)),
    )


def load_of(motions: Sequence[MeasuredMotion]) -> Quantity:
    """Return the quantity of the force or moment of tests, with significant digits."""
    load = loop_quantities(motions[0].loop.rotates)["load"]
    return Quantity(load.words, load.unit)


def files_of(component: FittedComponent, laws: Mapping[str, FittedLaw]) -> dict[str, str]:
    """Return the machine or component files of laws by name, without those that lack numbers."""
    return {
        name: fragment(
            law.fit, law.model, component, component.copies.get(law.law), law.judgement.sentences
        )
        for name, law in laws.items()
        if not component.missing(name, law)
    }


def missing_files(component: FittedComponent, laws: Mapping[str, FittedLaw]) -> list[str]:
    """Return sentences on files that are not written, because their numbers are not complete."""
    return [text for name, law in laws.items() for text in component.missing(name, law)]


def motions_of_tests(motions: Sequence[MeasuredMotion]) -> dict[str, xr.Variable]:
    """Return frequency (NaN for a motion that is no sine) and amplitude of tests, over `test`."""
    amplitude = loop_quantities(motions[0].loop.rotates)["displacement"].named("amplitude")
    frequencies = [m.motion.frequency if isinstance(m, HarmonicMotion) else np.nan for m in motions]
    return {
        "file": xr.Variable("test", [m.loop.path for m in motions], {HIDDEN: True}),
        "frequency": FREQUENCY.variable("test", frequencies),
        "amplitude": amplitude.variable("test", [m.stroke for m in motions]),
        "samples": SAMPLES.variable("test", [len(m.position) for m in motions]),
    }


def _errors(law: FittedLaw, motions: Sequence[MeasuredMotion]) -> LabelledTable:
    """Return the RMSE of each test, with noise and lack of fit."""
    load, judged = load_of(motions), law.judgement.loops
    errors = errors_of(law.fit, load)
    numbers = {
        "noise": load.named("noise").variable("test", [loop.noise for loop in judged]),
        "lack_of_fit": LACK.variable("test", [loop.missed for loop in judged]),
        "work_per_cycle": ENERGY.variable("test", [loop.work for loop in judged]),
    }
    return LabelledTable(
        "errors",
        xr.Dataset(motions_of_tests(motions), errors.coords).assign(
            {**errors.data_vars, **numbers}
        ),
        "Errors",
        "Root mean square error (RMSE) of each test, absolute and relative to the largest measured "
        f"{load.words}, as [A] Tables 2, 4, 5 and 7. The noise follows from the differences "
        "between samples of nearly the same phase. The lack of fit is what the noise does not "
        f"explain, relative to the root mean square of the measured {load.words}.",
    )


def _whole(law: FittedLaw, load: Quantity) -> xr.Dataset:
    """Return method, RMSE and judgement of a fit as one row."""
    fit, judgement = law.fit, law.judgement
    return xr.Dataset(
        {
            "method": ((), fit.log.method),
            "rmse": load.variable((), fit.rmse),
            "verdict": ((), judgement.verdict),
            "lack_of_fit": LACK.variable((), judgement.missed),
            "noise": LACK.variable((), judgement.noise),
            "hints": ((), " ".join(judgement.hints)),
            "condition": CONDITION.variable((), fit.condition),
            "evaluations": ((), fit.log.evaluations),
        }
    )


def _samples(law: FittedLaw, motions: Sequence[MeasuredMotion]) -> xr.Dataset:
    """Return the measured and the fitted force at every sample."""
    computed = {"fitted": [law.fit.computed[where] for where in law.fit.problem.slices]}
    return samples_of(motions, computed)


def samples_of(
    motions: Sequence[MeasuredMotion], computed: Mapping[str, Sequence[np.ndarray]]
) -> xr.Dataset:
    """Return time, phase, measured and computed forces of tests at every sample.

    Args:
        computed: Forces at the samples of each test, by name. [N; N m]
    """
    load = load_of(motions)
    phases = [
        m.phase if isinstance(m, HarmonicMotion) else np.full(len(m.position), np.nan)
        for m in motions
    ]
    columns = {
        "time": (TIME, [m.loop.time for m in motions]),
        "phase": (PHASE, phases),
        "measured": (load, [m.loop.force for m in motions]),
        **{name: (load, forces) for name, forces in computed.items()},
    }
    names = np.repeat([m.loop.name for m in motions], [len(m.position) for m in motions])
    return xr.Dataset(
        {
            name: quantity.variable("sample", np.concatenate(parts))
            for name, (quantity, parts) in columns.items()
        },
        {"file": ("sample", names)},
    )


def _warnings(law: FittedLaw) -> list[str]:
    judgement, estimates = law.judgement, law.fit.estimates
    # A rise of a monotone curve that is zero means a flat piece, which needs no warning.
    flat = [e.name for e in estimates if ".rise_" in e.name and e.at_bound == "lower"]
    warnings = list(judgement.sentences[judgement.verdict == "good" :])
    warnings += [
        f"The value of {e.name} is at its {e.at_bound} bound."
        for e in estimates
        if e.at_bound and e.name not in flat
    ]
    unknown = [e.name for e in estimates if not e.determined]
    if unknown:
        warnings.append(f"The data do not determine {', '.join(unknown)}.")
    return warnings


def _summary(law: FittedLaw, load: Quantity) -> str:
    fit, judgement = law.fit, law.judgement
    normalised = [test.normalised for test in fit.tests]
    determined = sum(e.determined for e in fit.estimates)
    if not fit.estimates:
        ending = "All numbers were given; nothing was searched."
    elif judgement.verdict == "poor":
        ending = (
            f"The data give a best value of {determined} of {len(fit.estimates)} unknowns, but the "
            "law does not describe the loops."
        )
    else:
        ending = f"The data determine {determined} of {len(fit.estimates)} unknowns."
    return (
        f"{judgement.sentences[0]} The root mean square difference (RMSE) between fitted and "
        f"measured loops is {load.text(fit.rmse)} over all samples. For single tests it is "
        f"{LACK.text(min(normalised))} to {LACK.text(max(normalised))} of the largest "
        f"{load.words}. {ending}"
    )
