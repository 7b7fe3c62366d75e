"""3D replay of a case of a spin run."""

import logging

import numpy as np

from wm_drake.model.replay import Motion, replay_page
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.displacements import largest_motion
from wm_drake.studies.spin.study import CaseResult


def case_replay(parameters: MachineParameters, case: CaseResult) -> str:
    """Return the page of the 3D replay of a case around its largest amplitude."""
    # Meshcat would print the address of its server
    logging.getLogger("drake").setLevel(logging.WARNING)
    time, positions = largest_motion(case.record)
    shown = case.record.sel(time=time)
    cabinet = None
    if "cabinet_angle" in shown:
        cabinet = np.hstack([shown.cabinet_angle.values, shown.cabinet_position.values])
    gasket = case.has_gasket
    words = "" if gasket or parameters.gasket is None else ", without gasket"
    return replay_page(
        parameters,
        Motion(time, positions, shown.drum_speed.values, cabinet),
        title=f"Machine {parameters.name}, load {case.case.name}{words}",
        load=case.case.load,
        gasket=gasket,
    )
