"""Modes of a machine: three linearisations, Campbell diagram, critical speeds, sensitivities."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.batch import simulate_many
from wm_drake.errors import input_error
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.model.machine import Machine
from wm_drake.parameters import Load, MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.report.labelled import LabelledTable
from wm_drake.simulation.cases import case_of
from wm_drake.studies.modes import data
from wm_drake.studies.modes.amplitude import amplitude_modes
from wm_drake.studies.modes.campbell import campbell, critical_speeds, diagram_of
from wm_drake.studies.modes.linearisation import (
    MODES,
    SLIDING,
    STUCK,
    Linearisation,
    Spectrum,
    check_fixed_cabinet,
)
from wm_drake.studies.modes.quantities import AMPLITUDE, DAMPING, FREQUENCY
from wm_drake.studies.modes.sensitivity import numbers_of, sensitivities
from wm_drake.studies.modes.shapes import Mode, modes_of, names_at_speed
from wm_drake.studies.threads import on_one_thread

DEFAULT_AMPLITUDE = 5e-3
"""Amplitude of the third linearisation. [m]"""

LARGEST_AMPLITUDE = 0.1
"""Largest amplitude of the third linearisation. [m]"""

AMPLITUDES = np.geomspace(1e-5, 2e-2, 34)
"""Amplitudes of the curves over the amplitude. [m]"""

LAST_SPEED, SPEEDS = 1.5, 61
"""Campbell diagram: its last speed over the fastest of the spin profile; number of its speeds."""

ORDERS = (1.0, 2.0)
"""Orders of the drum's speed in the Campbell diagram."""


@dataclass(frozen=True)
class NaturalModes:
    """Natural modes of a machine with a drum that stands still.

    `Mode` has a complex shape and stays an object: figures and animations move the tub with it.

    Attributes:
        load: Name of the load; "" for the empty drum.
        modes: Modes by linearisation, stuck and sliding.
        amplitude: Amplitude of the third linearisation. [m]
        at_amplitude: `frequency` [Hz] and `damping_ratio` over `mode` there; NaN for a mode that
            could not be followed, and for a machine with telescopic dampers.
    """

    parameters: MachineParameters
    load: str
    modes: dict[str, list[Mode]]
    amplitude: float
    at_amplitude: xr.Dataset


