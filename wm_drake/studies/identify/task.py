"""Check the options of the commands identify damper, bushing and gasket, and fit."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from wm_drake.errors import input_error
from wm_drake.report.terminal import say
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.answer import Answer
from wm_drake.studies.components import axes_of, existing_files, mass_of, target_of
from wm_drake.studies.executor import Executor
from wm_drake.studies.identify.comparison import (
    FittedLaw,
    SplitTests,
    check_blind,
    compare_laws,
    fit_law,
)
from wm_drake.studies.identify.comparison_page import comparison_answer
from wm_drake.studies.identify.fragment import FittedComponent
from wm_drake.studies.identify.inputs import given_by_law, kept_fields, motions_of
from wm_drake.studies.identify.judgement import judge
from wm_drake.studies.identify.models import (
    LENGTH,
    ComponentModel,
    TestedAxis,
    bushing_model,
    damper_model,
)
from wm_drake.studies.identify.options import (
    IdentifyAxisOptions,
    IdentifyDamperOptions,
    IdentifyOptions,
)
from wm_drake.studies.identify.page import fit_answer
from wm_drake.studies.identify.problem import motion_sentences
from wm_drake.studies.identify.static_task import IdentifyStaticTask
from wm_drake.studies.inputs import pairs_of, quantities_of
from wm_drake.studies.rig.study import DRIVEN_MASS, SPONGE_MASS
from wm_drake.studies.study import Task


class IdentifyTask(Task):
    """Fit of one law to measured loops, or of several with a comparison."""

    options: IdentifyOptions
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

    def run(self, executor: Executor) -> Answer:
        """Fit one law, or compare several."""
        names, options = list(self.models), self.options
        for text in motion_sentences((*self.motions, *self.validation)):
            say(text, err=True)
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
            law = FittedLaw(model, fit, judge(fit, self.motions))
            return fit_answer(component, law, self.motions)
        with executor.fractions(names) as bars:
            comparison = compare_laws(
                self.models,
                SplitTests(tuple(self.motions), tuple(self.validation)),
                options.method,
                seed=options.seed,
                progress=lambda law, fraction: bars(names.index(law), fraction),
            )
        return comparison_answer(component, comparison)


class IdentifyDamperTask(IdentifyTask):
    """Fit of a friction damper."""

    def __init__(self, options: IdentifyDamperOptions) -> None:
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
        parts += [f"sponge of {SPONGE_MASS.text(sponge)}"] if sponge else []
        parts += (
            [f"less the inertia of {DRIVEN_MASS.text(driven)} at the driven end"] if driven else []
        )
        changes = dict(pairs_of(options.sets, "--set"))
        self.component = FittedComponent(target, Path(), changes, ", ".join(parts))
        self._read_validation(driven)


class IdentifyAxisTask(IdentifyTask):
    """Fit of one axis of a bushing or of the gasket."""

    def __init__(self, kind: str, options: IdentifyAxisOptions) -> None:
        """Find the component and read its loops."""
        self.options = options
        target = target_of(kind, options)
        if options.axis is None:
            raise input_error("is needed, for example --axis radial", where="--axis")
        axes = axes_of(options.axis)
        arm = quantities_of(options.arm, LENGTH, "--arm")[0] if options.arm else 0.0
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
        return IdentifyStaticTask(kind, options)
    return IdentifyDamperTask(options) if kind == "damper" else IdentifyAxisTask(kind, options)
