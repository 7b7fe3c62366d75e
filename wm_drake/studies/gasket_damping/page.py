"""Show the gasket-damping study: fitted damping, envelopes, distances on the grids of [B]."""

from dataclasses import replace

import numpy as np
import xarray as xr
from scipy.interpolate import griddata

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity, quantity_of, shown, text_of
from wm_drake.simulation.displacements import envelopes, percent_difference
from wm_drake.simulation.runs import simulate
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.calibrate.fit_page import FitWords, compared, fit_answer
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.gasket_damping.study import (
    DAMPING,
    ENVELOPE,
    NOISE,
    UNKNOWNS,
    WINDOW,
    EnvelopeModel,
)

PERCENT = Quantity("", Share(), 1)

SHOWN_CELLS = 60
"""Number of columns and of rows of the coloured map of distances."""

METHOD = (
    "The residuals are differences of smooth envelopes (magnitude of the analytic signal) at all "
    f"sensors, every 5 ms from {WINDOW[0]:g} to {WINDOW[1]:g} s. Samples of one curve depend on "
    "each other, which widens the intervals. An error that all curves share, such as a wrong "
    "stiffness of a spring, is not in them."
)


def gasket_damping_answer(
    model: EnvelopeModel,
    fit: Fit,
    data: xr.Dataset,
    truth: FloatArray | None,
    grids: xr.Dataset | None,
) -> Answer:
    """Return the answer of the study.

    Args:
        fit, data: As of `calibrated` in `wm_drake.studies.calibrate.blocks`.
        truth: True damping of a virtual experiment; None for a measurement. [N s/m, N m s/rad]
        grids: As of `grid_of_paper`; None if its search was not made.
    """
    loads, parameters = list(model.measured), model.experiment.machine.parameters
    source = "measured records" if truth is None else "virtual experiment"
    about = f"{source}, load{'s' if len(loads) > 1 else ''} {' and '.join(loads)}"
    surface: tuple[Part, ...] = ()
    if grids is not None:
        table = LabelledTable("objective", grids)
        shown = surface_plot(grids, fit, truth), table
        surface = (Part("Distance over both dampings", shown, about_grids(grids)),)
    words = FitWords(
        title=f"Gasket damping of machine {parameters.name}",
        file="identified",
        data=f"the {about}",
        fitted="envelopes",
        source=f"fitted to envelopes of the {about}",
        method=METHOD,
        facts=(("Data", about),),
    )
    planted = None if truth is None else dict(zip(UNKNOWNS, truth.tolist(), strict=True))
    warned = () if truth is None else (about_virtual_experiment(truth),)
    parts = (
        compared(data, ENVELOPE, "envelopes", is_scattered=False),
        *surface,
        amplitudes_part(model, fit),
    )
    return fit_answer(model, fit, data, words, parts, planted, warned)


def amplitudes_part(model: EnvelopeModel, fit: Fit) -> Part:
    """Return the largest envelopes in the window: computed, measured and their difference."""
    machine, dims = model.experiment.machine, ("load", "sensor")
    ours, measured = (
        xr.concat(map(_largest, displacements), xr.Variable("load", list(model.measured)))
        for displacements in (
            [simulate(machine, case).displacement for case in model.cases_at(fit.values)],
            model.measured.values(),
        )
    )
    columns = {
        "computed": ENVELOPE.named("computed").variable(dims, ours.transpose(*dims)),
        "measured": ENVELOPE.named("measured").variable(dims, measured.transpose(*dims)),
        "difference": PERCENT.named("difference").variable(
            dims, 0.01 * percent_difference(ours, measured).transpose(*dims)
        ),
    }
    data = xr.Dataset(columns, {"load": ours["load"].values, "sensor": ours.sensor.values})
    title = "Amplitudes at the optimum"
    caption = "Amplitudes in the time window and their differences, [B] Eq. (1) and Table 2."
    return Part(title, (LabelledTable("amplitudes", data, title, caption),))


def about_grids(grids: xr.Dataset) -> str:
    """Return a sentence on what the grids of [B] found."""
    best = grids.isel(point=int(np.argmin(grids.objective.values)))
    text = damping_text(np.array([best[name].item() for name in UNKNOWNS]))
    return (
        f"The grid search of [B] found {text}, with a distance of {text_of(best.objective)}, "
        f"after {int(grids['round'].max())} rounds and {grids.sizes['point']} evaluations."
    )


def about_virtual_experiment(truth: np.ndarray) -> str:
    """Return the warning that nothing was measured."""
    return (
        "No measured records were given. The records on this page come from a virtual experiment: "
        f"the Drake engine ran the same machine with {damping_text(truth)}, and noise of "
        f"{ENVELOPE.text(NOISE)} was added to each sample. The experiment shows that the study "
        "finds known values. It gives no information about a real gasket."
    )