@dataclass(frozen=True, repr=False)
class MachineModes(NaturalModes):
    """All modes of a machine.

    Attributes:
        rest_pose: Equilibrium: roll, pitch, yaw, x, y, z. (6,) [rad, m]
        gasket: Whether the gasket is in place.
        elements: Names of the elements on the tub, in the order of the shares of a mode.
        over_amplitude: `frequency` [Hz] and `damping_ratio` of each mode over `amplitude` [m].
        over_speed: Campbell diagrams of `STUCK` and `SLIDING` over `linearisation`, `speed` [rad/s]
            and `curve`: `mode`, the name from the shape at the speed, `frequency` [Hz],
            `damping_ratio` and `mac`.
        critical: `order`, `speed` [rad/s] and `damping_ratio` of critical speeds of each.
        sensitivities: Of each to the numbers of the machine file, for a drum that stands still.
        run_up: Peaks of the machine's own run-up, one run a load: `critical_speed` and `amplitude`
            at the sensors, as `simulate_many` returns them. None if not computed.
    """

    rest_pose: FloatArray
    gasket: bool
    elements: list[str]
    over_amplitude: xr.Dataset
    over_speed: xr.Dataset
    critical: xr.Dataset
    sensitivities: xr.Dataset
    run_up: xr.Dataset | None

    @property
    def critical_speeds(self) -> FloatArray:
        """Return the speeds at which the unbalance meets a mode with sliding friction. [rad/s]"""
        chosen = (self.critical.linearisation == SLIDING) & (self.critical.order == 1.0)
        return self.critical.speed.values[chosen.values]

    def labelled(self) -> xr.Dataset:
        """Return frequency, damping, shape and shares of each mode of both linearisations."""
        return data.of_modes(self.modes, self.elements)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a row for each mode of each linearisation, in units for reading."""
        return LabelledTable("shapes", self.labelled(), across="element").frame()

    def _repr_html_(self) -> str:
        """Return the table of modes for a notebook."""
        return str(self.to_dataframe().to_html(index=False))

    def __repr__(self) -> str:
        """Return frequencies and damping ratios of the modes with sliding friction, in one line."""
        shown = (
            f"{mode.name} {FREQUENCY.text(mode.frequency_hz)} ({DAMPING.text(mode.damping_ratio)})"
            for mode in self.modes[SLIDING]
        )
        return f"<Modes of '{self.parameters.name}', sliding friction: {', '.join(shown)}>"


@on_one_thread
def modes(
    machine: AnyMachine,
    load: Load | str | None = None,
    *,
    gasket: bool = True,
    amplitude: float = DEFAULT_AMPLITUDE,
    run_up: bool = False,
    progress: Callable[[float], None] = lambda fraction: None,
) -> MachineModes:
    """Return the modes of a machine.

    Args:
        machine: A built machine, its parameters, or its name or file.
        load: Point masses in the drum, or the name of one of the machine's loads; None for the
            empty drum. With a load, the equilibrium and the matrix are means over a revolution.
        gasket: False removes the gasket.
        amplitude: Amplitude of the third linearisation: displacement of To, with angles times
            0.25 m. [m]
        run_up: Whether to run the machine's loads over its spin profile, for the peaks.
        progress: Called with the fraction done.

    Raises:
        InputError: the load is unknown, the amplitude is not positive, or the machine cannot be
            set up.

    Example:
        >>> import wm_drake as wm
        >>> result = wm.modes(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> len(result.modes["sliding"])
        6
    """
    machine = machine_of(machine)
    parameters = machine.parameters
    _check_amplitude(amplitude)
    check_fixed_cabinet(parameters)
    linear = {
        STUCK: _linearisation(machine, load, gasket, friction=True),
        SLIDING: _linearisation(machine, load, gasket, friction=False),
    }
    spectra = {name: one.spectrum().first(MODES) for name, one in linear.items()}
    natural = {name: modes_of(spectra[name], one.wrench_slopes()) for name, one in linear.items()}
    progress(0.1)
    setup = machine.set_up(load, gasket=gasket)
    amplitudes = np.union1d(AMPLITUDES, amplitude)
    names = [mode.name for mode in natural[STUCK]]
    over = amplitude_modes(setup, spectra[STUCK], names, amplitudes)
    progress(0.3)
    last = LAST_SPEED * parameters.profile.highest_speed
    diagrams = {name: _diagram(linear[name], natural[name], last) for name in (SLIDING, STUCK)}
    progress(0.4)
    bars = _sensitivities(machine, load, gasket, spectra, lambda part: progress(0.4 + 0.5 * part))
    peaks = None
    if run_up and parameters.loads:
        cases = [case_of(parameters, name, gasket=gasket) for name in parameters.loads]
        peaks = simulate_many(machine, cases, measures=["amplitudes"])
    progress(1.0)
    return MachineModes(
        parameters,
        load if isinstance(load, str) else "" if load is None else "given",
        natural,
        amplitude,
        data.at_amplitude(over, names, amplitude),
        linear[STUCK].equilibrium[:6],
        gasket,
        linear[STUCK].names,
        over,
        data.over_speed({name: diagrams[name] for name in linear}),
        critical_speeds(diagrams, ORDERS),
        data.of_numbers(bars, natural),
        peaks,
    )


def _check_amplitude(amplitude: float) -> None:
    if not 0.0 < amplitude <= LARGEST_AMPLITUDE:
        raise input_error(
            f"{AMPLITUDE.text(amplitude)} is no amplitude; allowed are more than 0 and up to "
            f"{AMPLITUDE.text(LARGEST_AMPLITUDE)}",
            key="amplitude",
        )


def _diagram(linear: Linearisation, modes: Sequence[Mode], last: float) -> xr.Dataset:
    """Return the Campbell diagram of modes at standstill, up to a last speed. [rad/s]"""
    speeds = np.linspace(0.0, last, SPEEDS)
    spectra, macs = campbell(linear.spectrum, speeds, len(modes))
    names = [[mode.name for mode in modes], *map(names_at_speed, spectra[1:])]
    return diagram_of(speeds, spectra, macs, names)


@on_one_thread
def three_linearisations(
    machine: Machine,
    load: Load | str,
    *,
    parameters: MachineParameters | None = None,
    gasket: bool = True,
    amplitude: float = DEFAULT_AMPLITUDE,
) -> NaturalModes:
    """Return the natural modes of a machine with a load, without anything that takes seconds.

    Raises:
        InputError: the cabinet moves, or the machine cannot be set up.
    """
    numbers = parameters or machine.parameters
    check_fixed_cabinet(numbers)
    natural = {}
    for name, friction in ((SLIDING, False), (STUCK, True)):
        setup = machine.set_up(load, parameters=numbers, gasket=gasket, friction=friction)
        linear = Linearisation(setup, loaded=True)
        spectrum = linear.spectrum().first(MODES)
        natural[name] = modes_of(spectrum, linear.wrench_slopes())
    names = [mode.name for mode in natural[STUCK]]
    # the last setup is the one with friction
    if numbers.telescopic_dampers:
        missing = np.full(len(natural[STUCK]), np.nan)
        values = data.of_names(names, missing, missing)
    else:
        over = amplitude_modes(setup, spectrum, names, np.array([amplitude]))
        values = data.at_amplitude(over, names, amplitude)
    return NaturalModes(
        numbers, load if isinstance(load, str) else "given", natural, amplitude, values
    )


def _linearisation(
    machine: Machine, load: Load | str | None, gasket: bool, *, friction: bool
) -> Linearisation:
    setup = machine.set_up(load, gasket=gasket, friction=friction)
    return Linearisation(setup, loaded=load is not None)


def _sensitivities(
    machine: Machine,
    load: Load | str | None,
    gasket: bool,
    spectra: dict[str, Spectrum],
    progress: Callable[[float], None],
) -> dict[str, xr.Dataset]:
    context = machine.diagram.CreateDefaultContext()
    loaded = load is not None
    count = 2 * sum(1 for _ in numbers_of(machine.parameters, loaded))
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        progress(done / count)

    def matrix_of(friction: bool) -> Callable[[MachineParameters], FloatArray]:
        def matrix(parameters: MachineParameters) -> FloatArray:
            setup = machine.set_up(
                load, context=context, parameters=parameters, gasket=gasket, friction=friction
            )
            return Linearisation(setup, loaded=loaded).matrix()

        return matrix

    return {
        name: sensitivities(
            machine.parameters, spectra[name], matrix_of(name == STUCK), loaded, step
        )
        for name in (STUCK, SLIDING)
    }
