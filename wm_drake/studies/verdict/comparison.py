"""Show the verdicts on several machines or variants on one page, the differences first."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, Quantity, text_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.spin.comparison import COLOURS, different_parameters
from wm_drake.studies.tolerance.study import OF_RUNS
from wm_drake.studies.verdict.page import LAUNDRY, gaps_figure, mm, verdict_answer, word_of
from wm_drake.studies.verdict.study import SMALLEST_GAP, Judged, smallest, words_of

DIFFERENCE = SMALLEST_GAP.named("difference")

MOST_NAMED = 2
"""Number of quantities that are named as deciding."""


def comparison_answer(judged: Mapping[str, Judged], pages: Mapping[str, str]) -> Answer:
    """Return the answer of a comparison.

    Args:
        judged: At least two, by the name of the machine or variant. All have the same clearance.
        pages: File of the page of each.
    """
    first = next(iter(judged.values()))
    gaps, laundry = gaps_of(judged), laundry_of_all(judged)
    clearance = first.question.clearance
    styles = dict(zip(judged, COLOURS, strict=False))
    plot = Plot(
        gaps_figure(clearance, gaps, laundry, styles),
        f"Smallest gaps of {', '.join(judged)}.",
        "Smallest gap of each load, and of all samples of random laundry. Dashed: the clearance "
        "wanted.",
    )
    differ = different_parameters({name: one.question.machine for name, one in judged.items()})
    words = words_of_all(judged)
    links = [(page, f"Verdict on {name}") for name, page in pages.items()]
    return Answer(
        f"Verdicts on {', '.join(judged)}",
        answer(judged, gaps, laundry),
        None,
        (
            Part("Differences", (plot, gaps_table(gaps, laundry))),
            Part("What decides, what to change", (levers_table(judged),), has_long_words=True),
            Part("Numbers that differ", remarks=differ),
            Part("Each verdict", links=links),
        ),
        (("Laundry", f"{first.question.laundry}; {first.laundry.sizes['sample']} samples each"),),
        short=Part("Verdicts", (verdicts_table(judged, gaps, laundry),)),
        diverged=tuple(f"{name}: {word}" for name, word in words if word != "clear"),
        others={pages[name]: verdict_answer(one) for name, one in judged.items()},
    )


def words_of_all(judged: Mapping[str, Judged]) -> list[tuple[str, str]]:
    """Return the verdict on each machine in one or two words, after its name."""
    return [(name, word_of(one.question, one.states, one.laundry)) for name, one in judged.items()]


def gaps_of(judged: Mapping[str, Judged]) -> xr.Dataset:
    """Return the smallest gaps over `state` and `load`: machines as they are, all their loads.

    A run that failed has minus infinity, a load that a machine does not have is NaN. [m]
    """
    each = [one.states[["smallest_gap"]].isel(state=0, drop=True) for one in judged.values()]
    states = xr.Variable("state", list(judged))
    return xr.concat([one.fillna(-np.inf) for one in each], states, join="outer")


def laundry_of_all(judged: Mapping[str, Judged]) -> xr.Dataset:
    """Return gaps and probabilities of random laundry over `state`: machines as they are."""
    each = [one.laundry.drop_vars("gap").isel(state=0, drop=True) for one in judged.values()]
    states = xr.Variable("state", list(judged))
    return xr.concat(each, states, combine_attrs="override")


def answer(judged: Mapping[str, Judged], gaps: xr.Dataset, laundry: xr.Dataset) -> str:
    """Return the answer: the best machine, and gap and probability of each."""
    least = gaps.smallest_gap.min("load").values
    names = list(judged)
    best = names[int(least.argmax())]
    what = "touch the housing"
    if clearance := judged[best].question.clearance:
        what = f"keep less than {mm(clearance)}"
    texts = []
    for at, name in enumerate(names):
        gap = mm(least[at])
        one, samples = laundry.isel(state=at), judged[name].laundry.sizes["sample"]
        texts.append(
            f"{name}: smallest gap {gap}, {int(one['count'])} of {samples} runs with random "
            f"laundry {what} ({text_of(one.lower)} to {text_of(one.upper)})"
        )
    return f"{best} has the largest smallest gap. {'; '.join(texts)}."


def verdicts_table(
    judged: Mapping[str, Judged], gaps: xr.Dataset, laundry: xr.Dataset
) -> LabelledTable:
    """Return verdict, gap, its difference from the first machine, and probability of each."""
    least = gaps.smallest_gap.min("load")
    at = [_where(one) for one in judged.values()]
    data = xr.Dataset(
        {
            "verdict": (
                "state",
                [word for _, word in words_of_all(judged)],
            ),
            "smallest_gap": SMALLEST_GAP.variable("state", least),
            "difference": DIFFERENCE.variable("state", least - least[0]),
            "with_load": ("state", [load for load, _ in at], Quantity("with load").attributes()),
            "speed": SPEED.named("at").variable("state", [speed for _, speed in at]),
            "laundry_gap": SMALLEST_GAP.named("with random laundry").variable(
                "state", laundry.smallest_gap
            ),
            **{name: laundry[name] for name in ("probability", "lower", "upper")},
        },
        {"state": ("state", list(judged), Quantity("machine").attributes())},
    )
    return LabelledTable(
        "verdicts",
        data,
        "Verdicts",
        "Smallest gap of all loads of the machine, its difference from the first line, and the "
        "share of runs with random laundry that have too small a gap.",
        is_in_terminal=True,
        on_page_only=("speed", "laundry_gap"),
    )


def _where(judged: Judged) -> tuple[str, float]:
    """Return the load of the smallest gap, and the drum speed there."""
    base = judged.states.isel(state=0)
    nearest = base.isel(load=int(base.smallest_gap.fillna(-np.inf).argmin("load")))
    return nearest["load"].item(), nearest.gap_speed.item()


def gaps_table(gaps: xr.Dataset, laundry: xr.Dataset) -> LabelledTable:
    """Return the smallest gap of each load and of the laundry, and differences from the first."""
    every = np.vstack([gaps.smallest_gap.transpose("load", "state"), laundry.smallest_gap])
    columns = {}
    for at, name in enumerate(gaps.state.values.tolist()):
        columns[f"gap_{name}"] = SMALLEST_GAP.named(name).variable("load", every[:, at])
        if at:
            difference = DIFFERENCE.named(f"{name}, difference")
            columns[f"difference_{name}"] = difference.variable("load", every[:, at] - every[:, 0])
    data = xr.Dataset(columns, {"load": [*gaps["load"].values.tolist(), LAUNDRY]})
    caption = (
        "Smallest gap of each load and of all samples of random laundry; differences from the "
        "first machine."
    )
    return LabelledTable("gaps", data, "Smallest gap of each load", caption)


def levers_table(judged: Mapping[str, Judged]) -> LabelledTable:
    """Return what decides the gap of each machine, and what its proposal gives."""
    rows = []
    for one in judged.values():
        keys = one.tried["key"].values.tolist()[:MOST_NAMED]
        pairs = one.question.changes.items()
        changes = "; ".join(f"{words_of(key)} {text.replace('*', ' ')}" for key, text in pairs)
        after = smallest(one.states)[1].item() if changes else np.nan
        odds = one.laundry.probability[1].item() if changes else np.nan
        rows.append(("; ".join(map(words_of, keys)), changes or "nothing", after, odds))
    decides, changes, after, odds = zip(*rows, strict=True)
    data = xr.Dataset(
        {
            "decides": ("state", list(decides), Quantity("what decides the gap").attributes()),
            "proposal": ("state", list(changes), Quantity("what to change").attributes()),
            "gap_then": SMALLEST_GAP.named("smallest gap then").variable("state", after),
            "probability_then": OF_RUNS.named("probability then").variable("state", odds),
        },
        {"state": ("state", list(judged), Quantity("machine").attributes())},
    )
    return LabelledTable("levers", data, "What decides, what to change")
