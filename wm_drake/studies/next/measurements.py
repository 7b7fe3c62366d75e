"""Measurements that could be made of a machine: which numbers each gives, and how well.

Each has a function that returns its numbers for machines, so that the same code predicts them,
differentiates them and makes them up for a planted machine. Numbers that scatter by a part of
themselves are logarithms.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np
import xarray as xr

from wm_drake.errors import InputError, check_known, input_error, problems_inside
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.key_patterns import ANY, keys_like
from wm_drake.model.machine import Machine
from wm_drake.parameters import Change, MachineParameters
from wm_drake.parameters.candidates import (
    AnyCandidate,
    BenchCandidate,
    CandidateFile,
    ModesCandidate,
    NumberCandidate,
    RunCandidate,
)
from wm_drake.parameters.components import ComponentParameters
from wm_drake.parameters.elements import BushingType, CurveTable
from wm_drake.parameters.keys import field_at, unit_of
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, Unit
from wm_drake.parameters.variation import change_of, value_at
from wm_drake.report.formatting import shape_name
from wm_drake.rigs import Bench, Harmonic, bushing_bench, damper_bench, force_loops, measures_of
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.modes.natural import natural_modes

FREQUENCY, LENGTH, ANGLE = Unit("Hz", "Hz"), Unit("m", "mm"), Unit("rad", "deg")


@dataclass(frozen=True)
class TriedMachines:
    """Machines that were tried, and the runs of each.

    Attributes:
        machine: Built machine whose elements all of them have.
        parameters: The machines.
        runs: Measures over `point` and `load`, with the gasket (True) and without.
    """

    machine: Machine
    parameters: Sequence[MachineParameters]
    runs: Mapping[bool, xr.Dataset]


@dataclass(frozen=True)
class CandidateMeasurement:
    """A measurement that could be made.

    Attributes:
        words: What is done, with the accuracy.
        cost: NaN if it is not known.
        deviations: Standard deviations of the errors of its numbers, given the numbers of the
            machine in the middle of what is known. (n,) -> (n,)
        numbers: What it gives of machines. (machines, n)
        run: Load and gasket of its run; None without a run.
        sensors: Sensors of its run.
    """

    name: str
    words: str
    cost: float
    deviations: Callable[[FloatArray], FloatArray]
    numbers: Callable[[TriedMachines], FloatArray]
    run: tuple[str, bool] | None = None
    sensors: tuple[str, ...] = ()

    def repeats(self, other: "CandidateMeasurement") -> bool:
        """Return whether both read a sensor in the same run, whose error is one and the same."""
        is_same = self.run is not None and self.run == other.run
        return is_same and bool({*self.sensors} & {*other.sensors})


def measurements_of(machine: Machine, file: CandidateFile) -> tuple[CandidateMeasurement, ...]:
    """Return the measurements of a file that a machine allows.

    Args:
        machine: Built machine, with loads and sensors of the file.

    Raises:
        InputError: a candidate names an unknown part, or its accuracy is not above 0.
    """
    allowed = list[CandidateMeasurement]()
    for name, candidate in file.candidates.items():
        with problems_inside(f"candidates.{name}"):
            allowed += _MAKERS[candidate.kind](machine, name, candidate, file)
    if not allowed:
        raise input_error("no candidate fits the machine; allowed are patterns of its parts")
    return tuple(allowed)


def _of_numbers(
    machine: Machine, name: str, candidate: NumberCandidate, _: CandidateFile
) -> Iterator[CandidateMeasurement]:
    """Yield a measurement of each match of a pattern, or of all keys together."""
    is_pattern = any(ANY in key for key in candidate.keys)
    matches = [keys_like(machine, key) for key in candidate.keys]
    groups: dict[str, list[str]] = {}
    for key in (key for keys in matches for key in keys):
        part = ".".join(key.split(".")[:2]) if is_pattern else ""
        groups.setdefault(part, []).append(key)
    for part, keys in groups.items():
        # checks the names of the keys, too
        parameters = with_sdf_values(machine.drawn.plant, machine.parameters, keys)
        deviation = _deviations_of_numbers(parameters, candidate.accuracy, keys)
        if any(value_at(machine.parameters, key) is None for key in keys):
            continue  # only the SDF has it: nothing about it is in doubt
        label = part.partition(".")[2] or part
        key_of_part = f"{name}.{label}" if label else name
        yield _measurement(key_of_part, candidate, label, deviation, _Numbers(tuple(keys)).numbers)


@dataclass(frozen=True)
class _Numbers:
    """Numbers at key paths."""

    keys: tuple[str, ...]

    def numbers(self, machines: TriedMachines) -> FloatArray:
        """Return the numbers of machines. (machines, n)"""
        rows = [np.concatenate([*_values(p, self.keys)]) for p in machines.parameters]
        return np.array(rows)


def _values(parameters: MachineParameters, keys: Sequence[str]) -> Iterator[FloatArray]:
    """Yield the values at key paths; of a table its nominal stiffness. (1 or 3,)"""
    for key in keys:
        value = value_at(parameters, key)
        yield np.atleast_1d(value.nominal_stiffness if isinstance(value, CurveTable) else value)


def _deviations_of_numbers(
    parameters: MachineParameters, accuracy: str, keys: Sequence[str]
) -> Callable[[FloatArray], FloatArray]:
    """Return the function with the deviations of the errors of numbers."""
    shares, sizes = list[float](), list[float]()
    for key, values in zip(keys, _values(parameters, keys), strict=True):
        original, field = field_at(parameters, key)
        unit = None if field is None else unit_of(field.annotation, field.metadata)
        if isinstance(original, CurveTable):
            unit = original.stiffness_unit
        if unit is None:
            raise input_error(f"'{key}' is not a number of the machine", key="keys")
        change, size = change_of(accuracy, unit, "accuracy")
        if change is Change.DISTANCE or not size > 0.0:
            raise _not_positive(accuracy, f"2 % or 1 {unit.shown}")
        is_share = change is Change.PERCENT
        if is_share and not np.all(values):
            raise input_error(f"is a part of '{key}', which is 0; give a value", key="accuracy")
        shares += [size if is_share else 0.0] * len(values)
        sizes += [0.0 if is_share else size] * len(values)
    return lambda numbers: np.array(shares) * np.abs(numbers) + np.array(sizes)


def _of_bench(
    machine: Machine, name: str, candidate: BenchCandidate, _: CandidateFile
) -> Iterator[CandidateMeasurement]:
    """Yield a measurement of each component and axis on the bench."""
    parameters = machine.parameters
    known = [f"damper_types.{kind}" for kind in parameters.damper_types]
    known += [f"bushing_types.{kind}" for kind in parameters.bushing_types]
    known += ["gasket"] if parameters.gasket else []
    if ANY not in candidate.component:
        message = f"no component '{candidate.component}'"
        check_known(candidate.component, known, message, key="component")
    share = _share(candidate.accuracy)
    for component in (key for key in known if fnmatchcase(key, candidate.component)):
        described = value_at(parameters, component)
        is_bushing = isinstance(described, BushingType)
        if is_bushing and not candidate.axes:
            raise input_error("is missing; write for example [x, y, about_y]", key="axes")
        for axis in candidate.axes if is_bushing else ("",):
            label = shape_name(axis or component.partition(".")[2])
            loops = _Loops(component, axis, tuple(_motions(candidate, axis)))
            loops.bench(described)  # the axis is checked
            yield _measurement(
                f"{name}.{label}", candidate, label, _of_moduli(share), loops.numbers
            )


def _motions(candidate: BenchCandidate, axis: str) -> Iterator[Harmonic]:
    rotates = axis.startswith("about")
    for frequency in quantities_of(candidate.frequency, FREQUENCY, "frequency"):
        unit = ANGLE if rotates else LENGTH
        for amplitude in quantities_of(candidate.amplitude, unit, "amplitude"):
            yield Harmonic(frequency, amplitude)


@dataclass(frozen=True)
class _Loops:
    """Loops of a component: in-phase and out-of-phase modulus of each. [N/m or N m/rad]"""

    component: str
    axis: str
    motions: tuple[Harmonic, ...]

    def bench(self, component: ComponentParameters) -> Bench:
        """Return a component on the bench."""
        if isinstance(component, BushingType):
            return bushing_bench(component, self.axis)
        return damper_bench(component)

    def numbers(self, machines: TriedMachines) -> FloatArray:
        """Return the moduli of machines, of which many share the component. (machines, 2 loops)"""
        components = [value_at(parameters, self.component) for parameters in machines.parameters]
        texts = [component.model_dump_json() for component in components]
        moduli = {t: self._moduli(c) for t, c in dict(zip(texts, components, strict=True)).items()}
        return np.array([moduli[text] for text in texts])

    def _moduli(self, component: ComponentParameters) -> list[float]:
        """Return the moduli of a component. (2 loops)"""
        loops = map(measures_of, force_loops(self.bench(component), self.motions))
        moduli = [m.dynamic_stiffness * np.exp(1j * m.loss_angle) for m in loops]
        return [part for z in moduli for part in (z.real, z.imag)]


def _of_moduli(share: float) -> Callable[[FloatArray], FloatArray]:
    """Return the function with the deviations of moduli: a share of the size of each."""

    def deviations(numbers: FloatArray) -> FloatArray:
        sizes = np.hypot(*numbers.reshape(-1, 2).T)
        return share * np.repeat(sizes, 2)

    return deviations


def _of_run(
    machine: Machine, name: str, candidate: RunCandidate, file: CandidateFile
) -> Iterator[CandidateMeasurement]:
    """Yield a measurement of each load, and of each sensor if they are apart."""
    parameters, deviation = machine.parameters, _constant(_share(candidate.accuracy))
    if not candidate.gasket and parameters.gasket is None:
        return
    known = [load for load in parameters.loads if load not in file.loads]
    every = [sensor for sensor in parameters.sensors if sensor not in file.sensors]
    for load in known if candidate.load == ANY else [candidate.load]:
        check_known(load, parameters.loads, f"no load '{load}'", key="load")
        for sensors in _sensor_groups(candidate, every):
            for sensor in sensors:
                check_known(sensor, parameters.sensors, f"no sensor '{sensor}'", key="sensors")
            only = sensors if candidate.sensors == "each" else ()
            reading = _Reading((load, candidate.gasket), sensors)
            full, label = ".".join([name, load, *only]), ", ".join([load, *only])
            made = _measurement(full, candidate, label, deviation, reading.numbers)
            yield replace(made, run=reading.run, sensors=sensors)


@dataclass(frozen=True)
class _Reading:
    """Logarithms of the amplitudes of sensors in a run, of a load, with gasket or without."""

    run: tuple[str, bool]
    sensors: tuple[str, ...]

    def numbers(self, machines: TriedMachines) -> FloatArray:
        """Return the logarithms of machines, NaN of a sensor that nothing moves.

        Returns:
            (machines, sensors)
        """
        load, gasket = self.run
        read = machines.runs[gasket].amplitude.sel(load=load, sensor=list(self.sensors))
        return np.log(read.where(read > 0.0).transpose("point", "sensor").values)


def _sensor_groups(candidate: RunCandidate, every: Sequence[str]) -> list[tuple[str, ...]]:
    if candidate.sensors == "each":
        return [(sensor,) for sensor in every]
    return [tuple(every)] if candidate.sensors == "all" else [candidate.sensors]


def _of_modes(
    machine: Machine, name: str, candidate: ModesCandidate, _: CandidateFile
) -> Iterator[CandidateMeasurement]:
    """Yield the measurement of natural frequencies."""
    if candidate.gasket or machine.parameters.gasket is not None:
        deviation = _constant(_share(candidate.accuracy))
        yield _measurement(name, candidate, "", deviation, _Frequencies(candidate).numbers)


@dataclass(frozen=True)
class _Frequencies:
    """Logarithms of natural frequencies."""

    candidate: ModesCandidate

    def numbers(self, machines: TriedMachines) -> FloatArray:
        """Return the logarithms of machines, NaN for a mode that is missing. (machines, n)"""
        rows = np.full((len(machines.parameters), self.candidate.count), np.nan)
        for row, parameters in zip(rows, machines.parameters, strict=True):
            modes = natural_modes(machines.machine, parameters, gasket=self.candidate.gasket)
            frequencies = modes.frequency.values[: self.candidate.count]
            row[: len(frequencies)] = np.log(frequencies)
        return rows


_MAKERS: Mapping[str, Callable[..., Iterator[CandidateMeasurement]]] = {
    "number": _of_numbers,
    "bench": _of_bench,
    "run": _of_run,
    "modes": _of_modes,
}
"""Makers of measurements by the kind of the candidate."""


def _measurement(
    name: str,
    candidate: AnyCandidate,
    label: str,
    deviations: Callable[[FloatArray], FloatArray],
    numbers: Callable[[TriedMachines], FloatArray],
) -> CandidateMeasurement:
    given = candidate.words or shape_name(name).replace(".", " ")  # a name ends with the label
    words = given.replace("{}", shape_name(label))
    cost = np.nan if candidate.cost is None else candidate.cost
    return CandidateMeasurement(
        name, f"{words.strip()} (±{candidate.accuracy})", cost, deviations, numbers
    )


def _constant(share: float) -> Callable[[FloatArray], FloatArray]:
    """Return the function with the deviation of logarithms."""
    return lambda numbers: np.full(len(numbers), share)


def _share(text: str) -> float:
    """Return an accuracy that is a part of each number."""
    try:
        share = Share().number(text)
    except ValueError as error:
        raise input_error(str(error), key="accuracy") from None
    if not share > 0.0:
        raise _not_positive(text, "5 %")
    return share


def _not_positive(text: str, example: str) -> InputError:
    return input_error(
        f"'{text}' is not a standard deviation above 0; write for example {example}",
        key="accuracy",
    )
