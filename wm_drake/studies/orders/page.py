"""Show the orders of a record: waterfall and order map of each signal."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters.recorded.health import Finding
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, quantity_of, shown, text_of
from wm_drake.simulation.netcdf import netcdf_bytes
from wm_drake.simulation.orders import REVOLUTIONS
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.health import health_part
from wm_drake.studies.orders.study import FREQUENCY, at_orders_shown, largest_of_orders

WATERFALL_LINES = 40
"""Largest number of spectra of a waterfall."""

MAP_COLUMNS = 400
"""Largest number of columns of an order map."""


def orders_answer(maps: xr.Dataset, source: str, findings: Sequence[Finding] = ()) -> Answer:
    """Return the answer of the study.

    Args:
        maps: As of `orders_of` in `wm_drake.studies.orders.study`.
        source: Name of the file.
        findings: What the checks of its health found in the file.
    """
    unit = quantity_of(maps.amplitude).unit_text
    plots = tuple(
        Plot(
            signal_figure(maps.sel(signal=name)),
            f"Waterfall and order map of {name}.",
            f"Signal {name}, {unit}. Left: waterfall, one spectrum for each drum speed, slow at "
            "the bottom; dashed: orders 1 and 2. Right: order map; amplitude of each order over "
            f"the drum speed, in windows of {REVOLUTIONS} revolutions.",
        )
        for name in maps.signal.values.tolist()
    )
    largest = LabelledTable(
        "largest",
        largest_of_orders(maps),
        "Largest orders",
        "Largest amplitude of some orders; empty where the samples do not resolve the order.",
    )
    return Answer(
        f"Orders of {source}",
        summary(maps),
        None,
        (
            Part("Waterfall and order map", plots),
            Part("Largest orders", (largest, LabelledTable("orders", at_orders_shown(maps)))),
            health_part({source: findings}),
        ),
        (("File", source),),
        files={"orders.nc": netcdf_bytes(_without_quantities(maps[["amplitude"]]))},
    )


def _without_quantities(data: xr.Dataset) -> xr.Dataset:
    """Return a dataset whose attributes are numbers and texts, for a file."""
    plain = data.copy()
    for variable in plain.variables.values():
        variable.attrs.pop("quantity", None)
    return plain


def summary(maps: xr.Dataset) -> str:
    """Return one sentence about the largest component."""
    largest = maps.isel(maps.amplitude.argmax(...))
    count = maps.sizes["signal"]
    return (
        f"The largest component of {count} signal{'s' if count > 1 else ''} is "
        f"{order_text(largest.order.item())} of {largest.signal.item()}: "
        f"{text_of(largest.amplitude)} at {text_of(largest.speed)}."
    )


def order_text(order: float) -> str:
    """Return an order of a map in words: a whole one within the width of a line, 1/8."""
    whole = round(order)
    return f"order {whole}" if abs(order - whole) <= 1.0 / REVOLUTIONS else f"order {order:.2f}"


def signal_figure(maps: xr.Dataset) -> fig.Figure:
    """Return waterfall and order map of a signal; a record of a few seconds has no waterfall."""
    drawn = [_order_map(maps)]
    if maps.sizes["spectrum_time"]:
        drawn.insert(0, _waterfall(maps))
    return fig.Figure(panels=fig.in_grid(drawn, 2), height=350.0)


def _largest(values: FloatArray) -> float:
    """Return the largest finite value; 0 if there is none."""
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


def _order_map(maps: xr.Dataset) -> fig.Panel:
    """Return the amplitude of each order over the drum speed, at even speeds."""
    speed = np.abs(shown(maps.speed))
    at = np.argsort(speed, kind="stable")
    even = np.linspace(speed[at[0]], speed[at[-1]], min(len(speed), MAP_COLUMNS))
    nearest = at[np.clip(np.searchsorted(speed[at], even), 0, len(at) - 1)]
    values = shown(maps.amplitude)[nearest].T
    label = quantity_of(maps.amplitude).label
    scale = fig.Scale(low=0.0, high=_largest(values) or 1.0, shades="Blues", label=label)
    cells = fig.Cells(values, even, maps.order.values, scale=scale)
    return fig.Panel(
        name="orders",
        marks=(cells,),
        x=fig.Axis(label=SPEED.label, has_grid=False),
        y=fig.Axis(label=quantity_of(maps.order).label, has_grid=False),
    )


def _waterfall(maps: xr.Dataset) -> fig.Panel:
    """Return spectra above each other, at the height of their drum speed."""
    speed = np.abs(maps.spectrum_speed.values)
    top = 3.5 * max(float(speed.max()) / (2.0 * np.pi), 0.5)
    spectra = maps.spectrum.sel(frequency=slice(None, top)).values
    frequency = maps.frequency.sel(frequency=slice(None, top)).values
    levels = np.linspace(speed.min(), speed.max(), min(WATERFALL_LINES, len(speed)))
    rows = np.unique([int(np.argmin(np.abs(speed - level))) for level in levels])
    height = 5.0 * max(float(np.ptp(speed)), SPEED.unit.to_si(1.0)) / max(len(rows), 1)
    scale = height / max(_largest(spectra[rows]), 1e-300)
    marks: list[fig.Mark] = []
    for row in sorted(rows, key=lambda row: -speed[row]):
        level = SPEED.values(np.full(len(frequency), speed[row]))
        line = SPEED.values(speed[row] + scale * spectra[row])
        marks.append(fig.band(frequency, level, line, color="#ffffff", opacity=1.0))
        marks.append(fig.Line(frequency, line, color=fig.MARK, width=1.0))
    ends = np.array([speed.min(), speed.max()])
    marks += [
        fig.Line(
            order * ends / (2.0 * np.pi), SPEED.values(ends), color=fig.MEASURED, dash="dashed"
        )
        for order in (1.0, 2.0)
    ]
    x = fig.Axis(label=FREQUENCY.label, range=(0.0, top))
    y = fig.Axis(label=SPEED.label, has_grid=False)
    return fig.Panel(name="waterfall", marks=tuple(marks), x=x, y=y)
