"""The study of modes: its task, and its result as files, JSON and page."""

import logging
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from wm_drake.model.machine import Machine
from wm_drake.parameters.units import Unit
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.modes.animation import mode_motion
from wm_drake.studies.modes.options import ModesOptions
from wm_drake.studies.modes.study import AMPLITUDE, SLIDING, STUCK, MachineModes, modes
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Facts, Result, Task

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True)
class ModesResult(Result):
    """Modes, and the pages of their animations by name of the mode."""

    modes: MachineModes
    replays: dict[str, str]

    float_format = "%.8g"

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return modes, amplitudes, Campbell diagram and sensitivities."""
        from wm_drake.studies.modes import page

        return {
            "modes": page.modes_table(self.modes),
            "amplitudes": page.amplitudes_table(self.modes),
            "campbell": page.campbell_table(self.modes),
            "sensitivities": page.sensitivities_table(self.modes),
        }

    def write(self, folder: Path) -> None:
        """Write the tables, and the animations."""
        super().write(folder)
        for name, text in self.replays.items():
            (folder / replay_file(name)).write_text(text, encoding="utf-8")

    def as_json(self) -> dict[str, Any]:
        """Return the modes for JSON."""
        return _as_json(self.modes)

    def terminal(self) -> "list[Table | str]":
        """Return the modes and a summary."""
        from wm_drake.studies.modes.page import summary, terminal_table

        return [terminal_table(self.modes), summary(self.modes)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        from wm_drake.studies.modes.page import modes_page

        return modes_page(self.modes, facts, {name: replay_file(name) for name in self.replays})


class ModesTask(Task):
    """The study with checked options."""

    def __init__(self, options: ModesOptions, machine: Machine) -> None:
        """Read the amplitude.

        Raises:
            InputError: the amplitude is not a length.
        """
        self.options, self.machine = options, machine
        self.amplitude = quantities_of(options.amplitude, Unit("m", "mm"), "--amplitude")[0]

    def run(self, executor: Executor) -> ModesResult:
        """Compute the modes and, with `--replay`, their animations."""
        with executor.fraction("modes") as progress:
            result = modes(
                self.machine,
                self.options.load,
                gasket=not self.options.no_gasket,
                amplitude=self.amplitude,
                run_up=True,
                progress=progress,
            )
        return ModesResult(result, _replays(result) if self.options.replay else {})


def replay_file(name: str) -> str:
    """Return the name of the file with the animation of a mode."""
    return f"replay_{re.sub('[^a-z]', '_', name)}.html"


def _replays(result: MachineModes) -> dict[str, str]:
    """Return the page of the animation of each sliding mode."""
    from wm_drake.model.replay import replay_page

    # Meshcat would print the address of its server
    logging.getLogger("drake").setLevel(logging.WARNING)
    return {
        mode.name: replay_page(result.parameters, mode_motion(mode), title=mode.name)
        for mode in result.modes[SLIDING]
    }


def _as_json(result: MachineModes) -> dict[str, Any]:
    rpm = Unit("rad/s", "rpm")

    def entry(mode: Any) -> dict[str, Any]:
        return {
            "frequency_Hz": mode.frequency_hz,
            "damping_ratio": mode.damping_ratio,
            "name": mode.name,
        }

    def diagram(name: str) -> dict[str, Any]:
        computed = result.diagrams[name]
        return {
            "rpm": [rpm.from_si(float(speed)) for speed in computed.speed],
            "frequency_Hz": _finite(computed.frequency_hz.T),
            "damping_ratio": _finite(computed.damping_ratio.T),
            "name": [mode.name for mode in result.modes[name]],
        }

    return {
        "machine": result.parameters.name,
        "load": result.load,
        "gasket": result.gasket,
        "amplitude_mm": Unit("m", "mm").from_si(result.amplitude),
        "modes": {
            STUCK: [entry(mode) for mode in result.modes[STUCK]],
            SLIDING: [entry(mode) for mode in result.modes[SLIDING]],
            AMPLITUDE: [entry(mode) for mode in result.at_amplitude],
        },
        "critical_rpm": [rpm.from_si(float(speed)) for speed in result.critical_speeds],
        "critical": {
            name: [
                {
                    "order": critical.order,
                    "name": result.modes[name][critical.mode].name,
                    "rpm": rpm.from_si(critical.speed),
                    "damping_ratio": critical.damping_ratio,
                }
                for critical in speeds
            ]
            for name, speeds in result.critical.items()
        },
        "campbell": diagram(SLIDING),
        "campbell_stuck": diagram(STUCK),
    }


def _finite(rows: Any) -> list[list[float | None]]:
    """Return rows of numbers; JSON has no NaN."""
    return [[float(value) if value == value else None for value in row] for row in rows]
