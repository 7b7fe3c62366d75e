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
        import pandas as pd

        from wm_drake.studies.table_result import ShownTable, TableResult

        table = executor.simulate(self.machine, ("amplitudes",), self.cases, "masses")
        sensors = [str(name) for name in table.sensor.values]
        masses = [sum(u.mass for u in case.load.unbalances) for case in self.cases]
        frame = pd.DataFrame({"mass_kg": masses})
        for index, sensor in enumerate(sensors):
            frame[f"{sensor}_mm"] = 1e3 * table.amplitude.values[:, index]
        per_kg = frame[f"{sensors[0]}_mm"] / frame["mass_kg"]
        name = self.machine.parameters.name
        return TableResult(
            f"Amplitude against unbalance of machine {name}",
            self.machine.parameters,
            f"Sensor {sensors[0]} moves {per_kg.iloc[0]:.1f} mm for each kg of a small unbalance, "
            f"{per_kg.iloc[-1]:.1f} mm of the largest.",
            (ShownTable("Amplitudes", "Largest amplitude of each sensor.", frame),),
            (_figure(frame, sensors),),
            tuple(f"{case.name}: {text}" for case, text in self._diverged(table)),
        )

    def _diverged(self, table):
        pairs = zip(self.cases, map(str, table.diverged.values), strict=True)
        return [(case, text) for case, text in pairs if text]


def _scaled(case, factor):
    """Return a case with all masses of its load multiplied."""
    from dataclasses import replace

    masses = [u.model_copy(update={"mass": factor * u.mass}) for u in case.load.unbalances]
    load = case.load.model_copy(update={"unbalances": tuple(masses)})
    return replace(case, name=f"factor {factor:g}", load=load)


def _figure(frame, sensors):
    from wm_drake.report.figure import COLOURS, Axis, Figure, Line, Panel

    lines = tuple(
        Line(frame["mass_kg"], frame[f"{name}_mm"], color=color, key=name)
        for name, color in zip(sensors, COLOURS, strict=False)
    )
    panel = Panel(marks=lines, x=Axis(label="mass, kg"), y=Axis(label="amplitude, mm"))
    caption = "Amplitude of each sensor over the mass of the unbalance."
    return Figure(panels=(panel,), height=360.0), caption, caption


UNBALANCE_AMPLITUDE = Study(
    name="unbalance-amplitude",
    about="Find how amplitudes grow with the mass of the unbalance.",
    options=UnbalanceOptions,
    begin=UnbalanceTask,
    quick={"count": 4},
)
