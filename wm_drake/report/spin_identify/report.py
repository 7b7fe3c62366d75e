"""Report of an identification from a spin cycle: one self-contained HTML file."""

from pathlib import Path

import numpy as np
import pandas as pd

from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MISSING, number
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.spin_cycle.figures import bars_figure, profile_figure
from wm_drake.report.spin_cycle.report import case_description
from wm_drake.report.tables import Group, Row, Table
from wm_drake.simulation.records import versions
from wm_drake.studies.spin_cycle.study import average_errors, region_errors
from wm_drake.studies.spin_identification.study import JOIN, KNOWN, SpinIdentification

VIRTUAL = (
    "This is a virtual experiment: nothing was measured. A machine with randomly planted values "
    "was simulated in place of a real one, and the search did not use these values. "
)
"""First sentences of the summary of a virtual experiment."""


def spin_identify_report(result: SpinIdentification, command: str = "") -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        result: Result of the identification.
        command: Command line of the study, shown on the page.
    """
    return render(
        "spin_identify/page.html",
        title=f"Parameters of machine {result.parameters.name} identified from a spin cycle",
        about=result.parameters.about,
        summary=summary(result),
        warnings=warnings_of(result),
        unknowns=unknowns(result),
        directions=directions(result),
        errors=errors(result),
        profile_picture=_profile_picture(result),
        pictures=[_bars(result, index) for index in range(len(result.cases))],
        facts=_facts(result, command),
    )


def summary(result: SpinIdentification) -> str:
    """Return one paragraph about what the data determine and how well the machine agrees."""
    count, known = len(result.sought), sum(result.identifiable)
    begin, end = (
        100.0 * float(average_errors(values, result.measured).mean())
        for values in (result.before, result.after)
    )
    opening = ("" if result.planted is None else VIRTUAL) + f"{judged(result)} "
    unknowns_were = f"{count} unknown{'s were' if count > 1 else ' was'}"
    cases = f"{len(result.cases)} case{'s' if len(result.cases) > 1 else ''}"
    text = (
        f"{opening}{unknowns_were} fitted to the RMS displacements of {cases}. The data determine "
        f"{known} of {count} to within ±{number(100 * KNOWN, 0)} % (95 % confidence interval)."
    )
    if result.recovered is not None and known:
        worst = np.max(np.abs(result.recovered[np.array(result.identifiable)]))
        text += (
            " The determined unknowns differ from their planted values by at most "
            f"{number(100 * worst, 2)} %."
        )
    text += (
        f" The search reduced the average error of an RMS displacement from {number(begin)} % to "
        f"{number(end)} %."
    )
    left = [
        s.unknown.name
        for s, fine in zip(result.sought, result.identifiable, strict=True)
        if not fine
    ]
    if left:
        text += f" Not determined to this accuracy: {', '.join(left)}."
    return text


def judged(result: SpinIdentification) -> str:
    """Return the verdict on the fit as a sentence."""
    text = (
        f"{result.verdict.capitalize()} fit: the computed RMS displacements miss the measured ones "
        f"by {number(100.0 * result.error_after)} % on average."
    )
    if result.verdict == "poor":
        text += " The machine does not describe the measurement: do not use the values found."
    return text


def warnings_of(result: SpinIdentification) -> list[str]:
    """Return a warning for a fit that is not good and for each search that ended at a bound."""
    found = [] if result.verdict == "good" else [judged(result)]
    return found + [
        f"The search for {e.name} ended at its {e.at_bound} bound. Widen the range, or check "
        "whether the model is right."
        for e in result.fit.estimates
        if e.at_bound
    ]


def unknowns(result: SpinIdentification) -> Table:
    """Return the value of each unknown before the search, planted and found, with its interval."""
    virtual = result.planted is not None
    header = [
        "unknown",
        "set to the same value",
        "before",
        *(["planted"] if virtual else []),
        "found",
        "95 % interval, ±%",
    ]
    header += ["error, %"] if virtual else []
    groups = []
    for k, (sought, estimate) in enumerate(zip(result.sought, result.fit.estimates, strict=True)):
        unit, half = sought.unknown.unit, 100.0 * float(result.uncertainty[k])
        shown = [_with_unit(sought.unknown.start, unit)]
        shown += [_with_unit(float(result.planted[k]), unit)] if result.planted is not None else []
        shown += [
            _with_unit(estimate.value, unit),
            number(half, 2) if np.isfinite(half) else "not determined",
        ]
        shown += (
            [number(100.0 * float(result.recovered[k]), 2)] if result.recovered is not None else []
        )
        others = ", ".join(key.rsplit(".", 1)[-1] for key in sought.keys[1:]) or MISSING
        groups.append(
            Group(
                sought.keys[0],
                (Row((others, *shown), "ours" if result.identifiable[k] else "other"),),
            )
        )
    caption = (
        "Values of the unknowns. Bold: determined to within "
        f"±{number(100 * KNOWN, 0)} % (95 % confidence interval)."
    )
    return Table(caption, tuple(header), tuple(groups), text_columns=2)


def values_table(result: SpinIdentification) -> pd.DataFrame:
    """Return the unknowns as numbers in their unit, one row for each key."""
    rows = []
    for k, (sought, estimate) in enumerate(zip(result.sought, result.fit.estimates, strict=True)):
        unit = sought.unknown.unit

        def shown(value: float | None, unit: Unit = unit) -> float:
            return np.nan if value is None or not np.isfinite(value) else unit.from_si(value)

        for key in sought.keys:
            row: dict[str, object] = {
                "unknown": key,
                "before": shown(sought.unknown.start),
                "value": shown(estimate.value) if estimate.determined else np.nan,
                "lower_95": shown(estimate.lower),
                "upper_95": shown(estimate.upper),
                "unit": unit.shown,
                "lower_bound": shown(sought.unknown.lower),
                "upper_bound": shown(sought.unknown.upper),
                "identifiable": result.identifiable[k],
                "at_bound": estimate.at_bound,
            }
            if result.planted is not None and result.recovered is not None:
                row["planted"] = shown(float(result.planted[k]))
                row["error_percent"] = 100.0 * float(result.recovered[k])
            rows.append(row)
    return pd.DataFrame(rows)


def _with_unit(value: float | None, unit: Unit) -> str:
    return MISSING if value is None else f"{unit.from_si(value):.5g} {unit.shown.replace('*', ' ')}"


def directions(result: SpinIdentification) -> list[str]:
    """Return a sentence for each joint change of unknowns that the data do not determine."""
    texts = []
    for direction in result.fit.undetermined:
        moves = ", ".join(
            f"{name.split(JOIN)[0]} {'up' if part > 0 else 'down'}"
            for name, part in zip(direction.names, direction.parts, strict=True)
        )
        texts.append(f"The data hardly change when these unknowns change together: {moves}.")
    return texts


def errors(result: SpinIdentification) -> Table:
    """Return the relative error, [A] Eq. (9), of each case before and after the search."""
    groups = []
    for case in result.cases:
        cells = [
            number(
                100.0 * float(region_errors(values, result.measured).sel(case=case.name).mean()), 2
            )
            for values in (result.before, result.after)
        ]
        groups.append(Group(f"{case.name}: {case_description(case)}", (Row(tuple(cells)),)))
    caption = (
        "Relative error, [A] Eq. (9), with norms over sensors and axes: mean over the regions, "
        "before and after the search."
    )
    return Table(caption, ("case", "before, %", "after, %"), tuple(groups))


def _profile_picture(result: SpinIdentification) -> Picture:
    return picture(
        profile_figure(result.profile),
        "Spin profile with its regions.",
        "Drum speed over time. Shaded areas: regions.",
    )


def _bars(result: SpinIdentification, index: int) -> Picture:
    case = result.cases[index]
    measured, after = (values.sel(case=case.name) for values in (result.measured, result.after))
    title = f"Case {case.name}: {case_description(case)}"
    return picture(
        bars_figure(after, None, measured),
        f"{title}.",
        f"{title}. RMS displacement per region, computed with the values found and measured.",
    )


def _facts(result: SpinIdentification, command: str) -> list[tuple[str, str]]:
    fit = result.fit
    facts = [
        ("Machine", result.parameters.name),
        ("SDF model", Path(result.parameters.model).name),
        (
            "Search",
            f"{fit.method}, seed {fit.seed}; {fit.evaluations} evaluated points with "
            f"{len(result.cases)} runs each; {'; '.join(fit.notes)}",
        ),
        (
            "Objective",
            "root mean square of |measured − computed|, divided by the norm of the measured values "
            "of the same case and region, [A] Eq. (9)",
        ),
        (
            "Condition number",
            f"{fit.condition:.3g} (Jacobian, with each unknown scaled by its range)",
        ),
        ("Versions", ", ".join(f"{name} {text}" for name, text in versions().items())),
        ("Command", command),
    ]
    return [(word, text) for word, text in facts if text]
