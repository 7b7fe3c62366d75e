"""Datasets of modes: what tables, files, JSON, figures and sentences show."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.parameters.units import Unit
from wm_drake.report.labelled import rows_of
from wm_drake.report.quantity import SPEED, Quantity
from wm_drake.studies.modes import quantities as q
from wm_drake.studies.modes.linearisation import SLIDING, STUCK
from wm_drake.studies.modes.shapes import Mode, Nearness, parts

RAD, M = Unit("rad", "rad"), Unit("m", "m")


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
    return rows_of(labels, **variables).assign_coords(element=list(elements))


def at_amplitude(over: xr.Dataset, names: Sequence[str], amplitude: float) -> xr.Dataset:
    """Return frequency and damping ratio over `mode` at an amplitude [m]; NaN if not reached.

    Args:
        over: As of `amplitude_modes` in `wm_drake.studies.modes.amplitude`.
        names: Names of the modes.
    """
    values = np.full((len(names), 2), np.nan)
    for row, name in zip(values, names, strict=True):
        one = over.isel(row=(over.mode == name).values)
        known = one.amplitude.values
        if known.size and known[0] <= amplitude <= known[-1] * (1.0 + 1e-9):
            at = np.log(amplitude), np.log(known)
            row[:] = [np.interp(*at, one[v].values) for v in ("frequency", "damping_ratio")]
    return of_names(names, *values.T)


def of_names(names: Sequence[str], frequency: Any, damping: Any) -> xr.Dataset:
    """Return frequency [Hz] and damping ratio over `mode`."""
    return xr.Dataset(oscillation("mode", frequency, damping), {"mode": list(names)})


def oscillation(dims: str | Sequence[str], frequency: Any, damping: Any) -> dict[str, xr.Variable]:
    """Return the two numbers of an oscillation: frequency [Hz] and damping ratio."""
    return {
        "frequency": q.FREQUENCY.variable(dims, frequency),
        "damping_ratio": q.DAMPING.variable(dims, damping),
    }


def over_speed(diagrams: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return Campbell diagrams over `linearisation`, `speed` [rad/s] and `curve` from 1 on."""
    names = xr.Variable("linearisation", list(diagrams))
    joined = xr.concat(list(diagrams.values()), names, join="outer")
    return joined.assign_coords(speed=SPEED.variable("speed", joined.speed))


def of_numbers(
    sensitivities: Mapping[str, xr.Dataset], modes: Mapping[str, Sequence[Mode]]
) -> xr.Dataset:
    """Return the sensitivity of each mode to each number of the machine file, a row each.

    Args:
        sensitivities: Of each linearisation.
        modes: Of each linearisation.
    """
    every = [
        one.assign_coords(mode=[mode.name for mode in modes[name]]).stack(
            row=("key", "mode"), create_index=False
        )
        for name, one in sensitivities.items()
    ]
    rows = xr.concat(every, "row")
    counts = [one.sizes["row"] for one in every]
    labels = {
        "linearisation": np.repeat(list(sensitivities), counts).tolist(),
        **{name: rows[name].values.tolist() for name in ("mode", "key", "per")},
    }
    changes = ("relative_change_of_frequency", "change_of_damping_ratio")
    return rows_of(labels, **{name: rows[name].variable for name in changes})


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
    return rows_of(
        labels,
        smallest_gap=q.SMALLEST_GAP.variable("row", [gap.distance for _, _, gap, _ in rows]),
        is_nearest=xr.Variable("row", [nearest for *_, nearest in rows]),
    )
