"""Check the options of the drive study, and run it."""

from typing import Any

import numpy as np

from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.studies.answer import Answer
from wm_drake.studies.drive.options import DriveOptions
from wm_drake.studies.drive.page import drive_answer
from wm_drake.studies.drive.study import (
    MEASURES,
    find_thresholds,
    motor_with_limit,
    torque_map,
)
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import selected_cases
from wm_drake.studies.study import Task


class DriveTask(Task):
    """The study with checked options."""

    def __init__(self, options: DriveOptions, machine: Machine) -> None:
        """Check the drive, the loads and the profile."""
        self.options, self.machine = options, machine
        motor_with_limit(machine.parameters)
        self.cases = selected_cases(machine.parameters, options.load, True, options.profile)
        if not self.cases[0].profile.speed[-1] > 0.0:
            raise input_error(
                "the last speed of the profile is 0; allowed is a profile that ends at the speed "
                "that the drum must reach",
                key="profile",
            )

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs beside the machine."""
        return {"profile": self.cases[0].profile}

    def run(self, executor: Executor) -> Answer:
        """Find thresholds, and draw the map for the load that needs most."""
        options, parameters = self.options, self.machine.parameters
        loads = tuple(self.cases)
        experiment = Experiment(self.machine, MEASURES, executor.simulate, loads)
        thresholds = find_thresholds(experiment)
        needs = thresholds.passes_from.fillna(motor_with_limit(parameters)[1].torque).values
        worst = int(np.argmax(np.where(thresholds.passes_from.isnull(), np.inf, needs)))
        top = needs[worst]
        torques = (top * np.linspace(0.25, 2.0, options.torques)).tolist()
        factors = np.linspace(0.25, 1.5, options.unbalances).tolist()
        grid = torque_map(experiment, self.cases[worst], torques, factors)
        return drive_answer(parameters, self.cases[0].profile, thresholds, grid)
