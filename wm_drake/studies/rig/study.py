"""Errors that [A] prints of its bench tests."""

from collections.abc import Sequence

import pandas as pd

from wm_drake.parameters.components import COMPONENTS_FOLDER
from wm_drake.rigs import Bench, BushingBench, Harmonic

MM = 1e-3
WITHIN = "[A] calls all of them within 10 % of the largest force"
VERDICTS = {
    ("damper", ""): WITHIN,
    ("bushing", "radial"): f"{WITHIN}, 3 in its unit",
    ("bushing", "axial"): f"{WITHIN}, 3 in its unit",
    ("bushing", "rotational"): WITHIN,
    ("gasket", "radial"): f"{WITHIN}, 2 in its unit",
    ("gasket", "axial"): "[A] calls them above 10 % of the largest force, 0.8 in its unit",
}
"""What the text of [A] says of its errors, sections 3.1 to 3.3."""


def printed_table() -> pd.DataFrame:
    """Return [A] Tables 2, 4, 5, 7: component, axis, frequency_hz, amplitude_mm, rmse."""
    return pd.read_csv(COMPONENTS_FOLDER / "rmse_of_a.csv", comment="#", keep_default_na=False)


def printed_axis(bench: Bench) -> str:
    """Return the name that the tables of [A] have for the axis of a bench; "" for a damper.

    The axis of a bushing or gasket is y; x and z are radial.
    """
    if not isinstance(bench, BushingBench):
        return ""
    if bench.axis.startswith("about"):
        return "rotational"
    return "axial" if bench.axis == "y" else "radial"


def printed_errors(kind: str, bench: Bench, motions: Sequence[Harmonic]) -> list[float]:
    """Return the printed RMSE of each test, in the unit of [A], which is not printed.

    Args:
        kind: damper, bushing or gasket.
        motions: Motions of the test matrix of [A].
    """
    table = printed_table()
    rows = table[(table.component == kind) & (table.axis == printed_axis(bench))]
    rmse = rows.set_index(["frequency_hz", "amplitude_mm"])["rmse"]
    return [float(rmse[m.frequency, round(m.amplitude / MM, 6)]) for m in motions]


def printed_verdict(kind: str, bench: Bench) -> str:
    """Return what [A] says of the errors of a component, as a sentence."""
    return (
        "RMSE in [A]: of its own model against its tests, in a unit of force that is not printed. "
        f"{VERDICTS[kind, printed_axis(bench)]}."
    )
