"""Datasets of modes: what tables, files, JSON, figures and sentences show."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import SPEED, Quantity
from wm_drake.studies.modes import quantities as q
from wm_drake.studies.modes.amplitude import AmplitudeMode
from wm_drake.studies.modes.campbell import Campbell, CriticalSpeed
from wm_drake.studies.modes.linearisation import SLIDING, STUCK
from wm_drake.studies.modes.sensitivity import Sensitivity
from wm_drake.studies.modes.shapes import Mode, Nearness, parts

RAD, M = Unit("rad", "rad"), Unit("m", "m")


def labelled(labels: Mapping[str, Sequence[Any]], **variables: xr.Variable) -> xr.Dataset:
    """Return a dataset over `row` with labels of its rows."""
    return xr.Dataset(variables, {name: ("row", list(of)) for name, of in labels.items()})


def of_modes(modes: Mapping[str, Sequence[Mode]], elements: Sequence[str]) -> xr.Dataset:
    """Return the modes of linearisations.

    Returns:
        Over `row` with the labels `linearisation` and `mode`: frequency [Hz], damping ratio, and
        of each coordinate participation and shape [rad, m]. Also over `element`: shares of strain
        energy and dissipation.
    """
    rows = [(name, mode) for name in (STUCK, SLIDING) for mode in modes[name]]
    every = [mode for _, mode in rows]
    variables = {
        "frequency": q.FREQUENCY.hidden("row", [mode.frequency_hz for mode in every]),
        "damping_ratio": q.DAMPING.hidden("row", [mode.damping_ratio for mode in every]),
    }
    for place, coordinate in enumerate(COORDINATES):
        shape = Quantity(f"shape, {coordinate}", RAD if place < 3 else M)
        values = np.array([mode.shape[place] for mode in every])
        variables[f"shape_{coordinate}_real"] = shape.hidden("row", values.real)
        variables[f"shape_{coordinate}_imag"] = shape.hidden("row", values.imag)
    for place, coordinate in enumerate(COORDINATES):
        shares = [mode.participation[place] for mode in every]
        share = q.PARTICIPATION.named(coordinate)
        variables[f"participation_{coordinate}"] = share.variable("row", shares)
    for name, quantity in (("strain_energy", q.STRAIN_ENERGY), ("dissipation", q.DISSIPATION)):
        of_elements = np.array([getattr(mode, name) for mode in every])
        variables[name] = quantity.hidden(("row", "element"), of_elements)
    labels = {"linearisation": [name for name, _ in rows], "mode": [mode.name for mode in every]}
    return labelled(labels, **variables).assign_coords(element=list(elements))


def at_amplitude(modes: Sequence[AmplitudeMode], amplitude: float) -> xr.Dataset:
    """Return frequency and damping ratio over `mode` at an amplitude [m]; NaN if not reached."""
    values = np.array([mode.at(amplitude) or (np.nan, np.nan) for mode in modes]).reshape(-1, 2)
    return of_names([mode.name for mode in modes], values[:, 0], values[:, 1])


def of_names(names: Sequence[str], frequency: Any, damping: Any) -> xr.Dataset:
    """Return frequency [Hz] and damping ratio over `mode`."""
    return xr.Dataset(oscillation("mode", frequency, damping), {"mode": list(names)})


def oscillation(dims: str | Sequence[str], frequency: Any, damping: Any) -> dict[str, xr.Variable]:
    """Return the two numbers of an oscillation: frequency [Hz] and damping ratio."""
    return {
        "frequency": q.FREQUENCY.variable(dims, frequency),
        "damping_ratio": q.DAMPING.variable(dims, damping),
    }


def over_amplitude(modes: Sequence[AmplitudeMode]) -> xr.Dataset:
    """Return frequency and damping ratio of modes over their amplitude, a row for each point."""
    names = [mode.name for mode in modes for _ in mode.amplitude]
    amplitude, frequency, damping = (
        np.concatenate([np.zeros(0), *(getattr(mode, name) for mode in modes)])
        for name in ("amplitude", "frequency_hz", "damping_ratio")
    )
    return labelled(
        {"mode": names},
        amplitude=q.AMPLITUDE.variable("row", amplitude),
        **oscillation("row", frequency, damping),
    )


def over_speed(
    diagrams: Mapping[str, Campbell], names: Mapping[str, list[list[str]]]
) -> xr.Dataset:
    """Return the Campbell diagrams over `linearisation`, `speed` [rad/s] and `curve` from 1 on.

    Args:
        names: Name of each curve at each speed, from its shape there.
    """
    dims, of = ("speed", "curve"), []
    for name, diagram in diagrams.items():
        each = {
            "mode": (dims, np.array(names[name], dtype=object)),
            **oscillation(dims, diagram.frequency_hz, diagram.damping_ratio),
            "mac": q.MAC.variable(dims, diagram.mac),
        }
        curves = np.arange(1, diagram.value.shape[1] + 1)
        of.append(xr.Dataset(each, {"speed": diagram.speed, "curve": curves}))
    joined = xr.concat(of, xr.Variable("linearisation", list(diagrams)), join="outer")
    return joined.assign_coords(speed=SPEED.variable("speed", joined.speed))


def critical_speeds_of(
    critical: Mapping[str, Sequence[CriticalSpeed]], diagrams: xr.Dataset
) -> xr.Dataset:
    """Return order, speed [rad/s] and damping ratio of critical speeds.

    Args:
        diagrams: As of `over_speed`; a mode has the name of the nearest speed there.
    """
    rows = [(name, one) for name in (SLIDING, STUCK) for one in critical[name]]
    every = [one for _, one in rows]
    names = [name_at(diagrams, name, one.mode, one.speed) for name, one in rows]
    return labelled(
        {"linearisation": [name for name, _ in rows], "mode": names},
        order=q.ORDER.variable("row", [one.order for one in every]),
        speed=q.CRITICAL_SPEED.variable("row", [one.speed for one in every]),
        damping_ratio=q.DAMPING.variable("row", [one.damping_ratio for one in every]),
    )


def name_at(diagrams: xr.Dataset, linearisation: str, mode: int, speed: float) -> str:
    """Return the name of a mode at the nearest speed of its diagram. [rad/s]"""
    curve = diagrams.mode.sel(linearisation=linearisation).isel(curve=mode)
    return str(curve.sel(speed=speed, method="nearest").item())


def of_numbers(
    sensitivities: Mapping[str, Sequence[Sensitivity]], modes: Mapping[str, Sequence[Mode]]
) -> xr.Dataset:
    """Return the sensitivity of each mode to each number of the machine file, a row each."""
    rows = [
        (name, mode.name, entry, index)
        for name, entries in sensitivities.items()
        for entry in entries
        for index, mode in enumerate(modes[name])
    ]
    per = [entry.unit.shown if entry.per_unit else RELATIVE for _, _, entry, _ in rows]
    frequency = [entry.frequency[index] for _, _, entry, index in rows]
    damping = [entry.damping[index] for _, _, entry, index in rows]
    labels = {
        "linearisation": [name for name, *_ in rows],
        "mode": [name for _, name, *_ in rows],
        "key": [entry.key for _, _, entry, _ in rows],
        "per": per,
    }
    return labelled(
        labels,
        relative_change_of_frequency=q.FREQUENCY_CHANGE.variable("row", frequency),
        change_of_damping_ratio=q.DAMPING_CHANGE.variable("row", damping),
    )


RELATIVE = "relative change"
"""What the sensitivity to a number that is not zero is divided by."""


def of_gaps(gaps: Mapping[str, Nearness]) -> xr.Dataset:
    """Return the smallest gap over the cycle of each mode, and which mode has the smallest one."""
    rows = [
        (name, mode, gap, mode == near.nearest)
        for name, near in gaps.items()
        for mode, gap in near.of_mode.items()
    ]
    labels = {
        "linearisation": [name for name, *_ in rows],
        "mode": [mode for _, mode, *_ in rows],
        "between": [parts(gap) for _, _, gap, _ in rows],
    }
    return labelled(
        labels,
        smallest_gap=q.SMALLEST_GAP.variable("row", [gap.distance for _, _, gap, _ in rows]),
        is_nearest=xr.Variable("row", [nearest for *_, nearest in rows]),
    )
