"""The report of an identification from a spin cycle: one HTML file that needs nothing else."""

from pathlib import Path

import numpy as np

from wm_drake.parameters.units import Unit
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.spin_cycle.figures import bars_figure, profile_figure
from wm_drake.report.spin_cycle.report import case_words
from wm_drake.report.tables import Group, Row, Table
from wm_drake.report.formatting import MISSING, number
from wm_drake.simulation.runs import versions
from wm_drake.studies.spin_cycle.study import average_errors, region_errors
from wm_drake.studies.spin_identification.study import JOIN, KNOWN, SpinIdentification

VIRTUAL = (
    "This is a virtual experiment: nothing was measured. A machine with other numbers, planted at random, was run in place of "
    "a real one, and the search did not know them. "
)


def spin_identify_report(result: SpinIdentification, command: str = "") -> str:
    """The report as text of one HTML file, with style and figures inside."""
    return render(
        "spin_identify/page.html",
        title=f"Numbers of machine {result.parameters.name} from a spin cycle",
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
    """One paragraph, made from the numbers."""
    count, known = len(result.sought), sum(result.identifiable)
    begin, end = (
        100.0 * float(average_errors(values, result.measured).mean())
        for values in (result.before, result.after)
    )
    opening = "" if result.planted is None else VIRTUAL
    sought = f"{count} unknown{'s were' if count > 1 else ' was'} sought"
    text = (
        f"{opening}{sought} in the RMS displacements of {len(result.cases)} cases. The data determine {known} of them within "
        f"{number(100 * KNOWN, 0)} % (95 % interval). Average error of a number: {number(begin)} % before, {number(end)} % "
        "after."
    )
    if result.recovered is not None and known:
        worst = np.max(np.abs(result.recovered[np.array(result.identifiable)]))
        text += f" The planted numbers of those that are determined were found within {number(100 * worst, 2)} %."
    left = [
        s.unknown.name
        for s, fine in zip(result.sought, result.identifiable, strict=True)
        if not fine
    ]
    if left:
        text += f" Not determined that well: {', '.join(left)}."
    return text


def warnings_of(result: SpinIdentification) -> list[str]:
    """What a reader must know before using the numbers."""
    ends = [f"{e.name} ended at its {e.at_bound} bound" for e in result.fit.estimates if e.at_bound]
    return [f"{', '.join(ends)}: widen the range, or doubt the model."] if ends else []


def unknowns(result: SpinIdentification) -> Table:
    """Each unknown: before, planted, found, how well."""
    virtual = result.planted is not None
    header = [
        "unknown",
        "equal numbers",
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
    caption = f"Numbers found. Strong: determined within {number(100 * KNOWN, 0)} %."
    return Table(caption, tuple(header), tuple(groups), text_columns=2)


def _with_unit(value: float | None, unit: Unit) -> str:
    return MISSING if value is None else f"{unit.from_si(value):.5g} {unit.shown.replace('*', ' ')}"


def directions(result: SpinIdentification) -> list[str]:
    """Changes of several unknowns together that the data do not see, in words."""
    texts = []
    for direction in result.fit.undetermined:
        moves = ", ".join(
            f"{name.split(JOIN)[0]} {'up' if part > 0 else 'down'}"
            for name, part in zip(direction.names, direction.parts, strict=True)
        )
        texts.append(f"The data hardly see these change together: {moves}.")
    return texts


def errors(result: SpinIdentification) -> Table:
    """Relative error (9) per case before and after."""
    groups = []
    for case in result.cases:
        cells = [
            number(
                100.0 * float(region_errors(values, result.measured).sel(case=case.name).mean()), 2
            )
            for values in (result.before, result.after)
        ]
        groups.append(Group(f"{case.name}: {case_words(case)}", (Row(tuple(cells)),)))
    caption = (
        "Relative error [A] Eq. (9), norm over sensors and axes, mean over regions, in percent."
    )
    return Table(caption, ("case", "before", "after"), tuple(groups))


def _profile_picture(result: SpinIdentification) -> Picture:
    return picture(
        profile_figure(result.profile),
        "Spin profile with its regions.",
        "Drum speed over time, and the regions.",
    )


def _bars(result: SpinIdentification, index: int) -> Picture:
    case = result.cases[index]
    measured, after = (values.sel(case=case.name) for values in (result.measured, result.after))
    title = f"Case {case.name}: {case_words(case)}"
    return picture(
        bars_figure(after, None, measured),
        f"{title}.",
        f"{title}. RMS displacement per region, with the numbers found.",
    )


def _facts(result: SpinIdentification, command: str) -> list[tuple[str, str]]:
    fit = result.fit
    facts = [
        ("Machine", result.parameters.name),
        ("SDF model", Path(result.parameters.model).name),
        (
            "Search",
            f"{fit.method}, seed {fit.seed}; {fit.evaluations} points, {len(result.cases)} runs each; {'; '.join(fit.notes)}",
        ),
        (
            "Objective",
            "root mean square of |measured − computed| over the norm of what was measured in its case and region, [A] Eq. (9)",
        ),
        ("Condition", f"of the Jacobian, scaled by the ranges: {fit.condition:.3g}"),
        ("Versions", ", ".join(f"{name} {text}" for name, text in versions().items())),
        ("Command", command),
    ]
    return [(word, text) for word, text in facts if text]
