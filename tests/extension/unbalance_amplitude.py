"""Amplitude against unbalance mass: a study of another package, in one file.

All masses of a load are multiplied by factors. How far the amplitudes are from a straight line
through zero shows how nonlinear the machine is.
"""

from pathlib import Path

from wm_drake.studies.study import PROFILE, Options, Study, Task, option


class UnbalanceOptions(Options):
    """Options of the study."""

    load: str = option("middle", "Load whose masses are multiplied.", "NAME")
    largest: float = option(2.0, "Largest factor.", "FACTOR", ge=0.1, le=10.0)
    count: int = option(20, "Number of factors.", "N", ge=2, le=10000)
    profile: Path | None = PROFILE


class UnbalanceTask(Task):
    """The study with checked options."""

    def __init__(self, options, machine):
        """Make a case for each factor."""
        import numpy as np

        from wm_drake.studies.inputs import selected_cases

        self.machine = machine
        (case,) = selected_cases(machine.parameters, [options.load], True, options.profile)
        self.factors = options.largest * np.arange(1, options.count + 1) / options.count
        self.cases = [_scaled(case, factor) for factor in self.factors.tolist()]

    def run(self, executor):
        """Run all cases in one batch."""
        from wm_drake.parameters.units import Unit
        from wm_drake.report.labelled import LabelledTable
        from wm_drake.report.quantity import Quantity, shown
        from wm_drake.studies.answer import Answer, Part
        from wm_drake.studies.experiment import Experiment, failures

        experiment = Experiment(self.machine, ("amplitudes",), executor.simulate)
        masses = [sum(u.mass for u in case.load.unbalances) for case in self.cases]
        runs = experiment.over({"mass": masses}, self.cases, "masses")
        mass = Quantity("mass", Unit("kg", "kg")).variable("mass", masses)
        data = runs[["amplitude"]].assign_coords(mass=mass)
        per_kg = shown(data.amplitude[:, 0]) / masses
        caption = "Amplitude of each sensor over the mass of the unbalance."
        table = LabelledTable("amplitudes", data, "Amplitudes", caption, across="sensor")
        return Answer(
            f"Amplitude against unbalance of machine {self.machine.parameters.name}",
            f"Sensor {data.sensor.values[0]} moves {per_kg[0]:.1f} mm for each kg of a small "
            f"unbalance, {per_kg[-1]:.1f} mm of the largest.",
            self.machine.parameters,
            (Part("Figures", [_plot(data, caption)]), Part("Amplitudes", [table])),
            diverged=failures(runs),
        )


def _scaled(case, factor):
    """Return a case with all masses of its load multiplied."""
    from dataclasses import replace

    masses = [u.model_copy(update={"mass": factor * u.mass}) for u in case.load.unbalances]
    load = case.load.model_copy(update={"unbalances": tuple(masses)})
    return replace(case, name=f"factor {factor:g}", load=load)


def _plot(data, caption):
    from wm_drake.report.figure import COLOURS, Axis, Figure, Line, Panel
    from wm_drake.report.quantity import quantity_of, shown
    from wm_drake.studies.answer import Plot

    lines = tuple(
        Line(shown(data.mass), shown(data.amplitude.sel(sensor=name)), color=color, key=name)
        for name, color in zip(data.sensor.values.tolist(), COLOURS, strict=False)
    )
    x, y = (Axis(label=quantity_of(array).label) for array in (data.mass, data.amplitude))
    return Plot(Figure(panels=(Panel(marks=lines, x=x, y=y),), height=360.0), caption, caption)


UNBALANCE_AMPLITUDE = Study(
    name="unbalance-amplitude",
    about="Find how amplitudes grow with the mass of the unbalance.",
    options=UnbalanceOptions,
    begin=UnbalanceTask,
    quick={"count": 4},
)
