"""Show several laws that were fitted to the same tests: loops, blind predictions, errors."""

import numpy as np
import xarray as xr

from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import EACH, HIDDEN, Quantity, each_of, hidden
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.fitting.page import estimates_of
from wm_drake.studies.identify.comparison import LawComparison
from wm_drake.studies.identify.figures import evenly_chosen, rival_loops_figure
from wm_drake.studies.identify.fragment import FittedComponent
from wm_drake.studies.identify.judgement import LACK
from wm_drake.studies.identify.page import (
    files_of,
    load_of,
    missing_files,
    motions_of_tests,
    samples_of,
)
from wm_drake.studies.identify.problem import motion_sentences

UNKNOWNS = Quantity("unknowns", decimals=0)
CRITERION = Quantity("BIC")

METHOD = (
    "All laws are fitted to the same samples by the least root mean square error. From three tests "
    "on, each test is predicted from the fit to all the others (one Gauss-Newton step away from "
    "the fit to all); a law is as good as the best one if a paired t test of the logarithms of "
    "these errors does not tell them apart (5 %). With fewer tests the Bayesian information "
    "criterion decides, with the independent samples of the best law and a difference of 6 as "
    "limit."
)


def comparison_answer(component: FittedComponent, comparison: LawComparison) -> Answer:
    """Return the answer of a comparison of laws."""
    motions = (*comparison.motions, *comparison.validation)
    laws = {f"identified_{law.law}.yaml": law for law in comparison.results}
    forces = [tested.forces() for tested in comparison.tested]
    samples = samples_of(motions, {law: [of[law] for of in forces] for law in forces[0]})
    kinds = [tested.kind for tested in comparison.tested]
    counts = [len(m.position) for m in motions]
    samples = samples.assign_coords(test=("sample", np.repeat(kinds, counts)))
    loops = LabelledTable("loops", samples, is_in_json=False)
    blind_words = "blind prediction of tests that no fit has seen"
    return Answer(
        f"Laws of {component.title}",
        " ".join(comparison.sentences),
        None,
        (
            Part("Blind prediction", _plots(comparison, "blind", blind_words)),
            Part(
                "Measured and fitted loops",
                (*_plots(comparison, "fitted", "fit to the tests"), loops),
                remarks=motion_sentences(motions),
            ),
            Part("Laws compared", (_laws(comparison),)),
            Part("Errors of each test", (_errors(comparison),)),
            Part("Values", (_estimates(comparison),)),
        ),
        (
            ("Laws", ", ".join(r.law for r in comparison.results)),
            ("Tests", f"{len(comparison.motions)} fitted, {len(comparison.validation)} blind"),
            *(
                (f"Search, {r.law}", f"{r.fit.log.method}; {'; '.join(r.fit.log.notes)}")
                for r in comparison.results
            ),
        ),
        METHOD,
        files_of(component, laws),
        (*_warnings(comparison), *missing_files(component, laws)),
    )


def laws_of(comparison: LawComparison) -> xr.Dataset:
    """Return the measures of each law, from the best to the worst law."""
    load, ranked = load_of(comparison.motions), comparison.order
    least = min(r.criterion for r in ranked)
    blind = [r.prediction for r in ranked]
    numbers = {
        "unknowns": (UNKNOWNS, [len(r.model.unknowns) for r in ranked]),
        "rmse": (load.named("RMSE"), [r.fit.rmse for r in ranked]),
        "lack_of_fit": (LACK, [r.judgement.missed for r in ranked]),
        "rmse_left_out": (load.named("RMSE left out"), [r.left_out_rmse for r in ranked]),
        "bic": (CRITERION, [r.criterion for r in ranked]),
        "bic_above_least": (
            CRITERION.named("BIC above least"),
            [r.criterion - least for r in ranked],
        ),
        "rmse_blind": (load.named("RMSE blind"), [p.fit.rmse if p else np.nan for p in blind]),
        "lack_of_fit_blind": (
            LACK.named("lack of fit blind"),
            [p.judgement.missed if p else np.nan for p in blind],
        ),
    }
    texts = {
        "not_determined": [", ".join(r.undetermined) for r in ranked],
        "verdict": [r.judgement.verdict for r in ranked],
    }
    data = xr.Dataset(
        {name: ("law", values) for name, values in texts.items()}
        | {name: quantity.variable("law", values) for name, (quantity, values) in numbers.items()},
        {"law": [r.law for r in ranked]},
    )
    data = hidden(data, "bic")
    if not comparison.validation:
        data = hidden(data, "rmse_blind", "lack_of_fit_blind")
    as_good = ("law", [r in comparison.as_good for r in ranked], {HIDDEN: True})
    supported = ("law", [r is comparison.supported for r in ranked])
    return data.assign(as_good_as_best=as_good, supported=supported)


