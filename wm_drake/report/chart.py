"""Pictures of labelled data: what a table is for rows, a chart is for lines and points.

    panel(course, "time", ["amplitude"], by="sensor")

Words, units and scales come from the quantities of the variables, as in `LabelledTable`. Figures
with marks of their own are declared mark by mark (`report/figure.py`).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import xarray as xr

from wm_drake.report import figure as fig
from wm_drake.report.quantity import Quantity, quantity_of, shown

Drawn: TypeAlias = Mapping[str, Mapping[str, Any]] | Sequence[str]
"""Variables that are drawn, with the style of the marks of each."""

Key: TypeAlias = Callable[[xr.Dataset, str], str]
"""Function of a part of the data and of the name of a variable: its entry of the legend."""


def axis(what: Quantity | xr.DataArray, **more: Any) -> fig.Axis:
    """Return the axis of a quantity, or of a variable that carries one."""
    quantity = quantity_of(what) if isinstance(what, xr.DataArray) else what
    return fig.Axis(**{"label": quantity.label, **more})


def marks_of(
    data: xr.Dataset,
    over: str,
    drawn: Drawn,
    *,
    by: str = "",
    key: Key | None = None,
    **style: Any,
) -> tuple[fig.Mark, ...]:
    """Return a line or points for each variable, of each label.

    Args:
        over: Coordinate or variable along x.
        drawn: Variables. A style has the fields of `fig.Line`, or of `fig.Points` if its `kind`
            is that class.
        by: Dimension, or coordinate of the places, whose labels have marks of their own.
        key: Entry of the legend. Without one here or in a style it is the label, else the words of
            the variable if there are several.
        style: Style of all.
    """
    styles = drawn if isinstance(drawn, Mapping) else {name: {} for name in drawn}
    marks: list[fig.Mark] = []
    for number, part in enumerate(_parts(data, by)):
        for place, (name, of_variable) in enumerate(styles.items()):
            look: dict[str, Any] = {
                "color": fig.COLOURS[(number if by else place) % len(fig.COLOURS)]
            }
            entry = f"{by} {part[by].values.flat[0]}" if by else quantity_of(part[name]).words
            look["key"] = entry if by or len(styles) > 1 else ""
            look |= {**style, **of_variable, **({} if key is None else {"key": key(part, name)})}
            kind: Any = look.pop("kind", fig.Line)
            marks.append(kind(shown(part[over]), shown(part[name]), **look))
    return tuple(marks)


def _parts(data: xr.Dataset, by: str) -> Iterator[xr.Dataset]:
    """Yield the data with each label of a dimension or coordinate; all data without one."""
    if not by:
        yield data
    elif by in data.dims:
        yield from (data.isel({by: place}) for place in range(data.sizes[by]))
    else:
        (dim,), labels = data[by].dims, data[by].values
        yield from (data.isel({dim: labels == label}) for label in dict.fromkeys(labels.tolist()))


def panel(
    data: xr.Dataset,
    over: str,
    drawn: Drawn,
    *,
    x: Mapping[str, Any] | None = None,
    y: Mapping[str, Any] | None = None,
    **how: Any,
) -> fig.Panel:
    """Return variables of one unit over a coordinate, as of `marks_of`.

    The axes have the quantities of the coordinate and of the first variable.

    Args:
        x, y: Other fields of the axes.
        how: Arguments of `marks_of`.
    """
    return fig.Panel(
        marks=marks_of(data, over, drawn, **how),
        x=axis(data[over], **(x or {})),
        y=axis(data[next(iter(drawn))], **(y or {})),
    )


def between(below: Iterable[fig.Mark], panel: fig.Panel, *above: fig.Mark) -> fig.Panel:
    """Return a panel with more marks below and above its own."""
    return replace(panel, marks=(*below, *panel.marks, *above))
