"""Show the study of detection: threshold, cost, estimate, speed limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from markupsafe import Markup
from numpy.typing import NDArray

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, SPEED, TIME, Quantity, shown
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.detect.decision import (
    DISTRIBUTIONS,
    IN_TABLE,
    MINUTES,
    OF_LOADS,
    NoThresholdError,
    Verdict,
    speed_limits,
    table_of,
    threshold_for,
    verdict_of,
)
from wm_drake.studies.detect.estimators import LinearFit
from wm_drake.studies.detect.signals import ControllerSignal, known_signals
from wm_drake.studies.detect.study import (
    GAP,
    TRUTHS,
    Draws,
    Plan,
    choices_of,
    errors_of,
    monitor_of,
    ranked,
    summary_of,
)


@dataclass(frozen=True)
class RiskQuestion:
    """What is asked of the draws.

    Attributes:
        risk: Tolerated share of touching loads among those that spin.
        retry: Duration of a distribution. [s]
        laundry: Words of the vary file.
        risk_text: The risk as the user wrote it.
    """

    machine: MachineParameters
    plan: Plan
    risk: float
    retry: float
    laundry: str
    risk_text: str


def detect_answer(question: RiskQuestion, draws: Draws, more: Sequence[ControllerSignal]) -> Answer:
    """Return the answer.

    Args:
        more: Signals that may be added.

    Raises:
        NoThresholdError: no threshold of the ripple reaches the tolerated risk.
    """
    plan, judged = question.plan, ~draws.is_fitted
    ripple, quantity = plan.ripple(draws), plan.signals[0].quantity
    touches, fitted = draws.touches, draws.is_fitted
    chosen = threshold_for(ripple[fitted], touches[fitted], question.risk)
    verdict = verdict_of(ripple[judged], touches[judged], chosen)
    errors = errors_of(plan, draws)
    choices = choices_of(plan, draws, more, draws.holds[plan.hold].windows)
    ranking = ranked(choices, draws, question.risk, question.retry)
    thresholds = _thresholds(ripple[fitted], chosen)
    table = table_of(thresholds, quantity, ripple[judged], touches[judged], question.retry)
    limits = speed_limits(ripple, draws.highest, fitted, quantity)
    fit = plan.estimates(draws, "gap")[0]
    hold = draws.holds[plan.hold]
    return Answer(
        f"Detection of unbalance by machine {question.machine.name}",
        answer_text(question, draws, chosen, verdict),
        question.machine,
        (
            Part("The threshold", (decision_plot(table, chosen),)),
            Part("Truth and estimate", (truth_plot(errors, touches[judged]),)),
            Part("Thresholds", (_decisions(table, chosen),)),
            Part("Errors", (_errors(errors),)),
            Part("What would gain most", (_ranking(ranking),), text=ABOUT_RANKING),
            Part(
                "Speed limits",
                (_limits(limits),),
                links=(("speed_limits.h", "the table as an array of C"),),
            ),
            Part("The estimate", tuple(_coefficients(fit))),
            *_monitor(question, draws),
        ),
        (
            ("Laundry", question.laundry),
            ("Draws", f"{len(touches)}, the second half judges"),
            ("Detection", f"{plan.turns} turns at {SPEED.text(hold.speed)}"),
            *((f"Signal {s.name}", signal_text(s)) for s in plan.signals),
        ),
        files={"speed_limits.h": c_array(limits, quantity)},
        short=_short(question, draws, verdict, ranking),
    )


def answer_text(question: RiskQuestion, draws: Draws, chosen: float, verdict: Verdict) -> str:
    """Return the answer in a few sentences."""
    plan = question.plan
    signal, speed = plan.signals[0].quantity, draws.holds[plan.hold].speed
    does, spins = _touch(draws), verdict.spins
    if not draws.touches.any():
        return (
            f"Every load may spin: none of {len(draws.touches)} loads {does}, so this laundry "
            "needs no threshold."
        )
    least = f"Spin if the {signal.words} at {SPEED.text(speed)} is below {signal.text(chosen)}: "
    if not verdict.touches:
        return f"{least}none of {spins.samples} loads spins at once."
    of = verdict.touches
    share = _of_round(of.estimate) if of.count else f"none of {of.samples}"
    return (
        f"{least}{round(100.0 * spins.estimate)} of 100 loads spin at once, and {share} of these "
        f"{does} (95 % interval "
        f"{OF_LOADS.text(of.lower)} to {OF_LOADS.text(of.upper)})."
    )


def _touch(draws: Draws) -> str:
    """Return what a load does that must not spin."""
    return "touch" if not draws.clearance else f"keep less than {GAP.text(draws.clearance)}"


def _of_round(share: float) -> str:
    """Return a share as a number of 1,000 or 10,000."""
    whole = 1000 if share >= 1e-3 else 10000
    return f"{round(whole * share)} of {whole:,}"


def _short(question: RiskQuestion, draws: Draws, verdict: Verdict, ranking: xr.Dataset) -> Part:
    """Return the part in short."""
    distributions = verdict.distributions
    without = draws.touches[~draws.is_fitted].mean()
    rows = [
        (
            "Cost",
            f"{DISTRIBUTIONS.number(distributions)} distributions of "
            f"{TIME.named('', decimals=0).text(question.retry)} per wash, "
            f"{MINUTES.number(distributions * question.retry / 60.0)} minutes; "
            f"{OF_LOADS.text(verdict.refused.estimate)} of the loads are refused though safe",
        ),
        ("Without a threshold", f"{OF_LOADS.text(without)} of the loads {_touch(draws)}"),
        ("Tolerated risk", f"{question.risk_text} of the washes; {ABOUT_RISK}"),
    ]
    best = ranking.isel(choice=0)
    if np.isfinite(best.saved.item()):
        rows.append(
            (
                "By the estimated gap",
                f"{best['choice'].item()} would be best: {OF_LOADS.text(best.spins.item())} of the "
                "loads spin at once",
            )
        )
    return Part("In short", facts=rows)


UNBALANCE = Quantity("unbalance", Unit("kg*m", "g*m"), 0)
ABOUT_RISK = (
    "chosen on half the draws so that (t + 1) / (n + 1) is at most the risk, if t of the n loads "
    "that spin touch"
)
ABOUT_RANKING = (
    "Thresholds of the estimated gap at the same risk, each half of the draws judged by the fit of "
    "the other. Differences within the intervals are luck. Other sensors and windows need no new "
    "runs; further speeds are those of --at."
)


def signal_text(signal: ControllerSignal) -> str:
    """Return the errors of a signal in words."""
    quantity = signal.quantity.named("", form="{:.3g}".format)
    noise, step = (quantity.text(value) for value in (signal.noise, signal.resolution))
    return f"noise {noise}, resolution {step}, every {1e3 * signal.sample:g} ms"


def _thresholds(score: FloatArray, chosen: float) -> FloatArray:
    """Return the thresholds of the table, rising, with the chosen one."""
    return np.unique(np.append(np.quantile(score[np.isfinite(score)], IN_TABLE), chosen))


def _decisions(table: xr.Dataset, chosen: float) -> LabelledTable:
    return LabelledTable(
        "decisions",
        table.assign(is_chosen=("threshold", table.threshold.values == chosen)),
        "Thresholds",
        "Loads that spin at once, are refused though they would not touch, and touch, with 95 % "
        "intervals of the loads that judge. Every wash needs 1 over the share that spins "
        "distributions.",
        marked=("is_chosen", "ours"),
        on_page_only=("spins_lower", "spins_upper", "refused_lower", "refused_upper"),
        is_in_terminal=True,
    )


def _errors(errors: xr.Dataset) -> LabelledTable:
    return LabelledTable(
        "errors",
        summary_of(errors),
        "Errors of the estimate",
        "Of the loads that judge. The mass is that which alone has the static unbalance; its "
        "moment is positive at the rear. An error as large as the scatter says nothing.",
    )


def _ranking(ranking: xr.Dataset) -> LabelledTable:
    return LabelledTable(
        "ranking", ranking, "What would gain most", "", on_page_only=("spins_lower", "spins_upper"),
        is_in_terminal=True,
    )  # fmt: skip


def _limits(limits: xr.Dataset) -> LabelledTable:
    return LabelledTable(
        "speed_limits",
        limits,
        "Highest speed by ripple",
        "Up to this speed every load of the line kept the clearance while passing; a load above "
        "the last line must not spin. A hold near a resonance swings farther than a ramp that "
        "passes it.",
    )


def _coefficients(fit: object) -> list[LabelledTable]:
    """Return the table of a linear fit of the gap; none of another estimator."""
    if not isinstance(fit, LinearFit):
        return []
    values = [fit.constant, *fit.coefficients.values()]
    data = xr.Dataset(
        {"coefficient": Quantity("coefficient, SI").variable("feature", values)},
        {"feature": ["constant", *fit.coefficients]},
    )
    caption = "Smallest gap = constant + sum of coefficient times feature, all in SI units."
    return [LabelledTable("coefficients", data, "The estimated gap", caption)]


def _monitor(question: RiskQuestion, draws: Draws) -> list[Part]:
    """Return the lines of a monitor for the machine file; none without a motor."""
    speed = known_signals(question.machine).get("speed")
    if speed is None:
        return []
    fitted = draws.is_fitted
    impedance, *values = monitor_of(question.plan, speed, draws, question.machine.gravity)
    estimates = np.array(values)
    numbers = f"kind: unbalance_monitor, impedance: {impedance:.4g} N*m*s/rad"
    lines = Markup("<pre><code>elements:\n  monitor: {{{}}}</code></pre>").format(numbers)
    text = (
        "As an element of the machine file it estimates in records, diagrams of Drake and FMUs, "
        "from the ripple of the drum speed: output unbalance_estimate."
    )
    try:
        threshold = threshold_for(estimates[fitted], draws.touches[fitted], question.risk)
        text += f" Spin if it is below {UNBALANCE.text(threshold)}."
    except NoThresholdError:
        pass
    return [Part("Unbalance monitor", text=text, body=lambda: lines)]


def c_array(limits: xr.Dataset, quantity: Quantity) -> str:
    """Return the speed limits as a header of C, in the units of the page."""
    up_to, speed = limits.up_to.values, limits["limit"].values
    rows = ", ".join(
        f"{{{quantity.values(a):.6g}f, {SPEED.values(b):.6g}f}}"
        for a, b in zip(up_to.tolist(), speed.tolist(), strict=True)
    )
    words = f"{quantity.words} up to [{quantity.unit_text}], highest speed [{SPEED.unit_text}]"
    return (
        f"/* {words}; above the last line: do not spin. */\n"
        f"static const float wm_speed_limits[{len(up_to)}][2] = {{{rows}}};\n"
    ).replace("\u00a0", " ")


def truth_plot(errors: xr.Dataset, touches: NDArray[np.bool_]) -> Plot:
    """Return true over estimated mass and gap."""
    panels = []
    for column, name in enumerate(("mass", "gap")):
        estimates = shown(errors[f"{name}_estimated"])
        truth = shown(errors[name])
        known = np.isfinite(estimates) & np.isfinite(truth)
        ends = np.array([truth[known].min(), truth[known].max()])
        safe, bad = known & ~touches, known & touches
        keys = ("keeps the clearance", "touches") if not column else ("", "")
        marks = (
            fig.Points(estimates[safe], truth[safe], size=4.0, key=keys[0]),
            fig.Points(estimates[bad], truth[bad], size=5.0, color=fig.MEASURED, key=keys[1]),
            fig.Line(ends, ends, color=fig.MARK),
        )
        quantity = TRUTHS[name]
        axes = (fig.Axis(label=f"estimated {quantity.label}"), fig.Axis(label=quantity.label))
        panels.append(fig.Panel(marks=marks, x=axes[0], y=axes[1], column=column))
    return Plot(
        fig.Figure(panels=tuple(panels), height=340.0),
        "Truth over estimate.",
        "True over estimated mass, and gap of the spin to come, of the loads that judge.",
    )


def decision_plot(table: xr.Dataset, chosen: float) -> Plot:
    """Return the shares over the threshold."""
    quantity = table.threshold.attrs["quantity"]
    x = shown(table.threshold)
    marks: list[fig.Mark] = []
    drawn = {"spins": fig.OURS, "refused": fig.QUIET}
    for name, color in drawn.items():
        low, high = (shown(table[f"{name}_{end}"]) for end in ("lower", "upper"))
        marks.append(fig.band(x, low, high, color=color, opacity=0.2))
        words = table[name].attrs["quantity"].words
        marks.append(fig.Line(x, shown(table[name]), color=color, key=words, symbol="circle"))
    risk = shown(table.touches)
    low, high = shown(table.touches_lower), shown(table.touches_upper)
    at = fig.Rule(float(quantity.values(chosen)), "y", color=fig.MARK, dash="dashed")
    known = np.isfinite(risk)
    below = (
        fig.band(x[known], low[known], high[known], color=fig.MEASURED, opacity=0.2),
        fig.Line(x, risk, color=fig.MEASURED, symbol="circle"),
        at,
    )
    axis = fig.Axis(label=quantity.named(f"threshold of the {quantity.words}").label)
    panels = (
        fig.Panel(marks=(*marks, at), x=axis, y=fig.Axis(label=f"loads, {SHARE.unit_text}")),
        fig.Panel(
            marks=below, x=axis, y=fig.Axis(label=f"touch, of those that spin, {SHARE.unit_text}"),
            column=1,
        ),
    )  # fmt: skip
    return Plot(
        fig.Figure(panels=panels, height=320.0),
        "Shares over the threshold.",
        "Loads that spin and that are refused though safe, and touching loads among those that "
        "spin, over the threshold. Dashed: the chosen one. Strips: 95 % intervals.",
    )
