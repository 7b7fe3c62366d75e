"""Rows of the validation page: published number, ours, and a verdict with its reason."""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import PublishedResults
from wm_drake.parameters.published import CONSTANT
from wm_drake.report.quantity import quantity_of, shown
from wm_drake.studies.gasket.screening import at, labels_of
from wm_drake.studies.spin.comparison import LARGE_STEADY, STEADY
from wm_drake.studies.spin.data import amplitudes_of
from wm_drake.studies.spin.study import SpinRuns

FITTED, PREDICTED = "fitted", "predicted"
"""Whether a published number was a target of the calibration."""

MET, MISSED, OPEN = "met", "missed", "not comparable"

AMPLITUDE_LIMIT = 20.0
"""Largest difference of an amplitude that counts as met. [%] It is the limit of the calibration."""

SMALL_EFFECT = 10.0
"""Effect of the gasket that counts as none: its sign need not agree. [%]"""

SMALL_STEADY = 10.0
"""Largest difference of steady amplitudes for which the gasket is said to matter little. [%]

[B] section 2.2 says it is negligible, without a number; the limit is an assumption.
"""

MEAN_LIMIT = 30.0
"""Largest difference of a grand mean that counts as met. [%]"""

STIFFNESS_LIMIT = 20.0
"""Largest difference of a fitted k1 of [C] that counts as met. [%]"""

DAMPING_FACTOR = 2.0
"""Largest ratio of a fitted c1 of [C] that counts as met; c1 spans a factor of 30 there."""

HELD_OUT_GOALS = {
    ("amplitudes", "mean"): 12.0,
    ("amplitudes", "covered"): 90.0,
    ("contributions", "mean"): 12.0,
}
"""Goals for held-out tables of [B]: mean difference, and part of the values covered. [%; points]"""

LEADERS_MISSED = 1
"""Goal: number of leading factors of a held-out load that may differ."""

REDUCED = 0.5
"""Ratio below which a vibration is called significantly reduced; an assumption."""


@dataclass(frozen=True)
class Row:
    """One published result beside ours.

    Attributes:
        section: Heading of the table to which the row belongs.
        quantity: What is compared.
        kind: `FITTED` or `PREDICTED`.
        published, ours, difference: Numbers as text, with units.
        verdict: `MET`, `MISSED` or `OPEN`.
        reason: Why the verdict is so.
    """

    section: str
    quantity: str
    kind: str
    published: str
    ours: str
    difference: str
    verdict: str
    reason: str


@dataclass(frozen=True)
class Pair:
    """A published number beside ours.

    Attributes:
        published, ours: The numbers.
        limit: Largest difference that counts as met. [%]
    """

    published: float
    ours: float
    unit: str
    limit: float

    @property
    def difference(self) -> float:
        """Difference from the published number; NaN if the run diverged. [%]"""
        return 100.0 * (self.ours - self.published) / self.published

    @property
    def is_met(self) -> bool:
        """Whether the difference is within its limit; a run that diverged is not."""
        return abs(self.difference) <= self.limit

    def row(self, section: str, what: str, kind: str, more: str = "") -> Row:
        """Return the row of the pair.

        Args:
            section, what, kind: As in `Row`.
            more: Text behind the reason.
        """
        reason = f"{'within' if self.is_met else 'above'} {self.limit:g} %"
        if not math.isfinite(self.difference):
            reason = "the run diverged"
        return Row(
            section,
            what,
            kind,
            f"{self.published:g} {self.unit}",
            f"{self.ours:.3g} {self.unit}",
            f"{_signed(self.difference)} %",
            _verdict(self.is_met),
            reason + more,
        )


def _verdict(is_met: bool) -> str:
    return MET if is_met else MISSED


def amplitude_table(runs: SpinRuns) -> pd.DataFrame:
    """Return measured and computed amplitudes: load, gasket, source, a column per sensor. [mm]"""
    data = amplitudes_of(runs)
    labels = {name: data[name].values for name in ("load", "gasket", "source")}
    sensors = data.sensor.values.tolist()
    return pd.DataFrame({**labels, **dict(zip(sensors, shown(data.amplitude).T, strict=True))})


