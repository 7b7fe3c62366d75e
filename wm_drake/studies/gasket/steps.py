"""The gasket study step by step: factors, trials, analysis of variance, contributions, report.

These are the functions of a script; the task of the study does the same, with more beside it.

    factors = wm.factors(wm.load_machine("reference"))
    design = wm.make_design("d-optimal", factors.names, trials=1000)
    trials = wm.run_trials(factors, design, ["middle", "counter"])
    analysis = wm.anova(trials)
    wm.contributions(analysis)
    wm.doe_report(analysis).save("gasket")
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import pandas as pd
import xarray as xr

from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.parameters import MachineParameters, Varying, published_results, varying
from wm_drake.parameters.vary import entries_of_texts
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.report.labelled import LabelledTable
from wm_drake.simulation.cases import Case, case_of, is_as_measured
from wm_drake.studies.answer import Answer
from wm_drake.studies.doe.design import Design
from wm_drake.studies.experiment import run_here
from wm_drake.studies.gasket.page import NO_COMPARISONS, gasket_answer
from wm_drake.studies.gasket.screening import analyse, check_degrees_of_freedom, published_for
from wm_drake.studies.gasket.study import DEFAULT_LEVELS, GasketTrials
from wm_drake.studies.gasket.surface import models_of


@dataclass(frozen=True)
class Trials:
    """Trials of a design, with their runs.

    Attributes:
        plan: Machine, factors, loads and responses.
        design: Levels of the factors in each trial.
        runs: Responses over load, trial and response, as of `screening.runs_of`. [SI]
        engine: Name of the engine that has run them.
    """

    plan: GasketTrials
    design: Design
    runs: xr.Dataset
    engine: str

    def to_dataframe(self) -> pd.DataFrame:
        """Return the responses of each trial, in units for reading."""
        runs = LabelledTable("runs", self.runs[["value"]], across="response")
        return runs.frame()


@dataclass(frozen=True)
class Analysis:
    """Analysis of variance of trials.

    Attributes:
        trials: The trials.
        table: Shares, effects and quality of the fit, as described in `screening`. [SI]
    """

    trials: Trials
    table: xr.Dataset


def factors(
    machine: MachineParameters, names: Sequence[str] = (), *, tables: str = "scaled"
) -> Varying:
    """Return the factors of a design with their levels.

    Args:
        machine: The machine whose numbers vary.
        names: Names of factors of [B], C_L, C_T, K_Lx, ..., K_Tz, or key paths of the machine
            file; each may have bounds, `K_Lx=80 %..120 %`. Default: the eight of [B], from 50 % to
            150 %.
        tables: What a level does to a stiffness that is a table: "scaled" multiplies its forces,
            "linear" replaces it by a slope, as in [B].

    Raises:
        InputError: the machine has no such number, or it does not allow a level.

    Example:
        >>> import wm_drake as wm
        >>> wm.factors(wm.load_machine("reference"), ["C_L", "K_Lx=80 %..120 %"]).names
        ('C_L', 'K_Lx')
    """
    known = gasket_entries()
    chosen = entries_of_texts(names, known, "", DEFAULT_LEVELS) if names else known
    return varying(machine, chosen, tables=tables).with_levels("a factor")


def run_trials(
    factors: Varying,
    design: Design,
    loads: Sequence[str | Case] = ("middle", "counter"),
    responses: Sequence[str] = (),
    **running: Any,
) -> Trials:
    """Run each trial of a design with each load.

    Args:
        factors: The factors of the design.
        design: Levels of the factors in each trial.
        loads: Names of loads of the machine, or cases. Default: those of [B].
        responses: What is measured, as of `wm-drake study gasket --response`. Default: D, F, M of
            [B], and the smallest gap.
        running: Options of `simulate_many`: engine, workers, progress, step.

    Raises:
        InputError: a load, a response or the engine is unknown, or the design has as many
            coefficients as trials.

    Example:
        >>> import wm_drake as wm
        >>> factors = wm.factors(wm.load_machine("reference"), ["C_L", "K_Lx"])
        >>> design = wm.make_design("full", factors.names)
        >>> trials = wm.run_trials(factors, design, ["middle"], ["gap"])
        >>> trials.to_dataframe().shape
        (9, 3)
    """
    check_degrees_of_freedom(design)
    middle = factors.at_levels([0] * len(factors.every))
    cases = [load if isinstance(load, Case) else case_of(middle, load) for load in loads]
    plan = GasketTrials(factors, cases, responses)
    runs = plan.responses(design, plan.experiment(partial(run_here, **running)))
    return Trials(plan, design, runs, running.get("engine", DEFAULT_ENGINE))


def anova(trials: Trials) -> Analysis:
    """Divide the variance of each response among main effects, interactions and a residual.

    Raises:
        InputError: so many runs failed that the others do not determine the effects.

    Example:
        >>> import wm_drake as wm
        >>> factors = wm.factors(wm.load_machine("reference"), ["C_L", "K_Lx"])
        >>> trials = wm.run_trials(factors, wm.make_design("full", factors.names), ["middle"])
        >>> share = wm.anova(trials).table.share
        >>> bool(share.sel(load="middle", response="Fx", term="K_Lx") > 0.5)
        True
    """
    return Analysis(trials, analyse(trials.design, trials.runs))


def published_of(analysis: Analysis) -> xr.Dataset:
    """Return the published results of the machine file for loads that were run as it has them."""
    plan = analysis.trials.plan
    loads = [case.name for case in plan.loads if is_as_measured(plan.parameters, case)]
    known = published_results(plan.parameters.published)
    kept = {label: terms for label, terms in known.items() if label[0] in loads}
    return published_for(kept, analysis.table, "the machine file")


def contributions(analysis: Analysis) -> pd.DataFrame:
    """Return the share of each term in the variance of each response, in percent.

    The published shares of the machine file are beside ours, NaN where nothing was published.

    Example:
        >>> import wm_drake as wm
        >>> factors = wm.factors(wm.load_machine("reference"), ["C_L", "K_Lx"])
        >>> trials = wm.run_trials(factors, wm.make_design("full", factors.names), ["middle"])
        >>> wm.contributions(wm.anova(trials)).columns.tolist()
        ['load', 'response', 'term', 'contribution_percent', 'published_percent']
    """
    shares, published = {"contribution": analysis.table.share}, published_of(analysis)
    if published:
        shares["published"] = published.share
    return LabelledTable("contributions", xr.Dataset(shares)).frame()


def doe_report(analysis: Analysis) -> Answer:
    """Return the page of an analysis, with pictures, tables and files; its `save` writes them.

    Example:
        >>> import wm_drake as wm
        >>> factors = wm.factors(wm.load_machine("reference"), ["C_L", "K_Lx"])
        >>> trials = wm.run_trials(factors, wm.make_design("full", factors.names), ["middle"])
        >>> list(wm.doe_report(wm.anova(trials)).pictures())[0]
        'Heat map of contributions, middle; the numbers are in the tables below.'
    """
    compared = replace(NO_COMPARISONS, published=published_of(analysis))
    models = models_of(analysis.table)
    answer = gasket_answer(analysis.table, models, analysis.trials.plan, compared)
    return replace(answer, details=(("Engine", analysis.trials.engine), *answer.details))
