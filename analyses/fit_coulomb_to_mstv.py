"""Do Coulomb fits to loops of the MSTV model drift as in [C] Table 2, and for which f_max?

[C] fits k1 and c1 of the Coulomb model to each test (genetic algorithm, bounds 50-300 N/mm and 0-10
N s/mm) and prints how they drift with frequency and amplitude. Its MSTV model needs no drift: it
has k1 = 176 N/mm, c1 = 0.09 N s/mm, c2 = 0.4 N s/mm, and an f_max that is not printed. If the MSTV
model is right, Coulomb fits to its loops drift in the same way. This drift is the only printed
result that depends on f_max. Assumptions: both models have the same f_max and the same c2 ([C] Eq.
(3) holds for all laws). The script prints the agreement for each f_max, and the fits beside the
printed values for the f_max with the best agreement. It takes about two minutes.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from wm_drake.parameters import MeasuredLoop, load_component
from wm_drake.parameters.components import COMPONENTS_FOLDER
from wm_drake.rigs import Harmonic, damper_bench, force_loops
from wm_drake.rigs.measured import measured_motion
from wm_drake.studies.fitting import least_squares
from wm_drake.studies.identification import damper_model, fit_problem

F_MAX = (20.0, 30.0, 35.0, 40.0, 45.0, 50.0, 60.0, 80.0, 120.0)  # N
BOUNDS = {
    "sponge_stiffness": (50e3, 300e3),
    "sponge_damping": (0.0, 10e3),
}  # N/m, N s/m: [C] section 3.3
MM = 1e-3


def coulomb_fits(table: pd.DataFrame, f_max: float) -> pd.DataFrame:
    """Return the table with the fitted k1 and c1 of the Coulomb model at each of its points.

    Units are N/mm and N s/mm. A last column holds the RMSE of the fit, relative to the peak force.
    """
    mstv = load_component("mstv_damper").parameters.model_copy(update={"friction_force": f_max})
    motions = [Harmonic(row.frequency_hz, row.amplitude_mm * MM) for row in table.itertuples()]
    known = {
        "friction_force": f_max,
        "transition_velocity": 0.0,
        "slider_damping": mstv.slider_damping,
    }
    rows = []
    for loop in force_loops(damper_bench(mstv), motions):
        measured = measured_motion(
            MeasuredLoop("mstv", "mstv", loop.time, loop.displacement, loop.force, False)
        )
        model = damper_model("stv_sponge", [measured], BOUNDS, known)
        fit = least_squares(fit_problem(model, [measured]), starts=3, screened=16)
        k1, c1 = (fit[name].value * MM for name in ("sponge_stiffness", "sponge_damping"))
        rows.append({"k1 fitted": k1, "c1 fitted": c1, "RMSE/peak": fit.tests[0].normalised})
    return pd.concat([table.reset_index(drop=True), pd.DataFrame(rows)], axis=1)


def agreement(found: pd.DataFrame) -> dict[str, float]:
    """Return measures of the agreement with the printed table.

    These are the rank correlations, the root mean square of ln(fitted / printed), and the
    percentage of steps in frequency or amplitude over which c1 falls.
    """
    c1 = found.pivot_table(
        index="frequency_hz", columns="amplitude_mm", values="c1 fitted"
    ).to_numpy()
    falls = np.concatenate([np.diff(c1, axis=0).ravel(), np.diff(c1, axis=1).ravel()]) <= 1e-3
    ratio = {
        name: np.log(found[f"{name} fitted"].clip(lower=1e-3) / found[name])
        for name in ("k1", "c1")
    }
    return {
        "rank correlation c1": float(spearmanr(found["c1"], found["c1 fitted"])[0]),
        "rank correlation k1": float(spearmanr(found["k1"], found["k1 fitted"])[0]),
        "log error c1": float(np.sqrt(np.mean(ratio["c1"] ** 2))),
        "log error k1": float(np.sqrt(np.mean(ratio["k1"] ** 2))),
        "c1 falls, %": 100.0 * float(np.mean(falls)),
    }


def main() -> None:
    """Print the agreement for each f_max, and the fits for the f_max that agrees best."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="use only four corners of the table and two values of f_max",
    )
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    table = pd.read_csv(COMPONENTS_FOLDER / "mstv_table2_coulomb.csv", comment="#")
    candidates = F_MAX
    if arguments.quick:
        table = table[table.frequency_hz.isin([1.0, 10.0]) & table.amplitude_mm.isin([0.3, 1.0])]
        candidates = (40.0, 80.0)
    found = {f_max: coulomb_fits(table, f_max) for f_max in candidates}
    scores = pd.DataFrame({f"{f_max:g} N": agreement(fits) for f_max, fits in found.items()}).T
    best = candidates[int(np.argmax(scores["rank correlation c1"]))]
    shown = found[best].assign(
        k1_ratio=lambda t: t["k1 fitted"] / t["k1"], c1_ratio=lambda t: t["c1 fitted"] / t["c1"]
    )
    text = [
        "agreement of Coulomb fits to MSTV loops with [C] Table 2, by f_max",
        scores.round(3).to_string(),
        f"The drift of c1 agrees best for f_max = {best:g} N. Its fits beside the printed values "
        "(k1 in N/mm, c1 in N s/mm):",
        shown.round(3).to_string(index=False),
    ]
    print("\n".join(text))
    if arguments.out:
        arguments.out.write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