def amplitude_rows(table: pd.DataFrame, kind: str = FITTED) -> list[Row]:
    """Return a row for each measured amplitude, and one for their mean ([B] Tables 1 to 3).

    Args:
        table: Amplitudes with the columns load, gasket, source and one per sensor, in mm; the
            sources are experiment, wm_drake, and perhaps a model of [B].
        kind: Whether the amplitudes were fitted.
    """
    section, rows = "[B] Tables 1 to 3: amplitudes", list[Row]()
    every: dict[str, list[float]] = {"wm_drake": [], "other": []}
    sensors = [str(name) for name in table.columns[3:]]
    for (load, gasket), group in table.groupby(["load", "gasket"], sort=False):
        by_source = group.set_index("source")[sensors]
        others = [name for name in by_source.index if name not in ("experiment", "wm_drake")]
        if not {"experiment", "wm_drake"} <= set(by_source.index):
            continue
        for sensor in sensors:
            measured, ours = by_source.loc[["experiment", "wm_drake"], sensor]
            pair, more = Pair(measured, ours, "mm", AMPLITUDE_LIMIT), ""
            every["wm_drake"].append(abs(pair.difference))
            for other in others:
                theirs = 100.0 * (by_source.loc[other, sensor] - measured) / measured
                every["other"].append(abs(theirs))
                more += f"; {other}: {_signed(theirs)} %"
            what = f"{load}, {'with' if gasket == 'yes' else 'without'} gasket, {sensor}"
            rows.append(pair.row(section, what, kind, more))
    if every["wm_drake"]:
        mean, most = np.mean(every["wm_drake"]), np.max(every["wm_drake"])
        limit = float(np.mean(every["other"])) if every["other"] else math.nan
        verdict = OPEN if math.isnan(limit) else _verdict(bool(mean <= limit))
        reason = f"over {len(every['wm_drake'])} amplitudes; largest {most:.1f} %"
        if not math.isnan(limit):
            reason += f"; [B]'s model: {limit:.1f} % over {len(every['other'])}"
        published = "" if math.isnan(limit) else f"{limit:.1f} %"
        rows.append(
            Row(section, "mean difference", kind, published, f"{mean:.1f} %", "", verdict, reason)
        )
    return rows


def held_out_table_rows(table: pd.DataFrame, studies: pd.DataFrame) -> list[Row]:
    """Return rows for tables of [B] that were held out of the fit and predicted.

    Args:
        table: Table from `wm_drake.studies.calibrate.results.predictions_of`.
        studies: Agreement of the gasket study of each held-out load, fitted and predicted, with the
            columns held_out, fit, responses and same_leading_factor.
    """
    section, rows = "[B] Tables 1 to 5: tables held out of the fit", list[Row]()
    for name, of_group in table.groupby("held_out", sort=False):
        loads = " and ".join(str(name).split())
        leaders = studies[studies.held_out == name].set_index("fit")
        if len(leaders):
            count = int(leaders.responses["predicted"])
            least = count - LEADERS_MISSED
            ours, fitted = leaders.same_leading_factor[["predicted", "calibrated"]]
            goal, verdict = f"at least {least} of {count} (goal)", _verdict(ours >= least)
            quantity, more = f"{loads}: leading factors", f"{fitted} when they are fitted"
            rows.append(
                Row(section, quantity, PREDICTED, goal, f"{ours} of {count}", more, verdict, "")
            )
        for group in of_group.to_dict("records"):
            rows += _held_out_kind(section, loads, group)
    return rows


def _held_out_kind(section: str, loads: str, group: dict[Hashable, Any]) -> list[Row]:
    """Return the rows of one kind of values of held-out loads: mean difference and coverage."""
    what, covered = group["what"], group["in_intervals_percent"]
    unit = "points" if what == "contributions" else "%"
    mean, largest, fitted = (
        f"{group[f'{kind}_percent']:.1f} {unit}"
        for kind in ("predicted_mean", "predicted_largest", "calibrated_mean")
    )
    judged = (
        ("mean difference of", group["predicted_mean_percent"], "mean", mean),
        ("in the 95 % intervals:", covered, "covered", f"{covered:.0f} %"),
    )
    rows = []
    for words, value, key, ours in judged:
        goal = HELD_OUT_GOALS.get((what, key))
        is_met = goal is None or (value <= goal if key == "mean" else value >= goal)
        limit = f"{'at most' if key == 'mean' else 'at least'} {goal:g}" if goal else ""
        more = f"largest {largest}; {fitted} in the mean when fitted" if key == "mean" else ""
        rows.append(
            Row(
                section,
                f"{loads}: {words} {group['values']} {what}",
                PREDICTED,
                f"{limit} {unit if key == 'mean' else '%'} (goal)" if goal else "",
                ours,
                more,
                _verdict(is_met) if goal else OPEN,
                "" if goal else "no goal",
            )
        )
    return rows


