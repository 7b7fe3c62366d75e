"""Report of the tolerance study: contact, limits, distributions, Sobol indices, quantities."""

from wm_drake.batch import sources_version
from wm_drake.report.formatting import MISSING, number, shape_name
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.tables import Group, Row, Table, line
from wm_drake.report.tolerance.figures import distributions_figure, sobol_figure
from wm_drake.report.tolerance.words import (
    in_a_million,
    leading,
    measure_titles,
    pair_words,
    quantity_words,
    summary,
    warnings,
)
from wm_drake.studies.tolerance.study import Contact, ToleranceResult
from wm_drake.studies.tolerance.tables import measures_table

MOST_PANELS = 9
"""Largest number of distributions in one figure."""


def tolerance_report(
    result: ToleranceResult, about: str, command: str = "", wall_s: float = 0.0
) -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        result: Result of the study.
        about: Description in the tolerance file.
        command: Command line of the study, shown on the page.
        wall_s: Duration of the study. [s]
    """
    machine, settings = result.machine.parameters, result.settings
    _, found = leading(result)
    facts = [
        ("Machine", machine.name),
        ("Samples", f"{settings.samples}, scrambled Sobol sequence, seed {settings.seed}"),
        ("Runs", f"{result.runs} in {wall_s:.0f} s"),
        ("Duration of a run", f"{result.machine.case.profile.duration:g} s"),
        ("Sources", sources_version()),
        ("Command", command),
    ]
    return render(
        "tolerance/page.html",
        title=f"Tolerances of machine {machine.name}",
        about=about,
        summary=" ".join(summary(result)),
        warnings=warnings(result),
        pairs=_pairs(result.contact) if result.contact else None,
        rare=_rare(result.contact) if result.contact and result.contact.rare else "",
        limits=_limits(result) if result.verdicts else None,
        distributions=_distributions(result),
        measures=_measures(result),
        sobol_picture=_sobol_picture(result) if found else None,
        sobol=_sobol(result) if found else None,
        refused=result.refused,
        quantities=_quantities(result),
        facts=[(word, text) for word, text in facts if text],
    )


def _pairs(contact: Contact) -> Table:
    """Return how often each pair of shapes touches and is nearest."""
    names = list(dict.fromkeys([*contact.pairs, *contact.nearest]))
    groups = []
    for name in names:
        share, nearest = contact.pairs.get(name), contact.nearest.get(name, 0)
        if share:
            ends = f"{in_a_million(share.lower)} to {in_a_million(share.upper)}"
            cells = (in_a_million(share.estimate), ends)
        else:
            cells = ("0", MISSING)
        moving, fixed = map(shape_name, name.split("|"))
        percent = number(100.0 * nearest / contact.crude.samples)
        groups.append(Group(moving, (Row((fixed, *cells, percent)),)))
    caption = (
        "Contact by pair of shapes among the samples. A run may touch at several places. Last "
        "column: share of the runs in which the pair has the smallest gap. Intervals: 95 %, "
        "Clopper and Pearson."
    )
    header = ("moves with the tub", "housing", "touch, in a million", "interval", "nearest, %")
    return Table(caption, header, tuple(groups), text_columns=2)


def _rare(contact: Contact) -> str:
    rare = contact.rare
    assert rare is not None
    steps = ", ".join(f"{1000.0 * value:.1f}" for value in rare.thresholds)
    text = (
        f"Of {contact.crude.samples} samples {contact.crude.count} touch, too few to count. Subset "
        f"simulation took {rare.evaluations} runs in {len(rare.thresholds) + 1} levels. Each level "
        f"holds the tenth of the runs with the smallest gaps of the level before: at most {steps} "
        "mm"
    )
    if not rare.probability:
        return f"{text}. The smallest gap of the last level is {1000.0 * rare.smallest:.1f} mm."
    places = ", ".join(
        f"{pair_words(name)} {100.0 * share:.0f} %" for name, share in contact.rare_pairs.items()
    )
    return (
        f"{text}, then contact. Coefficient of variation: {100 * rare.deviation:.0f} %. Contacts "
        f"of the last level: {places}."
    )


def _limits(result: ToleranceResult) -> Table:
    kinds = {"pass": "ours", "fail": "alarm", "undecided": ""}
    groups = []
    for v in result.verdicts:
        side = "at least" if v.limit.at_least is not None else "at most"
        share, lower, upper = (
            f"{100.0 * x:.3g}" for x in (v.broken.estimate, v.broken.lower, v.broken.upper)
        )
        cells = (f"{side} {v.limit.text}", f"{100.0 * v.allowed:g}", share, f"{lower} to {upper}")
        title, _ = measure_titles(result)[v.key]
        groups.append(Group(title, (Row((*cells, v.word), kinds[v.word]),)))
    caption = (
        "Limits: share of the runs that break each one. The verdict is pass if the whole 95 % "
        "interval is allowed, fail if none of it is, else undecided: more samples decide it."
    )
    header = ("quantity", "limit", "allowed, %", "break it, %", "interval, %", "verdict")
    return Table(caption, header, tuple(groups), text_columns=2)


def _distributions(result: ToleranceResult) -> list[Picture]:
    names = [str(name) for name in result.values]
    titles = {name: ", ".join(text) for name, text in measure_titles(result).items()}
    caption = (
        "Distribution functions of the measures: share of the runs below a value. Shaded: 95 % "
        "band for the whole curve (Dvoretzky, Kiefer, Wolfowitz). Dashed: limits."
    )
    shown = [
        {name: titles[name] for name in names[i : i + MOST_PANELS]}
        for i in range(0, len(names), MOST_PANELS)
    ]
    return [
        picture(
            distributions_figure(result, panels),
            f"Distribution functions of {'; '.join(panels.values())}.",
            caption,
        )
        for panels in shown
    ]


def _measures(result: ToleranceResult) -> Table:
    groups, titles = [], measure_titles(result)
    for row in measures_table(result).to_dict("records"):
        title, unit = titles[str(row["measure"])]
        cells = [unit, f"{row['mean']:.4g}", f"{row['deviation']:.3g}"]
        cells += [
            f"{row[p]:.4g} ({row[f'{p}_lower']:.4g} to {row[f'{p}_upper']:.4g})"
            for p in ("p5", "p50", "p95")
        ]
        groups.append(line(title, [c.replace("-", "−") for c in cells]))
    caption = "Measures over all samples; percentiles with 95 % intervals of order statistics."
    header = ("measure", "unit", "mean", "deviation", "5 %", "median", "95 %")
    return Table(caption, header, tuple(groups), text_columns=2)


def _sobol_picture(result: ToleranceResult) -> Picture:
    key, found = leading(result)
    title, _ = measure_titles(result)[key]
    caption = (
        f"Sobol indices of the {title}. Bars: estimates, lines: 95 % bootstrap intervals. A total "
        "index above the first-order index is an effect together with other quantities."
    )
    named = [(quantity_words(v.name), i) for v, i in found]
    listed = ", ".join(f"{name} {i.total:.2f}" for name, i in named)
    return picture(sobol_figure(named), f"Total indices: {listed}.", caption)


def _sobol(result: ToleranceResult) -> Table:
    groups, titles = [], measure_titles(result)
    for name, indices in result.indices.items():
        groups.append(line(titles[name][0], [number(index.total, 2) for index in indices]))
    names = (quantity_words(variable.name) for variable in result.machine.variables)
    header = ("measure", *names)
    caption = (
        "Total Sobol indices of all measures. First-order indices and 95 % intervals are in "
        "sobol.csv."
    )
    return Table(caption, header, tuple(groups))


def _quantities(result: ToleranceResult) -> Table:
    groups = [
        line(quantity_words(v.name), (", ".join(v.keys) or "load", v.text, v.source or MISSING))
        for v in result.machine.variables
    ]
    caption = "What scatters. Percents are of the machine's number."
    return Table(
        caption, ("quantity", "keys", "distribution", "source"), tuple(groups), text_columns=4
    )