def damping_text(damping: np.ndarray) -> str:
    """Return C_L and C_T as text. [N s/m, N m s/rad]"""
    texts = (f"{n} = {DAMPING[n].text(v)}" for n, v in zip(UNKNOWNS, damping, strict=True))
    return " and ".join(texts)


def _largest(displacement: xr.DataArray) -> xr.DataArray:
    both = envelopes(xr.Dataset({"displacement": displacement})).sel(time=slice(*WINDOW))
    return np.maximum(abs(both.upper), abs(both.lower)).max("time")


def surface_plot(grids: xr.Dataset, fit: Fit, truth: np.ndarray | None) -> Plot:
    """Return the distance at the points of the grid search, with the path of the search.

    Args:
        grids: As of `grid_of_paper`.
        truth: Planted damping. [N s/m, N m s/rad]
    """
    finite = grids.isel(point=np.isfinite(grids.objective.values))
    points = np.column_stack([shown(finite[name]) for name in UNKNOWNS])
    values, distance = shown(finite.objective), quantity_of(grids.objective).label
    across, up = (
        np.linspace(*ends, SHOWN_CELLS) for ends in zip(points.min(0), points.max(0), strict=True)
    )
    cells = griddata(points, values, tuple(np.meshgrid(across, up)))
    scale = fig.Scale(low=values.min(), high=values.max(), shades="-Blues", label=distance)
    marks: list[fig.Mark] = [fig.Cells(cells, across, up, scale=scale, opacity=0.6)]
    rounds, path = finite["round"].values, []
    for index in np.unique(rounds):
        symbol, of_round = "x-thin" if index > 1 else "circle", points[rounds == index]
        opacity = min(1.0, 0.2 + 0.15 * float(index))
        marks.append(
            fig.Points(
                *of_round.T, symbol=symbol, is_open=True, color=fig.MARK, size=6.0, opacity=opacity
            )
        )
        path.append(points[np.argmin(np.where(rounds <= index, values, np.inf))])
    key = "path of the best point"
    marks.append(fig.Line(*np.transpose(path), color=fig.MEASURED, width=2.2, key=key))
    marks.append(fig.Points(*path[-1][:, None], color=fig.MEASURED, size=8.0, key=key))
    x, y = (DAMPING[name] for name in UNKNOWNS)
    marks += _fit_marks(fit, x, y)
    if truth is not None:
        planted = fig.Points(x.values(truth[:1]), y.values(truth[1:]), color=fig.OURS, size=18.0)
        marks.append(replace(planted, symbol="cross-thin", key="planted"))
    linear, torsional = fig.Axis(label=x.label), fig.Axis(label=y.label)
    colors = fig.Scale(low=points[:, 1].min(), high=points[:, 1].max(), label=y.label)
    over = fig.Points(points[:, 0], values, values=points[:, 1], scale=colors)
    panels = (
        fig.Panel(name="path", marks=tuple(marks), x=linear, y=torsional),
        fig.Panel(name="distance", marks=(over,), x=linear, y=fig.Axis(label=distance)),
    )
    return Plot(
        fig.Figure(panels=fig.in_grid(panels, 2), height=380.0),
        "Grid points with the path of the search, and the surface of the objective function.",
        "Distance: sum over the loads of the 2-norm of the differences of the upper and lower "
        "envelopes, [B] Eq. (2), (3). Left: distance over both dampings, points of the grid "
        "search, darker in each later round, and the path of the best point from the first grid "
        "on. With --mesh the grid moves to its best point, and is halved when it has no better "
        "point than its centre; with --paper-mesh it is halved in each round, as in [B]. "
        "Right: distance at these points over the linear damping; colours: torsional "
        "damping ([B] Fig. 7).",
    )


def _fit_marks(fit: Fit, x: Quantity, y: Quantity) -> list[fig.Mark]:
    """Return the fitted point with its intervals."""
    key, (a, b) = "fit, 95 % intervals", fit.estimates
    at = (x.values([a.value]), y.values([b.value]))
    marks: list[fig.Mark] = [fig.Points(*at, symbol="square", color=fig.MARK, size=6.0, key=key)]
    if np.isfinite([a.lower, b.lower]).all():
        low = (x.values([a.lower, a.value]), y.values([b.value, b.lower]))
        high = (x.values([a.upper, a.value]), y.values([b.value, b.upper]))
        marks.append(fig.segments(low, high, color=fig.MARK, key=key))
    return marks