def effect_rows(data: xr.Dataset, kind: str = FITTED) -> list[Row]:
    """Return a row for each effect of the gasket on an amplitude, and one for the steady state.

    Args:
        data: Differences of a machine without and with gasket, as of `differences_of` in
            `wm_drake.studies.spin.comparison`.
        kind: Whether the amplitudes were fitted. The steady state is predicted always.
    """
    section, rows = "[B] Table 1 and section 2.2: effect of the gasket", list[Row]()
    table = data.isel(variant=1).to_dataframe().assign(reference=data.value.values[:, 0])
    for row in table[table.measure == "amplitude"].itertuples():
        published, ours = 100.0 * row.measured_change, 100.0 * row.change
        if not (math.isfinite(published) and math.isfinite(ours)):
            continue
        if abs(published) < SMALL_EFFECT:
            is_met = abs(ours) < SMALL_EFFECT
            reason = f"measured effect below {SMALL_EFFECT:g} %: ours must be so too"
        else:
            is_met = published * ours > 0.0
            reason = "signs agree" if is_met else "signs differ"
        texts = (f"{_signed(published)} %", f"{_signed(ours)} %")
        points = f"{_signed(ours - published)} points"
        what = f"{row.load}, {row.of}"
        rows.append(Row(section, what, kind, *texts, points, _verdict(is_met), reason))
    large = table[(table.measure.str.startswith(STEADY)) & (table.reference >= 1e3 * LARGE_STEADY)]
    steady = 100.0 * large.change.abs()
    if steady.notna().any():
        worst = large.iloc[int(np.nanargmax(steady))]
        is_met = steady.max() <= SMALL_STEADY
        reason = f"limit {SMALL_STEADY:g} %; worst: {worst.load}, {worst.of}"
        ours = f"up to {steady.max():.1f} %"
        what = f"difference of steady amplitudes from {1e3 * LARGE_STEADY:g} mm on"
        verdict = _verdict(is_met)
        rows.append(Row(section, what, PREDICTED, "negligible", ours, "", verdict, reason))
    return rows


def mean_rows(
    screening: xr.Dataset, published: PublishedResults, kind: str = PREDICTED
) -> list[Row]:
    """Return a row for each published grand mean ([B] Table 5), and one for all."""
    section = "[B] Table 5: grand means of the gasket study"
    rows, every = list[Row](), list[float]()
    for (load, name), terms in published.items():
        if CONSTANT not in terms or (load, name) not in labels_of(screening):
            continue
        mean = at(screening, (load, name))["mean"]
        theirs, ours = terms[CONSTANT].effects[0], float(shown(mean))
        pair = Pair(theirs, ours, quantity_of(mean).unit.label, MEAN_LIMIT)
        every.append(abs(pair.difference))
        rows.append(pair.row(section, f"{load}, {name}", kind))
    if every:
        good = sum(size <= MEAN_LIMIT for size in every)
        reason = f"{good} of {len(every)} within {MEAN_LIMIT:g} %; largest {max(every):.0f} %"
        size, verdict = f"{np.mean(every):.1f} %", _verdict(good == len(every))
        rows.append(Row(section, "mean difference", kind, "", size, "", verdict, reason))
    return rows


