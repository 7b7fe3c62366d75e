"""The task of the gasket study: options and files checked, and runs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import InputError, check_known, input_error, nearest_names, problems_at
from wm_drake.model.machine import Machine
from wm_drake.parameters import PublishedResults, published_results
from wm_drake.parameters.vary import entries_of_texts
from wm_drake.parameters.vary_file import GASKET, VARY_FILES, load_vary
from wm_drake.parameters.varying import TABLES, Varied, Varying
from wm_drake.simulation.cases import Case, is_as_measured
from wm_drake.studies.answer import Answer
from wm_drake.studies.doe.coding import MODELS
from wm_drake.studies.doe.design import (
    DESIGNS,
    Design,
    design_of,
    has_three_levels,
    make_design,
    read_levels,
)
from wm_drake.studies.doe.polynomial import (
    POLYNOMIALS,
    PolynomialDesign,
    check_determined,
    polynomial,
)
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.gasket.options import DEFAULT_MODEL, GasketOptions
from wm_drake.studies.gasket.own_design import fitted_screening, polynomial_answer
from wm_drake.studies.gasket.page import Comparisons, gasket_answer
from wm_drake.studies.gasket.proposal import (
    Candidates,
    is_level_zero,
    sets_of,
    settings_of,
    text_at,
)
from wm_drake.studies.gasket.screening import (
    check_degrees_of_freedom,
    published_for,
    run_screening,
)
from wm_drake.studies.gasket.study import DEFAULT_LEVELS, GasketTrials, run_level_zero
from wm_drake.studies.gasket.surface import Setting, models_of, run_settings
from wm_drake.studies.gasket.words import Words
from wm_drake.studies.inputs import existing_file, pairs_of, selected_cases
from wm_drake.studies.proposal import (
    AFTER,
    command_text,
    compared,
    is_confirmed,
    proposal_of,
)
from wm_drake.studies.run import machine_text
from wm_drake.studies.study import Task
from wm_drake.studies.vary import in_vary_file, varying_of


class GasketTask(Task):
    """The study with checked options."""

    def __init__(self, options: GasketOptions, machine: Machine) -> None:
        """Read factors, settings, design, loads, responses and published results."""
        self.options, self.machine = options, machine
        factors = _factors(machine, options)
        self.parameters = factors.machine
        self.settings = [_setting(factors, text) for text in options.check]
        self.design = _design(options, factors)
        if isinstance(self.design, PolynomialDesign):
            check_determined(self.design)
            if options.check:
                raise input_error("needs a design with the levels -1, 0 and 1", where="--check")
        else:
            check_degrees_of_freedom(self.design)
        self.cases = selected_cases(self.parameters, options.load, True, options.profile)
        with problems_at("--response", ""):
            self.trials = GasketTrials(factors, self.cases, options.response)
        self.published, self.source = self._published()

    def _every_load(self) -> list[Case]:
        """Return the loads of the study, then the other ones of the machine."""
        every = selected_cases(self.parameters, None, True, self.options.profile)
        names = [case.name for case in self.cases]
        return [*self.cases, *(case for case in every if case.name not in names)]

    def _published(self) -> tuple[PublishedResults, str]:
        """Return the published results that are compared, of some loads, and their files."""
        options, parameters = self.options, self.parameters
        files = [
            str(existing_file(path, "--published").resolve()) for path in options.published
        ] or parameters.published
        loads = [case.name for case in self.cases]
        if not options.published:
            is_other = options.sets or options.factor or options.vary
            loads = [case.name for case in self.cases if is_as_measured(parameters, case)]
            loads = [] if is_other else loads
        known = published_results(tuple(files))
        kept = {label: terms for label, terms in known.items() if label[0] in loads}
        return kept, ", ".join(Path(path).name for path in files)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        from wm_drake.batch.ledger import key_of

        plan, trials = self.design, self.trials
        factors = [(f.keys, f.at, f.entry.sets) for f in trials.factors]
        levels = key_of(levels=plan.levels, factors=factors)[:8]
        loads = key_of(loads=[(case.load, case.profile) for case in trials.loads])[:8]
        return {
            "machine": machine_text(trials.parameters),
            "design": f"{plan.kind}, {plan.trials} trials, {levels}",
            "loads": f"{', '.join(case.name for case in trials.loads)}, {loads}",
            "measures": ", ".join(trials.measures),
        }

    def run(self, executor: Executor) -> Answer:
        """Run the trials, level 0 with each treatment of tables, and the settings to check."""
        trials, experiment = self.trials, self.trials.experiment(executor.simulate)
        design = self.design
        with executor.progress(design.trials * len(self.cases)):
            if isinstance(design, PolynomialDesign):
                runs = trials.responses(design, experiment)
                return polynomial_answer(fitted_screening(design, runs), trials)
            screening = run_screening(design, lambda d: trials.responses(d, experiment))
        models = models_of(screening)
        check, published = xr.Dataset(), xr.Dataset()
        if self.settings:
            check = run_settings(trials, self.settings, models, experiment)
        if self.published:
            published = published_for(self.published, screening, self.source)
        zero = self._level_zero(executor)
        every_load = replace(experiment, loads=tuple(self._every_load()))
        proposed, proposal, changed = self._proposal(screening, models, every_load)
        comparisons = Comparisons(
            published, zero, check, proposed, proposal, self.options.tables, changed,
            is_level_zero(self.parameters, self.trials.factors),
        )  # fmt: skip
        return gasket_answer(screening, models, trials, comparisons)

    def _level_zero(self, executor: Executor) -> xr.Dataset:
        """Run the machine and level 0 with each treatment of tables."""
        options = self.options
        every = {
            name: _factors(self.machine, options.model_copy(update={"tables": name}))
            for name in TABLES
        }
        return run_level_zero(self.parameters, every, self.trials, executor.simulate)

    def _proposal(
        self, screening: xr.Dataset, models: xr.Dataset, experiment: Experiment
    ) -> tuple[xr.Dataset, xr.Dataset, dict[str, float]]:
        """Choose a setting on the fitted models, and run it and level 0 with all loads.

        Returns:
            The runs, the proposal and the changed places, as of `page.Comparisons`.
        """
        factors, parameters = self.trials.factors, self.parameters
        candidates = Candidates(screening, models)
        places = candidates.best() or (0.0,) * len(factors)
        changed = [(f, x) for f, x in zip(factors, places, strict=True) if x]
        every = [(factor, *text_at(parameters, factor, place)) for factor, place in changed]
        chosen = [(factor, text, place) for factor, text, place in every if place]
        settings = settings_of({factor.name: place for factor, _, place in chosen}, factors)
        runs = run_settings(self.trials, settings, models, experiment)
        responses = compared(runs.run, candidates.aim.goals)
        confirmed = is_confirmed(candidates.aim, responses)
        words = Words(factors, screening)
        changes = [
            (words.factor(f.name), _change_text(f, text), ", ".join(f.keys))
            for f, text, _ in chosen
        ]
        if chosen:
            responses = responses.assign(_predicted(runs, responses))
        command = self._command([sets_of(factor, text) for factor, text, _ in chosen])
        proposal = proposal_of(responses, changes, is_confirmed=confirmed, command=command)
        return runs, proposal, {factor.name: place for factor, _, place in chosen}

    def _command(self, sets: Sequence[Mapping[str, str]]) -> str:
        """Return the command that runs changes, each the values of `--set`; "" if there is none."""
        machine = self.options.machine
        if not sets or not all(sets):
            return ""
        each = (pair for of_factor in sets for pair in of_factor.items())
        begin = "wm-drake spin" if machine == "reference" else f"wm-drake spin --machine {machine}"
        return command_text(begin, self.options, *(f'--set "{n}={text}"' for n, text in each))


def _change_text(factor: Varied, text: str) -> str:
    """Return the new value of a factor in words, beside the one of the machine."""
    if text.endswith("%"):
        return f"{text} of its table"
    unit, nominal = factor.first_unit, factor.numbers[0].nominal if factor.numbers else None
    before = "" if nominal is None else f" in place of {unit.reading(nominal)}"
    return f"{unit.reading(unit.number(text))}{before}"


def _predicted(runs: xr.Dataset, responses: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return what the models predict of each response with its worst load after the change."""
    place = {"load": responses.load_after, "response": responses.response}
    of_setting = runs[["predicted", "half_width"]].sel(setting=AFTER, drop=True).sel(place)
    return {str(name): array.drop_vars("load") for name, array in of_setting.items()}


