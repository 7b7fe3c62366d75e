"""The commands `identify damper`, `bushing` and `gasket`: fits, their judgement and comparison."""

import json
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import pandas as pd
from rich.table import Table

from wm_drake.errors import input_error
from wm_drake.parameters.units import Unit
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.components import axes_of, existing_files, mass_of, target_of
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.page import estimates_frame, undetermined_sentences, values_table
from wm_drake.studies.identify.comparison import (
    Comparison,
    FittedLaw,
    SplitTests,
    check_blind,
    compare_laws,
    fit_law,
)
from wm_drake.studies.identify.comparison_page import (
    bounds_sentences,
    comparison_page,
    errors_by_law,
    laws_shown,
    laws_table,
    loops_by_law,
    parameters_by_law,
)
from wm_drake.studies.identify.fragment import Destination, fragment, missing_numbers
from wm_drake.studies.identify.inputs import given_by_law, kept_fields, motions_of
from wm_drake.studies.identify.judgement import Judgement, judge
from wm_drake.studies.identify.models import (
    ComponentModel,
    TestedAxis,
    bushing_model,
    damper_model,
)
from wm_drake.studies.identify.options import AxisFitOptions, DamperFitOptions, FitOptions
from wm_drake.studies.identify.page import (
    errors_table,
    fitted_loops,
    identify_page,
    motion_sentences,
)
from wm_drake.studies.identify.static_tests import StaticTask
from wm_drake.studies.inputs import pairs_of, quantities_of
from wm_drake.studies.rig.units import units_of
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Result, Task


@dataclass(frozen=True)
class FittedComponent(Destination):
    """A component whose numbers are identified, and where they go.

    Attributes:
        title: Component, for headings.
        copies: Fields of each law that get the value of another field.
    """

    title: str = ""
    copies: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def missing(self, name: str, law: FittedLaw) -> list[str]:
        """Return a sentence that names the numbers that a file lacks, so that it is not written."""
        missing = missing_numbers(law.fit, law.model, self.target.component)
        if not missing:
            return []
        return [
            f"{name} is not written: the data do not determine {', '.join(missing)}, which the law "
            f"{law.model.law} needs and {self.target.component.name} did not have; give a value "
            "with --fix."
        ]


@dataclass(frozen=True)
class IdentifiedResult(Result):
    """Result with identified numbers. CSV files have all digits, but for the samples of loops."""

    component: FittedComponent
    float_format: ClassVar[str | None] = None
    float_formats: ClassVar[Mapping[str, str]] = {"loops": "%.7g"}

    @property
    @abstractmethod
    def laws(self) -> Mapping[str, FittedLaw]:
        """Fitted laws by the names of the machine or component files with their numbers."""

    @abstractmethod
    def fit_as_dict(self) -> dict[str, Any]:
        """Return the fit or the comparison for JSON, in SI."""

    @property
    def title(self) -> str:
        """Component, for headings."""
        return self.component.title

    def as_json(self) -> dict[str, Any]:
        """Return the fit or the comparison for JSON, in SI."""
        return {"component": self.title, **self.fit_as_dict()}

    @property
    def missing(self) -> list[str]:
        """Sentences on files that are not written, because their numbers are not complete."""
        return [
            text for name in self.laws for text in self.component.missing(name, self.laws[name])
        ]

    def texts(self) -> dict[str, str]:
        """Return the identified numbers of each law, and the fit as JSON."""
        files = {}
        for name, law in self.laws.items():
            if not self.component.missing(name, law):
                copies = self.component.copies.get(law.model.law)
                remarks = law.judgement.sentences
                files[name] = fragment(law.fit, law.model, self.component, copies, remarks)
        return files | {"fit.json": json.dumps(self.fit_as_dict(), indent=1)}


@dataclass(frozen=True)
class FitResult(IdentifiedResult):
    """Fit of one law."""

    model: ComponentModel
    fit: Fit
    motions: Sequence[MeasuredMotion]
    page = identify_page

    @property
    def title(self) -> str:
        """Component and law, for headings."""
        return f"{self.component.title}, law {self.model.law}"

    @cached_property
    def judgement(self) -> Judgement:
        """Judgement of the fit."""
        return judge(self.fit, self.motions)

    @property
    def laws(self) -> dict[str, FittedLaw]:
        """The fitted law."""
        return {"identified.yaml": FittedLaw(self.model, self.fit, self.judgement)}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the values, the error of each test, and all samples."""
        return {
            "parameters": estimates_frame(self.fit, self.model.fixed_numbers),
            "errors": errors_table(self.fit, self.motions, self.judgement),
            "loops": fitted_loops(self.fit, self.motions),
        }

    def fit_as_dict(self) -> dict[str, Any]:
        """Return the fit for JSON, in SI."""
        return {
            **self.fit.as_dict(),
            "fixed": {
                name: {"value": value, "unit": unit.si}
                for name, value, unit in self.model.fixed_numbers
            },
            "judgement": self.judgement.as_dict(),
        }

    def terminal(self) -> list[Table | str]:
        """Return the judgement, the values, and remarks."""
        fit, unit = self.fit, units_of(self.motions[0].loop.rotates).force_unit
        title = f"{self.title}: RMSE {fit.rmse:.4g} {unit} by {fit.log.method}"
        table = values_table(fit, self.model.fixed_numbers).terminal(title)
        remarks = [*undetermined_sentences(fit), *fit.log.notes, *self.missing]
        return [*self.judgement.sentences, *motion_sentences(self.motions), table, *remarks]


@dataclass(frozen=True)
class ComparisonResult(IdentifiedResult):
    """Several laws that were fitted to the same tests."""

    comparison: Comparison
    page = comparison_page

    @property
    def laws(self) -> dict[str, FittedLaw]:
        """All laws."""
        return {f"identified_{law.law}.yaml": law for law in self.comparison.results}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return measures, values and errors of the laws, and all samples."""
        return {
            "laws": laws_table(self.comparison),
            "parameters": parameters_by_law(self.comparison),
            "errors": errors_by_law(self.comparison),
            "loops": loops_by_law(self.comparison),
        }

    def fit_as_dict(self) -> dict[str, Any]:
        """Return the comparison for JSON, in SI."""
        return self.comparison.as_dict()

    def terminal(self) -> list[Table | str]:
        """Return what the data say about the laws, their measures, and remarks."""
        comparison = self.comparison
        table = laws_shown(comparison).terminal(self.component.title)
        motions = (*comparison.motions, *comparison.validation)
        sentences = (*comparison.sentences, *motion_sentences(motions))
        return [*sentences, table, *bounds_sentences(comparison), *self.missing]


