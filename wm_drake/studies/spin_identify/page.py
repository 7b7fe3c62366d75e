"""Show an identification from a spin cycle: RMS displacements and errors of each case."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from wm_drake.parameters.units import Share
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity
from wm_drake.studies.answer import Answer, Part
from wm_drake.studies.calibrate.fit_page import FitWords, fit_answer
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.spin_cycle.findings import case_description, missing_warnings
from wm_drake.studies.spin_cycle.measured import DIMS, RMS
from wm_drake.studies.spin_cycle.page import bars_plot, profile_plot
from wm_drake.studies.spin_cycle.study import region_errors
from wm_drake.studies.spin_cycle.tables import rms_table
from wm_drake.studies.spin_identify.study import SpinModel

RELATIVE_ERROR = Quantity("relative error", Share(), 2)

VIRTUAL = (
    "This is a virtual experiment: nothing was measured. A machine with randomly planted values "
    "was simulated in place of a real one, and the search did not use these values. "
)
"""First sentences of the answer of a virtual experiment."""

METHOD = (
    "A residual is |measured − computed|, divided by the norm of the measured values of the same "
    "case and region, [A] Eq. (9). The search makes their root mean square small. The average "
    "error is that of single values, as in [A] Table 9."
)


def spin_identify_answer(
    model: SpinModel, fit: Fit, data: xr.Dataset, truth: Mapping[str, float] | None
) -> Answer:
    """Return the answer of the study.

    Args:
        fit, data: As of `calibrated` in `wm_drake.studies.calibrate.blocks`.
        truth: True numbers of a virtual experiment; None for a real one. [SI]
    """
    parameters, names = model.experiment.machine.parameters, ", ".join(c.name for c in model.cases)
    start = fit.problem.points_at(fit.problem.start)
    computed = model.displacements(np.stack([start, fit.values]))
    before, after = (model.measured.copy(data=values) for values in computed)
    rms = {"rms": after, "measured": model.measured}
    shown = xr.Dataset({name: RMS.variable(DIMS, v) for name, v in rms.items()}, after.coords)
    titles = {case.name: f"Case {case.name}: {case_description(case)}" for case in model.cases}
    bars = [bars_plot(shown, name, title) for name, title in titles.items()]
    virtual = "virtual experiment: " if truth else ""
    words = FitWords(
        title=f"Parameters of machine {parameters.name} identified from a spin cycle",
        file="identified",
        data=f"the spin cycle of {len(titles)} case{'s' if len(titles) > 1 else ''}",
        fitted="RMS displacements",
        source=f"{virtual}identified from spin cycle, cases {names}",
        method=METHOD,
        facts=(("SDF model", Path(parameters.model).name), ("Runs of a point", str(len(titles)))),
        notice=VIRTUAL if truth else "",
    )
    tables = [rms_table(name, shown[name]) for name in ("measured", "rms")]
    parts = (
        Part("Measured and fitted", (*bars, *tables)),
        Part("Spin profile", (profile_plot(model.profile),)),
        Part("Errors of the cases", (_cases(model, before, after),)),
    )
    warned = missing_warnings(shown.rms, shown.measured)
    return fit_answer(model, fit, data, words, parts, truth, warned)


def _cases(model: SpinModel, before: xr.DataArray, after: xr.DataArray) -> LabelledTable:
    """Return the errors of each case, [A] Eq. (9), before and after the search."""
    errors = {
        f"error_{name}": RELATIVE_ERROR.named(name).variable(
            "case", region_errors(computed, model.measured).mean("region")
        )
        for name, computed in (("before", before), ("after", after))
    }
    about = ("case", [case_description(case) for case in model.cases])
    return LabelledTable(
        "cases",
        xr.Dataset({"about": about, **errors}, {"case": model.measured.case.values}),
        "Errors of the cases",
        "Relative error, [A] Eq. (9), with norms over sensors and axes: mean over the regions, "
        "before and after the search.",
    )