def _laws(comparison: LawComparison) -> LabelledTable:
    return LabelledTable(
        "laws",
        laws_of(comparison),
        "Laws",
        "Laws from the best to the worst. Lack of fit: what the noise does not explain, by the "
        "root mean square of the measured force. RMSE left out: error of each test at the fit to "
        "all the other tests. BIC: Bayesian information criterion with the number of independent "
        "samples. The data support, of the laws that are as good as the best, the one with the "
        "fewest unknowns.",
        marked=("supported", "ours"),
        is_in_terminal=True,
    )


def _errors(comparison: LawComparison) -> LabelledTable:
    """Return the RMSE of each test, one column a law; a column says which tests were predicted."""
    load, tested = load_of(comparison.motions), list(comparison.tested)
    errors = [list(one.errors().values()) for one in tested]
    left_out = [
        [r.left_out[one.index] if one.kind == "fitted" else np.nan for r in comparison.results]
        for one in tested
    ]
    dims = ("test", "law")
    normalised = LACK.named("RMSE by the largest value")
    columns = {
        "rmse": load.named("RMSE").variable(dims, [[e.rmse for e in row] for row in errors]),
        "rmse_normalised": normalised.variable(
            dims, [[e.normalised for e in row] for row in errors]
        ),
        "rmse_left_out": load.named("RMSE left out").hidden(dims, left_out),
    }
    labels = {
        "test": [one.measured.loop.name for one in tested],
        "kind": ("test", [one.kind for one in tested]),
        "law": [r.law for r in comparison.results],
    }
    return LabelledTable(
        "errors",
        xr.Dataset(motions_of_tests([one.measured for one in tested]) | columns, labels),
        "Errors",
        "Root mean square error of each test and law, absolute and by the largest measured.",
        across="law",
    )


def _estimates(comparison: LawComparison) -> LabelledTable:
    parts = []
    for r in comparison.results:
        values = estimates_of(r.fit, fixed=r.model.fixed_numbers).rename_dims(unknown="row")
        laws = ("row", [r.law] * values.sizes["row"])
        parts.append(values.reset_index("unknown").assign_coords(law=laws))
    data = xr.concat(parts, "row")
    for name, numbers in data.items():
        if EACH in numbers.attrs:  # the unknowns of all laws
            numbers.attrs[EACH] = {k: q for p in parts for k, q in each_of(p[name]).items()}
    return LabelledTable(
        "estimates",
        data[["law", "unknown", *data.data_vars]],
        "Estimated values",
        "Estimated values of each law with 95 % confidence intervals.",
    )


def _plots(comparison: LawComparison, kind: str, what: str) -> tuple[Plot, ...]:
    every = [tested for tested in comparison.tested if tested.kind == kind]
    if not every:
        return ()
    chosen = evenly_chosen(every)
    number = (
        f"{len(chosen)} of {len(every)} tests, evenly chosen; all are in loops.csv. "
        if len(chosen) < len(every)
        else ""
    )
    best = comparison.supported.law
    return tuple(
        Plot(
            rival_loops_figure(chosen, best=best, over=over),
            f"Measured samples and the loop of each law over {over}, {what}.",
            f"Force over {over}, {what} (form of [C] Figs. 13, 15-20). {number}The offset and "
            f"drift that {best} finds for the instrument are removed.",
        )
        for over in ("displacement", "velocity")
    )


def _warnings(comparison: LawComparison) -> list[str]:
    supported = comparison.supported
    poor = ["None of these laws describes the tests."]
    return [
        *(poor if supported.judgement.verdict == "poor" else []),
        *supported.judgement.hints,
        *(
            f"{r.law}: the value of {e.name} is at its {e.at_bound} bound; wider --bounds may fit "
            "better."
            for r in comparison.results
            for e in r.fit.estimates
            if e.at_bound and ".rise_" not in e.name
        ),
    ]
