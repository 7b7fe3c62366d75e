"""Section of a spin-cycle page about the loads of the feet of the cabinet."""

import numpy as np
import pandas as pd

from wm_drake.report.table import Column, Table, table_of
from wm_drake.simulation.feet import MARGINS
from wm_drake.studies.spin_cycle.study import SpinCycleResult

COLUMNS = dict(
    zip(
        MARGINS,
        ("smallest_normal_force_N", "slide_margin_N", "turn_margin_Nm", "tilt_margin_Nm"),
        strict=True,
    )
)
"""Columns of `feet_frame` by measure."""

SHOWN = {
    "case": Column("case"),
    "smallest_normal_force_N": Column("smallest load of a foot", "N", 1),
    "slide_margin_N": Column("margin of sliding", "N", 1),
    "turn_margin_Nm": Column("margin of turning", "N\u00a0m", 1),
    "tilt_margin_Nm": Column("margin of tilting", "N\u00a0m", 1),
    "where": Column("turning smallest in"),
}
"""Columns on the page."""


def feet_frame(result: SpinCycleResult) -> pd.DataFrame:
    """Return a row for each case and region, and one for the whole run: loads and margins.

    Args:
        result: Result of a machine with a cabinet.
    """
    rows = []
    for case in result.cases:
        forces = result.forces.sel(case=case.name)
        parts = {"run": {column: float(forces[name]) for name, column in COLUMNS.items()}}
        for region in map(str, forces.region.values):
            parts[region] = {
                column: float(forces[f"region_{name}"].sel(region=region))
                for name, column in COLUMNS.items()
            }
        rows += [{"case": case.name, "part": part, **values} for part, values in parts.items()]
    return pd.DataFrame(rows)


def floor_table(result: SpinCycleResult) -> Table | None:
    """Return the smallest loads and margins of each case; None without a cabinet."""
    if "turn_margin" not in result.forces:
        return None
    frame = feet_frame(result)
    regions = frame[frame["part"] != "run"].dropna(subset="turn_margin_Nm")
    lowest = regions.loc[regions.groupby("case")["turn_margin_Nm"].idxmin()].set_index("case")
    whole = frame[frame["part"] == "run"].drop(columns="part")
    whole = whole.assign(where=whole["case"].map(lowest["part"]))
    kinds = ["alarm" if low <= 0.0 else "" for low in whole[list(COLUMNS.values())].min(axis=1)]
    which, below = "which the model keeps in its place", "Below 0 the cabinet would slide, turn"
    if result.parameters.cabinet_moves:
        which, below = "which moves on them", "At 0 the cabinet slides or turns, or is about to"
    caption = (
        f"Feet of the rigid cabinet, {which}: smallest normal load of any foot; horizontal force "
        "that friction can still take; vertical moment that friction can still take beside it, "
        "and the region where this is smallest; moment that still keeps the cabinet down. "
        f"{below} or tip. feet.csv has each region."
    )
    return table_of(whole, caption, SHOWN, kinds)


def floor_warnings(result: SpinCycleResult) -> list[str]:
    """Return a warning that names the cases in which the cabinet would slide, turn or tip."""
    if "turn_margin" not in result.forces:
        return []
    margins = np.min([result.forces[name].values for name in MARGINS[1:]], axis=0)
    moving = [
        case.name
        for case, margin, diverged in zip(result.cases, margins, result.diverged, strict=True)
        if margin <= 0.0 and not diverged
    ]
    if not moving:
        return []
    if result.parameters.cabinet_moves:
        return [f"The cabinet slides, turns or lifts a side in case {', '.join(moving)}."]
    return [
        f"The cabinet would slide, turn or tip over in case {', '.join(moving)}. The model keeps "
        "it in its place."
    ]
