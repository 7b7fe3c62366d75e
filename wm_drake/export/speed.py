"""How fast an FMU runs on this computer, with FMPy as the importer."""

import shutil
import time
from pathlib import Path

SIMULATED = 5.0
"""Simulated time of a measurement. [s]"""
COMMUNICATION_STEP = 0.01
"""Communication step of a measurement. [s]"""


def real_time_factor(path: Path) -> float:
    """Return how many times faster than real time an FMU runs, in processor time of one core.

    The drum stands: the number of operations does not depend on the motion.
    """
    import fmpy  # half a second to import
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    description = fmpy.read_model_description(str(path))
    is_second = description.fmiVersion == "2.0"
    folder = fmpy.extract(str(path))
    try:
        machine = (FMU2Slave if is_second else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="machine",
        )
        machine.instantiate()
        if is_second:
            machine.setupExperiment(startTime=0.0)
        machine.enterInitializationMode()
        machine.exitInitializationMode()
        begin = time.process_time()
        for k in range(round(SIMULATED / COMMUNICATION_STEP)):
            machine.doStep(k * COMMUNICATION_STEP, COMMUNICATION_STEP)
        duration = time.process_time() - begin
        machine.terminate()
        machine.freeInstance()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return SIMULATED / duration
