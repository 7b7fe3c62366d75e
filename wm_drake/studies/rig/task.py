"""Check the options of a bench test: component and motions, and run it."""

from typing import Any

from wm_drake.errors import check_known, input_error
from wm_drake.parameters import Component, quantities
from wm_drake.report.table import readable
from wm_drake.rigs import (
    JIG_ARM,
    MATRICES,
    Bench,
    BushingBench,
    Harmonic,
    beyond_tables,
    bushing_bench,
    damper_bench,
    run_rig,
)
from wm_drake.studies.answer import Answer
from wm_drake.studies.components import axes_of, mass_of, target_of
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.rig.options import RigAxisOptions, RigDamperOptions, RigOptions
from wm_drake.studies.rig.page import rig_answer
from wm_drake.studies.rig.quantities import LINEAR, loop_quantities
from wm_drake.studies.rig.static import static_numbers, static_rig_answer
from wm_drake.studies.rig.study import (
    DRIVEN_MASS,
    FREQUENCY,
    RMSE_OF_A,
    SPONGE_MASS,
    effect_of_masses,
    measures_data,
    printed_errors,
    printed_verdict,
)
from wm_drake.studies.study import Task


class RigTask(Task):
    """A bench test with checked options."""

    def __init__(self, kind: str, options: RigOptions) -> None:
        """Find the component, put it on the bench, and read its motions."""
        self.component = target_of(kind, options).component
        self.massless: Bench | None = None
        self.static: tuple[float, float, float] | None = None
        if isinstance(options, RigDamperOptions):
            self._set_damper(options)
        else:
            assert isinstance(options, RigAxisOptions)
            self._set_axis(kind, options)
        if self.static is None:
            self.motions = _motions(kind, self.bench, options)
        self.kind, self.is_of_a = kind, options.matrix == "A"

    def _set_damper(self, options: RigDamperOptions) -> None:
        sponge = mass_of(options.sponge_mass, "--sponge-mass")
        driven = mass_of(options.outer_mass, "--outer-mass")
        driven += mass_of(options.jig_mass, "--jig-mass")
        damper: Any = self.component.parameters
        self.bench: Bench = damper_bench(damper, sponge, driven)
        if sponge or driven:
            self.massless = damper_bench(damper)
        parts = [f"damper {self.component.name}", f"law {damper.law}"]
        parts += [f"sponge of {SPONGE_MASS.text(sponge)}"] if sponge else []
        parts += [f"{DRIVEN_MASS.text(driven)} at the driven end"] if driven else []
        self.title = ", ".join(parts)

    def _set_axis(self, kind: str, options: RigAxisOptions) -> None:
        axis, name = axes_of(options.axis)[0], self.component.name
        length = LINEAR["displacement"]
        arm = quantities_of(options.arm, length.unit, "--arm")[0] if options.arm else 0.0
        if options.matrix is not None and axis.startswith("about") and not options.arm:
            arm = JIG_ARM
        bushing: Any = self.component.parameters
        self.bench = bushing_bench(bushing, axis, arm)
        what = kind if name == kind else f"{kind} {name}"
        through = f", through an arm of {length.text(arm)}" if arm else ""
        self.title = f"{what}, axis {axis.replace('_', ' ')}{through}"
        self.static = static_numbers(self.bench, options)

    def run(self, executor: Executor) -> Answer:
        """Run a quasi-static test, or all motions, also without the masses if there are any."""
        if self.static is not None:
            assert isinstance(self.bench, BushingBench)
            return static_rig_answer(self.title, self.bench, self.static)
        numbers = _numbers(self.component)
        with executor.progress(len(self.motions), "loops") as progress:
            run = run_rig(self.title, self.bench, self.motions, numbers, progress)
        measures, masses, verdict = measures_data(run), None, ""
        if self.is_of_a:
            errors = printed_errors(self.kind, self.bench, self.motions)
            measures["printed_rmse"] = RMSE_OF_A.variable("loop", errors)
            verdict = printed_verdict(self.kind, self.bench)
        if self.massless is not None:
            masses = effect_of_masses(run, run_rig(self.title, self.massless, self.motions))
        beyond = beyond_tables(self.bench, max(motion.amplitude for motion in self.motions))
        return rig_answer(run, measures, masses, beyond, verdict)


def _motions(kind: str, bench: Bench, options: RigOptions) -> list[Harmonic]:
    """Return the motions of `--matrix`, or of `--frequency` and `--amplitude`."""
    matrix, frequency, amplitude = options.matrix, options.frequency, options.amplitude
    if matrix is not None:
        if frequency or amplitude:
            raise input_error(
                "has its own frequencies and amplitudes; leave -f and -a out", where="--matrix"
            )
        rotates = isinstance(bench, BushingBench) and bench.axis.startswith("about")
        if kind == "gasket" and rotates:
            raise input_error("[A] does not rotate the gasket; give -f and -a", where="--matrix")
        if isinstance(bench, BushingBench) and bench.axis == "about_y":
            raise input_error(
                "[A] does not twist the bushing about its axis; give -f and -a", where="--matrix"
            )
        papers = MATRICES[f"{kind} about" if rotates else kind]
        check_known(matrix, papers, f"no matrix '{matrix}' for a {kind}", where="--matrix")
        return list(papers[matrix])
    if not (frequency and amplitude):
        raise input_error(
            "needs -f and -a (for example -f '3 Hz' -a '5 mm'), or --matrix", where=f"rig {kind}"
        )
    unit = loop_quantities(bench.rotates)["displacement"].unit
    return [
        Harmonic(f, a)
        for f in quantities_of(frequency, FREQUENCY.unit, "--frequency")
        for a in quantities_of(amplitude, unit, "--amplitude")
    ]


def _numbers(component: Component) -> tuple[tuple[str, str, str], ...]:
    """Return key, value with unit and source of each number that is on the bench."""
    rows = []
    for key, value, unit in quantities(component.parameters):
        if key.startswith("end_bushing"):
            continue
        sources = (component.sources.get(part) for part in (key, key.split(".")[0]))
        rows.append((key, readable(value, unit), next(filter(None, sources), "")))
    return tuple(rows)