def spin_cycle_rows(size: xr.DataArray) -> list[Row]:
    """Return what [A] section 4 says in words about its spin cycle, and whether ours agrees.

    They are fitted: masses, mounts and profile of `free_stroke` were chosen so that they hold.

    Args:
        size: RMS displacements of `run_spin_cycle` with the cases 2 (400 g at the front), 5 (400 g
            at the rear) and 29 (both, opposite) of [A] Table 9.
    """
    section = "[A] section 4: spin cycle"
    second = str(size.accelerometer.values[1])
    front, rear, opposite = (size.sel(case=name) for name in ("2", "5", "29"))
    rows = []
    for what, values, region in (
        (
            "400 g at the front: region of the largest y",
            front.sel(axis="y").max("accelerometer"),
            "R7",
        ),
        (
            "400 g at the front: region of the largest z",
            front.sel(axis="z").max("accelerometer"),
            "R5",
        ),
        ("400 g at the rear: region of the largest y, second sensor", _of(rear, second, "y"), "R2"),
    ):
        ours = str(values.idxmax("region").item())
        reason = "the region agrees" if ours == region else _runner_up(values, region, ours)
        verdict = _verdict(ours == region)
        rows.append(Row(section, what, FITTED, region, ours, "", verdict, reason))
    for place, alone in (("front", front), ("rear", rear)):
        what = f"400 g at both ends, opposite: z against 400 g at the {place}"
        both = [values.sel(axis="z") for values in (opposite, alone)]
        rows.append(_reduced_row(section, what, both[0], both[1]))
    reason = "[A] prints errors against its own experiment, but no displacements"
    what = "average error over 33 cases"
    rows.append(Row(section, what, FITTED, "20.1 %", "", "", OPEN, reason))
    return rows


def _reduced_row(section: str, what: str, values: xr.DataArray, before: xr.DataArray) -> Row:
    """Return the row of a vibration that is reduced at all sensors (region, accelerometer)."""
    ratio = values.max("region") / before.max("region")
    by_region = (values / before).max("accelerometer")
    rising = by_region.region.values[by_region.values > 1.0]
    reason = (
        f"largest values over the regions; limit {REDUCED:g} at each sensor, an assumption. By "
        f"region and sensor z rises in {', '.join(rising) or 'none'}, up to "
        f"{float(by_region.max()):.1f} times"
    )
    ours = ", ".join(f"{name} {one:.2f}" for name, one in ratio.to_series().items())
    verdict = _verdict(float(ratio.max()) < REDUCED)
    return Row(section, what, FITTED, "significantly reduced", ours, "", verdict, reason)


def _of(values: xr.DataArray, accelerometer: str, axis: str) -> xr.DataArray:
    return values.sel(accelerometer=accelerometer, axis=axis)


def _runner_up(values: xr.DataArray, region: str, ours: str) -> str:
    share = 100.0 * float(values.sel(region=region) / values.sel(region=ours))
    return f"{region} has {share:.0f} % of the vibration in {ours}"


def coulomb_rows(fits: pd.DataFrame) -> list[Row]:
    """Return rows for k1 and c1 of Coulomb fits to loops of the MSTV model ([C] Table 2).

    Args:
        fits: Columns frequency_hz, amplitude_mm, k1, c1, k1 fitted and c1 fitted, in N/mm and
            N s/mm.
    """
    section, rows = "[C] Table 2: Coulomb fits to loops of the MSTV damper", list[Row]()
    for row in fits.to_dict("records"):
        test = f"{row['frequency_hz']:g} Hz, {row['amplitude_mm']:g} mm"
        pair = Pair(row["k1"], row["k1 fitted"], "N/mm", STIFFNESS_LIMIT)
        rows.append(pair.row(section, f"{test}: k1", PREDICTED))
        ratio = row["c1 fitted"] / row["c1"]
        is_met = 1.0 / DAMPING_FACTOR <= ratio <= DAMPING_FACTOR
        texts = (f"{row['c1']:g} N s/mm", f"{row['c1 fitted']:.2g} N s/mm", f"× {ratio:.2f}")
        reason = f"{'within' if is_met else 'not within'} a factor of {DAMPING_FACTOR:g}"
        rows.append(Row(section, f"{test}: c1", PREDICTED, *texts, _verdict(is_met), reason))
    return rows


def _signed(value: float) -> str:
    return f"{value:+.1f}".replace("-", "−")


def counts(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the number of rows by section and kind: met, missed and not comparable."""
    frame = pd.DataFrame([(r.section, r.kind, r.verdict) for r in rows])
    table = frame.groupby([0, 1, 2], sort=False).size().unstack(fill_value=0)
    return table.reindex(columns=[MET, MISSED, OPEN], fill_value=0)