class FitTask(Task):
    """Fit of one law to measured loops, or of several with a comparison."""

    options: FitOptions
    component: FittedComponent
    models: Mapping[str, ComponentModel]
    motions: list[MeasuredMotion]
    validation: list[MeasuredMotion]

    def _read_validation(self, driven_mass: float = 0.0) -> None:
        options, self.validation = self.options, []
        if options.validation:
            check_blind(options.files, existing_files(options.validation))
            self.validation = motions_of(
                options.validation,
                options,
                rotates=self.motions[0].loop.rotates,
                driven_mass=driven_mass,
            )

    def run(self, executor: Executor) -> Result:
        """Fit one law, or compare several."""
        names, options = list(self.models), self.options
        component = replace(self.component, out=executor.out or Path())
        if len(names) == 1 and not self.validation:
            (model,) = self.models.values()
            with executor.fraction("identify") as bar:
                fit = fit_law(
                    model,
                    self.motions,
                    options.method,
                    seed=options.seed,
                    progress=lambda fraction, least: bar(fraction),
                )
            return FitResult(component, model, fit, self.motions)
        with executor.fractions(names) as bars:
            comparison = compare_laws(
                self.models,
                SplitTests(tuple(self.motions), tuple(self.validation)),
                options.method,
                seed=options.seed,
                progress=lambda law, fraction: bars(names.index(law), fraction),
            )
        return ComparisonResult(component, comparison)


class DamperFitTask(FitTask):
    """Fit of a friction damper."""

    def __init__(self, options: DamperFitOptions) -> None:
        """Find the damper and read its loops."""
        self.options = options
        target = target_of("damper", options)
        law = str(getattr(target.component.parameters, "law"))  # noqa: B009
        sponge = mass_of(options.sponge_mass, "--sponge-mass")
        driven = mass_of(options.outer_mass, "--outer-mass")
        driven += mass_of(options.jig_mass, "--jig-mass")
        given = given_by_law(options.law or law, "", options)
        self.motions = motions_of(options.files, options, rotates=False, driven_mass=driven)
        self.models = {
            one: damper_model(one, self.motions, numbers, kept_fields(target, one, numbers), sponge)
            for one, numbers in given.items()
        }
        parts = [f"damper {target.component.name}"]
        parts += [f"sponge of {1e3 * sponge:g} g"] if sponge else []
        parts += [f"less the inertia of {driven:g} kg at the driven end"] if driven else []
        changes = dict(pairs_of(options.sets, "--set"))
        self.component = FittedComponent(target, Path(), changes, ", ".join(parts))
        self._read_validation(driven)


class AxisFitTask(FitTask):
    """Fit of one axis of a bushing or of the gasket."""

    def __init__(self, kind: str, options: AxisFitOptions) -> None:
        """Find the component and read its loops."""
        self.options = options
        target = target_of(kind, options)
        if options.axis is None:
            raise input_error("is needed, for example --axis radial", where="--axis")
        axes = axes_of(options.axis)
        arm = quantities_of(options.arm, Unit("m", "mm"), "--arm")[0] if options.arm else 0.0
        given = given_by_law(options.law, axes[0], options)
        rotates = axes[0].startswith("about") and not arm
        self.motions = motions_of(options.files, options, rotates=rotates)
        base: Any = target.component.parameters
        tested = TestedAxis(base, axes[0], arm)
        self.models = {
            law: bushing_model(law, self.motions, tested, numbers) for law, numbers in given.items()
        }
        self.component = FittedComponent(
            target,
            Path(),
            dict(pairs_of(options.sets, "--set")),
            f"{target.component.name}, {options.axis.replace('_', ' ')}",
            {law: _copies(model, axes) for law, model in self.models.items()},
        )
        self._read_validation()


def _copies(model: ComponentModel, axes: tuple[str, ...]) -> dict[str, str]:
    """Return the fields of a bushing's other axes, and the field that each is copied from."""
    ours, others = axes[0][-1], [other[-1] for other in axes[1:]]
    names = [*(unknown.name for unknown in model.unknowns), *model.fixed]
    fields = list(dict.fromkeys(name.split(".")[0] for name in names))
    return {f"{name[: -len(ours)]}{other}": name for name in fields for other in others}


def task_of(kind: str, options: Any) -> Task:
    """Return the task of a command `identify`: quasi-static tests, or a fit to loops."""
    if options.static:
        return StaticTask(kind, options)
    return DamperFitTask(options) if kind == "damper" else AxisFitTask(kind, options)
