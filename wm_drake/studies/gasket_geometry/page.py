"""Show the study of drawings of a gasket: surfaces, what each factor does, the best drawing."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.parameters.files import yaml_text
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.units import Unit
from wm_drake.report.chart import between, panel
from wm_drake.report.figure import MEASURED, OURS, Axis, Figure, Line, Panel, Points, in_grid
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import shown, text_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.gasket_geometry.drawings import DrawingFactor
from wm_drake.studies.gasket_geometry.study import GAP, RESPONSES

METHOD = (
    "The drawings are a Latin hypercube of the factors. Finite elements give the curves of each, "
    "and the machine runs all loads with each gasket. The responses are fitted with polynomials of "
    "degree two (degree one if there are few drawings). The error is that on fresh drawings, by "
    "the range of the response in the design. The drawing with the largest gap on the surface, "
    "within the limits, is computed and run too; the best drawing is that with the largest gap of "
    "all that were run and keep the limits. "
    "Folds that touch hold each other off, unless the drawing has contact: false."
)


def geometry_answer(
    factors: Sequence[DrawingFactor],
    data: Mapping[str, xr.Dataset],
    best: GasketDrawing,
    name: str,
    loads: Sequence[str],
) -> Answer:
    """Return the answer of the study.

    Args:
        data: `drawings`, `surfaces` and `conditions`, as of `drawings_data`, `surfaces_data` and
            `conditions_data` in `wm_drake.studies.gasket_geometry.study`.
        best: Best drawing that was run.
        name: Name or file of the drawing.
        loads: Names of the loads.
    """
    drawings, surfaces, conditions = (data[n] for n in ("drawings", "surfaces", "conditions"))
    counts = drawings.kind.values.tolist()
    too_large = "no drawing that was run keeps all limits; the best one exceeds them the least"
    return Answer(
        f"Drawings of gasket {name}",
        summary(factors, drawings, surfaces, conditions),
        None,
        (
            Part("Gap over each factor", (_over_factors(factors, drawings, surfaces),)),
            Part(
                "Surface and runs",
                (
                    _agreement(drawings),
                    LabelledTable("drawings", drawings.drop_dims("factor")),
                    LabelledTable("conditions", conditions),
                ),
            ),
            Part("What each factor does", _factor_tables(name, surfaces)),
            Part("Files", links=(("best.yaml", "the best drawing"),)),
        ),
        (
            ("Drawing", name),
            ("Drawings", f"{counts.count('design')} of the design, {counts.count('fresh')} fresh"),
            ("Loads", ", ".join(loads)),
            ("Limits", _limits_text(conditions)),
        ),
        METHOD,
        {"best.yaml": yaml_text(drawing_tree(best))},
        () if conditions.keeps_limits else (too_large,),
    )


def _factor_tables(name: str, surfaces: xr.Dataset) -> tuple[LabelledTable, LabelledTable]:
    """Return the part of each factor in the variance of the responses, and what it changes."""
    words = {name: quantity.words for name, quantity in RESPONSES.items()}
    shares = LabelledTable(
        "contributions",
        surfaces[["share", "error_on_fresh"]],
        f"Gasket {name}: part of each factor",
        "Part of each factor in the variance of a response over the ranges. The response is the "
        "worst of all loads.",
        across="source",
        words=words,
        is_in_terminal=True,
    )
    changes = LabelledTable(
        "changes",
        surfaces[[*RESPONSES]],
        f"Gasket {name}: change over each factor",
        "Mean of each response over the ranges, and its change from the low to the high end of a "
        "factor, with the others in the middle.",
        is_in_terminal=True,
    )
    return shares, changes


def drawing_tree(drawing: GasketDrawing) -> dict[str, Any]:
    """Return a drawing as the tree of its file."""
    length = Unit("m", "mm")
    points = [
        {
            name: length.text(round(getattr(point, name), 6))
            for name in ("radius", "y", "thickness", "fillet")
        }
        for point in drawing.meridian
    ]
    rubber: dict[str, Any] = {"shore_a": drawing.rubber.shore_a}
    if drawing.rubber.prony is None:
        rubber["loss_factor"] = drawing.rubber.loss_factor
    else:
        times = ", ".join(map(repr, drawing.rubber.prony.time))
        rubber["prony"] = {"time": f"({times}) s", "share": list(drawing.rubber.prony.share)}
    if drawing.rubber.bulk_modulus is not None:
        rubber["bulk_modulus"] = Unit("Pa", "MPa").text(drawing.rubber.bulk_modulus)
    tree = {"about": drawing.about, "meridian": points, "rubber": rubber}
    return tree if drawing.contact else tree | {"contact": False}


def summary(
    factors: Sequence[DrawingFactor],
    drawings: xr.Dataset,
    surfaces: xr.Dataset,
    conditions: xr.Dataset,
) -> str:
    """Return the result in a few sentences."""
    best, proposed = drawings.isel(drawing=int(conditions.best)), drawings.isel(drawing=-1)
    values = ", ".join(f"{f.quantity.words} {text_of(best[f.name])}" for f in factors)
    middle = surfaces.section.isel(factor=0).sel(level=0.0)
    return (
        f"Best drawing that was run: {values}. Its smallest gap is {text_of(best[GAP])}. Limits: "
        f"{_limits_text(conditions)}. In the middle of the ranges the surface has "
        f"{text_of(middle)}. The drawing with the largest gap on the surface, "
        f"{text_of(proposed[f'{GAP}_on_surface'])}, has {text_of(proposed[GAP])} when it is run. "
        "Error of the surface of the gap on fresh drawings: "
        f"{text_of(surfaces.error_on_fresh.sel(response=GAP))} of the range."
    )


def _limits_text(conditions: xr.Dataset) -> str:
    limited = [name for name in RESPONSES if name in conditions]
    return "; ".join(f"{RESPONSES[n].words} up to {text_of(conditions[n])}" for n in limited) or (
        "none"
    )


def _over_factors(
    factors: Sequence[DrawingFactor], drawings: xr.Dataset, surfaces: xr.Dataset
) -> Plot:
    panels = []
    for factor in factors:
        x = factor.quantity.values(factor.value(surfaces["level"].values))
        surface = shown(surfaces.section.sel(factor=factor.name))
        line = Line(x, surface, key="surface, others in the middle")
        style = {"kind": Points, "color": MEASURED, "size": 5.0, "key": "drawings"}
        panels.append(between([line], panel(drawings, factor.name, {GAP: style})))
    return Plot(
        Figure(panels=in_grid(panels, 2, share="y"), height=220.0),
        "Four panels: the smallest gap over each factor.",
        "Smallest gap of all loads over each factor.",
    )


def _agreement(drawings: xr.Dataset) -> Plot:
    panels = []
    design, fresh = (drawings.kind.values == kind for kind in ("design", "fresh"))
    for name, quantity in RESPONSES.items():
        computed, surface = shown(drawings[name]), shown(drawings[f"{name}_on_surface"])
        ends = np.array([computed.min(), computed.max()])
        marks = (
            Line(ends, ends, color=MEASURED, width=1.0),
            Points(computed[design], surface[design], color=OURS, size=5.0, key="design"),
            Points(computed[fresh], surface[fresh], color=MEASURED, symbol="square", key="fresh"),
        )
        x, y = Axis(label="computed"), Axis(label="surface")
        panels.append(Panel(title=quantity.label, marks=marks, x=x, y=y))
    return Plot(
        Figure(panels=in_grid(panels, 3), height=200.0),
        "Response of the surface over the computed one, for each response.",
        "Surface over computed response; squares: drawings that the fit does not know.",
    )
