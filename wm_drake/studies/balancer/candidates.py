"""Which balancer to fit: one machine without a balancer, with rings of balls, with liquid.

Rings that the machine does not have are those of another machine. Each candidate runs up with the
same loads. The rule is that of all studies (`wm_drake.studies.proposal`): what is fitted may raise
neither the largest amplitude of the run-up nor that at the highest speed by more than 10 %, of the
worst load; the aim is the largest desirability of both.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from wm_drake.elements.ball_ring import BallRing
from wm_drake.elements.liquid_ring import LiquidRing
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.element_kinds import DrumElement
from wm_drake.parameters.units import Share
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.balance import rings_of
from wm_drake.simulation.measures.kind import Better
from wm_drake.studies.balancer.rings import without_rings
from wm_drake.studies.balancer.study import LEVEL, PEAK
from wm_drake.studies.proposal import (
    AFTER,
    BEFORE,
    Aim,
    compared,
    is_confirmed,
    proposal_of,
    worst_of,
)

NONE, BALLS, LIQUID = "none", "balls", "liquid"
"""Names of the candidates."""

KINDS: Mapping[str, type[DrumElement]] = {BALLS: BallRing, LIQUID: LiquidRing}
"""Type of the rings of each candidate that has some."""

WORDS = {NONE: "no balancer", BALLS: "rings of balls", LIQUID: "rings of liquid"}
"""What each candidate has, in words."""

LAG = Quantity("lag of the liquid, in parts of the file's", Share(), form="{:.2g}".format)
LAGS = (1.0 / 3.0, 1.0, 3.0)
"""Factors on the lag of the liquid, which is not published for any ring: the range in which its
baffles may lie; own choice (`docs/theory/liquid-ring.md`)."""

RESPONSES = {"peak": PEAK, "level": LEVEL}
GOALS: Mapping[str, Better] = dict.fromkeys(RESPONSES, "smaller")
"""Responses of a candidate, and which change is an improvement."""


def with_rings(
    parameters: MachineParameters, kind: str, other: MachineParameters
) -> MachineParameters:
    """Return the machine with the rings of one kind only.

    Args:
        kind: Key of `KINDS`.
        other: Machine whose rings, and whose step if it is shorter, the machine takes if it has
            none of this kind.

    Raises:
        InputError: the machine cannot have rings.
    """

    def rings_in(source: MachineParameters) -> dict[str, DrumElement]:
        return {n: ring for n, ring in rings_of(source).items() if isinstance(ring, KINDS[kind])}

    plain, step = without_rings(parameters), parameters.step
    rings = rings_in(parameters)
    if not rings:
        rings, step = rings_in(other), min(step, other.step)
    return with_values(plain, {"elements": {**plain.elements, **rings}, "step": step})


def with_lag(parameters: MachineParameters, factor: float) -> MachineParameters:
    """Return the machine with another lag of the liquid in its rings."""
    rings = {n: ring for n, ring in rings_of(parameters).items() if isinstance(ring, LiquidRing)}
    lags = {f"elements.{name}.lag": factor * ring.lag for name, ring in rings.items()}
    return with_values(parameters, lags)


def by_lag(curves: Mapping[float, xr.Dataset]) -> xr.Dataset:
    """Return the responses of one run over the factors on the lag of the liquid.

    Args:
        curves: By factor, as of `wm_drake.studies.balancer.study.curves_of`.
    """
    runs = responses_of({f"{factor:.2g}": each for factor, each in curves.items()}, [""])
    values = {name: runs.sel(response=name).values[:, 0] for name in RESPONSES}
    return xr.Dataset(
        {
            "lag": LAG.variable("lag_factor", list(curves)),
            **{name: RESPONSES[name].variable("lag_factor", values[name]) for name in RESPONSES},
        }
    )


def is_machine(parameters: MachineParameters, other: MachineParameters) -> bool:
    """Return whether a machine is another one but for its name, sources and step."""
    taken = {name: getattr(other, name) for name in ("name", "about", "sources", "step")}
    return parameters.model_copy(update=taken) == other


def responses_of(curves: Mapping[str, xr.Dataset], loads: Sequence[str]) -> xr.DataArray:
    """Return the responses of candidates.

    Args:
        curves: Of each candidate, as of `wm_drake.studies.balancer.study.curves_of`.
        loads: Names of its runs.

    Returns:
        Over `candidate`, `load` and `response`. NaN of a run that failed. [m]
    """
    values = [np.column_stack([each.amplitude.max("from"), each.level]) for each in curves.values()]
    finite = np.where(np.isfinite(values), values, np.nan)
    labels = {"candidate": list(curves), "load": list(loads), "response": list(RESPONSES)}
    return xr.DataArray(PEAK.named("amplitude").variable([*labels], finite), labels)


def candidate_proposal(runs: xr.DataArray, commands: Mapping[str, str]) -> xr.Dataset:
    """Return which balancer to fit, as of `wm_drake.studies.proposal.proposal_of`.

    Args:
        runs: As of `responses_of`.
        commands: Command that runs a candidate, by its name; "" if there is none.
    """
    worst = worst_of(runs.values, GOALS)
    names = runs.candidate.values.tolist()
    base, others = names.index(NONE), [name for name in names if name != NONE]
    aim = Aim(GOALS, worst, worst[base])
    number = aim.proposed(worst[[names.index(name) for name in others]], [1] * len(others))
    shown = {NONE: BEFORE} if number is None else {NONE: BEFORE, others[number]: AFTER}
    chosen = runs.sel(candidate=list(shown)).rename(candidate="setting")
    dims = ("setting", "load", "response")
    values = Quantity("").of_each("response", RESPONSES, dims, chosen.values)
    labels = {
        "setting": list(shown.values()),
        "load": runs["load"].values,
        "response": list(RESPONSES),
    }
    responses = compared(xr.DataArray(values, labels), GOALS)
    changes = [("the balancer", WORDS[others[number]], "elements")] if number is not None else []
    command = commands[others[number]] if number is not None else ""
    confirmed = is_confirmed(aim, responses)
    return proposal_of(responses, changes, is_confirmed=confirmed, command=command)
