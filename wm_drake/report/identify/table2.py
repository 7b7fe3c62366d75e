"""Report page of [C] Table 2: fits of the Coulomb model to each test beside the printed ones."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wm_drake.report.figures import WIDTH
from wm_drake.report.formatting import number
from wm_drake.report.identify.figures import LAW_COLOURS
from wm_drake.report.page import picture, render
from wm_drake.report.rig.figures import style_panel
from wm_drake.report.tables import Group, Row, Table
from wm_drake.studies.identification.drift import FrequencyTrend

HEADER = (
    "test",
    "k1 printed, N/mm",
    "k1 fitted",
    "ratio",
    "c1 printed, N s/mm",
    "c1 fitted",
    "ratio",
    "RMSE / peak",
)


def table2_report(
    fits: pd.DataFrame,
    trend: FrequencyTrend,
    source: str,
    command: str = "",
) -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        fits: From `coulomb_fits`.
        trend: From `frequency_trend`, at 1 mm.
        source: What was fitted, in words.
        command: Command line, shown on the page.
    """
    return render(
        "identify/table2.html",
        title="Coulomb model fitted to each test ([C] Table 2)",
        about=source,
        warnings=[],
        summary=" ".join(sentences(fits, trend)),
        fits=_fits(fits),
        pictures=[
            picture(
                drift_figure(fits),
                "Fitted and printed k1 and c1 over frequency, one line per amplitude.",
                "k1 and c1 of the Coulomb model over frequency: fitted (lines) and printed in [C] "
                "Table 2 (crosses).",
            )
        ],
        trends=_trends(trend),
        facts=[("Command", command)],
    )


def sentences(fits: pd.DataFrame, trend: FrequencyTrend) -> list[str]:
    """Return what the fits and the trends say, in words."""
    found = []
    known = fits.dropna(subset=["k1", "c1"])
    if len(known):
        ratios = {
            name: float(np.exp(np.mean(np.log(known[f"{name} ratio"].clip(lower=1e-6)))))
            for name in ("k1", "c1")
        }
        found.append(
            f"Over {len(known)} printed tests the fitted k1 is {ratios['k1']:.3g} times and c1 "
            f"{ratios['c1']:.3g} times the printed one (geometric mean)."
        )
    rise, free = (peaks[-1] / peaks[0] - 1.0 for peaks in (trend.printed, trend.without_dashpots))
    low, high = (f"{f:g} Hz" for f in (trend.frequencies[0], trend.frequencies[-1]))
    found.append(
        "[C] section 4.1 says that the friction force falls with frequency. With its printed "
        f"numbers the peak force grows by {100 * rise:.2g} % from {low} to {high} at 1 mm, because "
        f"c1 and c2 do; without them it changes by {100 * free:.1g} %, because the MSTV friction "
        "depends on a quotient of velocities only. Even a level peak needs a friction that falls "
        f"with velocity: f_max from {trend.friction[0]:.3g} N at {low} to "
        f"{trend.friction[-1]:.3g} N at {high}."
    )
    return found


def fit_cells(fits: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return the cells of each test as text, under `HEADER`."""
    return [
        (
            f"{row['frequency_hz']:.3g} Hz, {row['amplitude_mm']:.3g} mm",
            number(row["k1"], 1),
            number(row["k1 fitted"], 1),
            number(row["k1 ratio"], 2),
            number(row["c1"], 2),
            number(row["c1 fitted"], 2),
            number(row["c1 ratio"], 2),
            number(row["RMSE/peak"], 3),
        )
        for row in fits.to_dict("records")
    ]


def _fits(fits: pd.DataFrame) -> Table:
    caption = (
        "Each test fitted alone, within the bounds of [C] section 3.3: k1 from 50 to 300 N/mm, c1 "
        "from 0 to 10 N s/mm."
    )
    return Table(
        caption, HEADER, tuple(Group(cells[0], (Row(cells[1:]),)) for cells in fit_cells(fits))
    )


def _trends(trend: FrequencyTrend) -> Table:
    rows = {
        "peak force, printed numbers": trend.printed,
        "peak force, c1 and c2 nearly zero": trend.without_dashpots,
        "f_max for the peak of the first": trend.friction,
    }
    heads = ("loops of 1 mm, N", *(f"{f:g} Hz" for f in trend.frequencies))
    groups = tuple(
        Group(name, (Row(tuple(number(value, 1) for value in values)),))
        for name, values in rows.items()
    )
    return Table("Peak force of the MSTV damper over frequency.", heads, groups)


def drift_figure(fits: pd.DataFrame) -> Figure:
    """Draw fitted and printed k1 and c1 over frequency."""
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    rounded = fits.assign(amplitude_mm=fits.amplitude_mm.round(3))
    for axes, name, unit in zip(
        figure.subplots(1, 2), ("k1", "c1"), ("N/mm", "N s/mm"), strict=True
    ):
        for k, (amplitude, rows) in enumerate(rounded.groupby("amplitude_mm")):
            colour = LAW_COLOURS[k % len(LAW_COLOURS)]
            ordered = rows.sort_values("frequency_hz")
            axes.plot(
                ordered.frequency_hz,
                ordered[f"{name} fitted"],
                "o-",
                color=colour,
                markersize=3.5,
                linewidth=1.4,
                label=f"{amplitude:g} mm",
            )
            axes.plot(ordered.frequency_hz, ordered[name], "x", color=colour, markersize=7)
        axes.set_xlabel("frequency, Hz", fontsize=9.5)
        axes.set_ylabel(f"{name}, {unit}", fontsize=9.5)
        style_panel(axes)
    axes.legend(frameon=False, fontsize=9, title="amplitude", title_fontsize=9)
    return figure