def _factors(machine: Machine, options: GasketOptions) -> Varying:
    """Return the factors that the options select, with levels that the machine can have."""
    named, treatment, name = options.factor, options.tables, options.vary or GASKET
    check_known(treatment, TABLES, f"unknown treatment '{treatment}'", where="--tables")
    path, file = VARY_FILES.path(name), load_vary(name)
    known = file.entries()
    if not named:
        with in_vary_file(path, file):
            factors = varying_of(machine, known, file.known, tables=treatment)
            return factors.with_levels("a factor")
    entries = entries_of_texts(named, known, "--factor", DEFAULT_LEVELS)
    with problems_at("--factor"):
        return varying_of(machine, entries, tables=treatment).with_levels("a factor")


def _setting(factors: Varying, text: str) -> Setting:
    """Return the setting of the factors that an option `--check` means."""
    places = dict.fromkeys(factors.names, 0.0)
    by_name = factors.by_name
    for name, value in pairs_of(text.split(","), "--check"):
        check_known(name, by_name, f"unknown factor '{name}'", where="--check")
        with problems_at("--check"):
            places[name] = by_name[name].level_of(value)
    return Setting(text, tuple(places.values()))


def _design(options: GasketOptions, factors: Varying) -> Design | PolynomialDesign:
    """Return the design that the options select, for some factors."""
    kind, trials, names = options.design, options.trials, factors.names
    model = options.model or DEFAULT_MODEL
    if kind in DESIGNS:
        check_known(model, MODELS, f"no model '{model}' of this design", where="--model")
        return make_design(kind, names, trials=trials, model=model, seed=options.seed)
    if not Path(kind).is_file():
        hint = nearest_names(kind, DESIGNS)
        raise input_error(
            f"'{kind}' is neither a kind of design nor a file{hint}", where="--design"
        )
    if trials is not None:
        raise input_error(
            "not allowed with a design from a file, which has its own number of trials",
            where="--trials",
        )
    by_name = factors.by_name
    levels = read_levels(
        Path(kind), names, lambda name, text: by_name[name].level_of(text, beyond=True)
    )
    if model in MODELS and has_three_levels(levels):
        try:
            return design_of(Path(kind).name, names, levels, model)
        except InputError:
            if options.model:
                raise
    if options.model in MODELS:
        message = f"{model} is of the levels -1, 0 and 1; allowed here are {', '.join(POLYNOMIALS)}"
        raise input_error(f"{message}, and terms such as {names[0]}^2", where="--model")
    for number in np.flatnonzero(np.abs(levels).max(axis=1, initial=0.0) > 1.0).tolist():
        with problems_at(f"{kind}, different trial {number + 1}"):
            factors.at_levels(levels[number].tolist())
    return PolynomialDesign(
        Path(kind).name, names, levels, polynomial(options.model or "quadratic", names)
    )
