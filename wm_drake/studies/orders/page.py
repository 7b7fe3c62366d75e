"""Page of the orders of a record: waterfall and order map of each signal."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import RPM_PER_RAD_S, number, plain
from wm_drake.report.page import Section, SectionedPage, picture
from wm_drake.report.table import Column, Group, Row, Table
from wm_drake.simulation.netcdf import netcdf_bytes
from wm_drake.simulation.orders import REVOLUTIONS
from wm_drake.simulation.records import versions
from wm_drake.studies.orders.study import Orders
from wm_drake.studies.study import Facts, Result

WATERFALL_LINES = 40
"""Largest number of spectra of a waterfall."""


MAP_COLUMNS = 400
"""Largest number of columns of an order map."""


@dataclass(frozen=True)
class OrdersResult(Result):
    """Maps of the signals of a file, as they are shown."""

    orders: Orders

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return amplitudes of some orders over time."""
        columns: dict[str, FloatArray] = {
            "time_s": self.orders.orders.time.values,
            "speed_rpm": RPM_PER_RAD_S * self.orders.orders.speed.values,
        }
        for order in self.orders.shown_orders():
            values = self.orders.at_order(order)
            for index, name in enumerate(self.orders.signals.names):
                columns[f"order {order:g} {name}, {self.orders.signals.unit}"] = values[:, index]
        return {"orders": pd.DataFrame(columns)}

    def write(self, folder: Path) -> None:
        """Write the table, and the whole map as netCDF."""
        super().write(folder)
        maps = self.orders.orders.assign_coords(signal=self.orders.signals.names)
        maps.name, maps.attrs["units"] = "amplitude", self.orders.signals.unit
        (folder / "orders.nc").write_bytes(netcdf_bytes(maps.to_dataset()))

    def as_json(self) -> dict[str, Any]:
        """Return the table by columns."""
        columns = self.tables()["orders"].to_dict("list")
        signals = self.orders.signals
        about = {"file": signals.source, "unit": signals.unit, "signals": signals.names}
        return about | {"orders": plain(columns)}

    def terminal(self) -> list[str]:
        """Return a sentence about the largest component."""
        return [summary(self.orders)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        return orders_page(self.orders, facts)


def orders_page(result: Orders, facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    signals = result.signals
    pictures = tuple(
        picture(
            signal_figure(result, index),
            f"Waterfall and order map of {name}.",
            f"Signal {name}, {signals.unit}. Left: waterfall, one spectrum for each drum speed, "
            "slow at the bottom; dashed: orders 1 and 2. Right: order map; amplitude of each order "
            f"over the drum speed, in windows of {REVOLUTIONS} revolutions.",
        )
        for index, name in enumerate(signals.names)
    )
    software = ", ".join(f"{name} {text}" for name, text in versions().items())
    return SectionedPage(
        f"Orders of {signals.source}",
        summary(result),
        [
            Section("maps", "Waterfall and order map", pictures),
            Section("orders", "Largest orders", tables=(_table(result),)),
        ],
        [("File", signals.source), ("Software", software), *facts.rows()],
        warnings=facts.warnings,
    ).html()


def summary(result: Orders) -> str:
    """Return one sentence about the largest component."""
    values = result.orders.values
    time, order, signal = np.unravel_index(int(np.nanargmax(values)), values.shape)
    rpm = RPM_PER_RAD_S * float(result.orders.speed.values[time])
    count = len(result.signals.names)
    return (
        f"The largest component of {count} signal{'s' if count > 1 else ''} is "
        f"{order_text(float(result.orders.order.values[order]))} of "
        f"{result.signals.names[signal]}: "
        f"{number(float(values[time, order, signal]), 2)} {result.signals.unit} at "
        f"{number(rpm, 0)} rpm."
    )


def order_text(order: float) -> str:
    """Return an order of a map in words: a whole one within the width of a line, 1/8."""
    whole = round(order)
    return f"order {whole}" if abs(order - whole) <= 1.0 / REVOLUTIONS else f"order {order:.2f}"


def _table(result: Orders) -> Table:
    groups, speed = [], RPM_PER_RAD_S * result.orders.speed.values
    for order in result.shown_orders():
        values = result.at_order(order)
        resolved = np.isfinite(values).any(axis=0)
        filled = np.where(np.isfinite(values), values, -1.0)
        largest = np.where(resolved, filled.max(axis=0), np.nan)
        rpm = np.where(resolved, speed[filled.argmax(axis=0)], np.nan)
        at = (number(float(one), 0) for one in rpm)
        rows = (Row(("largest", *largest)), Row(("at, rpm", *at)))
        groups.append(Group(f"order {order:g}", rows))
    signals = result.signals
    columns = (Column(name, signals.unit, 2) for name in signals.names)
    caption = "Largest amplitude of some orders; empty where the samples do not resolve the order."
    return Table(caption, ("order", "", *columns), tuple(groups), text_columns=2)


def signal_figure(result: Orders, index: int) -> fig.Figure:
    """Return waterfall and order map of a signal; a record of a few seconds has no waterfall."""
    drawn = [_order_map(result, index)]
    if result.frequencies.sizes["time"]:
        drawn.insert(0, _waterfall(result, index))
    return fig.Figure(panels=fig.in_grid(drawn, 2), height=350.0)


def _largest(values: FloatArray) -> float:
    """Return the largest finite value; 0 if there is none."""
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


def _order_map(result: Orders, index: int) -> fig.Panel:
    """Return the amplitude of each order over the drum speed, at even speeds."""
    rpm = RPM_PER_RAD_S * np.abs(result.orders.speed.values)
    at = np.argsort(rpm, kind="stable")
    even = np.linspace(rpm[at[0]], rpm[at[-1]], min(len(rpm), MAP_COLUMNS))
    nearest = at[np.clip(np.searchsorted(rpm[at], even), 0, len(at) - 1)]
    values = result.orders.values[nearest, :, index].T
    scale = fig.Scale(low=0.0, high=_largest(values) or 1.0, shades="Blues")
    scale = replace(scale, label=f"amplitude, {result.signals.unit}")
    cells = fig.Cells(values, even, result.orders.order.values, scale=scale)
    return fig.Panel(
        name="orders",
        marks=(cells,),
        x=fig.Axis(label="drum speed, rpm", has_grid=False),
        y=fig.Axis(label="order", has_grid=False),
    )


def _waterfall(result: Orders, index: int) -> fig.Panel:
    """Return spectra above each other, at the height of their drum speed."""
    signals = result.signals
    speed = np.gradient(signals.angle, signals.time)
    maps = result.frequencies
    rpm = RPM_PER_RAD_S * np.abs(np.interp(maps.time.values, signals.time, speed))
    top = 3.5 * max(float(rpm.max()) / 60.0, 0.5)
    shown = maps.frequency.values <= top
    frequency = maps.frequency.values[shown]
    values = maps.values[:, shown, index]
    levels = np.linspace(rpm.min(), rpm.max(), min(WATERFALL_LINES, len(rpm)))
    rows = np.unique([int(np.argmin(np.abs(rpm - level))) for level in levels])
    height = 5.0 * max(float(np.ptp(rpm)), 1.0) / max(len(rows), 1)
    scale = height / max(_largest(values[rows]), 1e-300)
    marks: list[fig.Mark] = []
    for row in sorted(rows, key=lambda row: -rpm[row]):
        line, level = rpm[row] + scale * values[row], np.full(len(frequency), rpm[row])
        marks.append(fig.band(frequency, level, line, color="#ffffff", opacity=1.0))
        marks.append(fig.Line(frequency, line, color=fig.MARK, width=1.0))
    ends = np.array([rpm.min(), rpm.max()])
    marks += [
        fig.Line(k * ends / 60.0, ends, color=fig.MEASURED, dash="dashed") for k in (1.0, 2.0)
    ]
    x = fig.Axis(label="frequency, Hz", range=(0.0, top))
    y = fig.Axis(label="drum speed, rpm", has_grid=False)
    return fig.Panel(name="waterfall", marks=tuple(marks), x=x, y=y)
