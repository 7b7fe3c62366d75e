"""Show the study of drawings of a gasket: tables, page, the best drawing as a file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters.files import yaml_text
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.figure import MEASURED, OURS, Axis, Figure, Line, Panel, Points, in_grid
from wm_drake.report.formatting import number, plain, significant
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, line
from wm_drake.report.terminal import Printed
from wm_drake.studies.gasket_geometry.drawings import DrawingFactor
from wm_drake.studies.gasket_geometry.study import GAP, RESPONSES, Surface, excess, ranked
from wm_drake.studies.study import Facts, Result

METHOD = (
    "The drawings are a Latin hypercube of the factors. Finite elements give the curves of each, "
    "and the machine runs all loads with each gasket. The responses are fitted with polynomials of "
    "degree two (degree one if there are few drawings). The error is that on fresh drawings, by "
    "the range of the response in the design. The drawing with the largest gap on the surface, "
    "within the limits, is computed and run too; the best drawing is that with the largest gap of "
    "all that were run and keep the limits. "
    "Folds that touch hold each other off, unless the drawing has contact: false."
)


@dataclass(frozen=True)
class GasketGeometryResult(Result):
    """Result of the study.

    Attributes:
        name: Name or file of the drawing.
        levels: Levels of all drawings: those of the design, fresh ones, that with the largest gap
            on the surface. (n, factors)
        responses: Their responses by name. (n,) each
        design: Number of drawings of the design.
        best: The drawing whose runs have the largest gap.
        limits: Largest values of responses that the best drawing may have.
        sample: Levels that are distributed as those of the design. (m, factors)
    """

    name: str
    factors: tuple[DrawingFactor, ...]
    levels: FloatArray
    responses: dict[str, FloatArray]
    design: int
    surfaces: dict[str, Surface]
    best: GasketDrawing
    loads: tuple[str, ...]
    limits: dict[str, float]
    sample: FloatArray

    @property
    def kinds(self) -> list[str]:
        """Return what each drawing is for."""
        fresh = len(self.levels) - self.design - 1
        return ["design"] * self.design + ["fresh"] * fresh + ["best of surface"]

    @property
    def best_at(self) -> int:
        """Number of the best drawing that was run."""
        return int(ranked(self.responses, self.limits)[0])

    @property
    def keeps_limits(self) -> bool:
        """Whether the best drawing keeps all limits."""
        return not excess(self.responses, self.limits)[self.best_at]

    def warnings(self) -> Sequence[str]:
        """Return whether no drawing keeps the limits."""
        if self.keeps_limits:
            return []
        return ["no drawing that was run keeps all limits; the best one exceeds them the least"]

    def errors(self, name: str) -> float:
        """Return the RMS error of a surface on fresh drawings, by the response's range. [%]"""
        fresh = slice(self.design, -1)
        response = self.responses[name]
        error = self.surfaces[name].at(self.levels[fresh]) - response[fresh]
        spread = float(np.ptp(response[: self.design]))
        return 100.0 * float(np.sqrt(np.mean(error**2))) / spread if spread else 0.0

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the drawings with their responses, and what the factors contribute."""
        return {"drawings": drawings_table(self), "contributions": contributions_table(self)}

    def as_json(self) -> dict[str, Any]:
        """Return the tables for JSON."""
        shown = {
            "gasket": self.name,
            "loads": list(self.loads),
            "limits": self.limits,
            "keeps_limits": bool(self.keeps_limits),
            "degree": self.surfaces["smallest_gap_mm"].degree,
            "drawings": drawings_table(self).to_dict("records"),
            "contributions": contributions_table(self).to_dict("records"),
        }
        return plain(shown)

    def terminal(self) -> Printed:
        """Return what the factors contribute, and the best drawing."""
        return [contributions_shown(self).terminal(f"Gasket {self.name}"), summary(self)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        made = [
            ("Drawing", self.name),
            (
                "Drawings",
                f"{self.design} of the design, {len(self.levels) - self.design - 1} fresh",
            ),
            ("Loads", ", ".join(self.loads)),
            ("Limits", _limits_text(self)),
            *facts.rows(),
        ]
        return SectionedPage(
            f"Drawings of gasket {self.name}",
            summary(self),
            [
                Section("curves", "Gap over each factor", (_over_factors(self),)),
                Section("surfaces", "Surface and runs", (_agreement(self),)),
                Section("factors", "What each factor does", tables=(contributions_shown(self),)),
                Section("files", "Files", links=(("best.yaml", "the best drawing"),)),
            ],
            made,
            warnings=(*facts.warnings, *self.warnings()),
            about="Wall, folds, hardness: which drawing leaves the largest gap.",
            method=METHOD,
        ).html()

    def write(self, folder: Path) -> None:
        """Write the tables and the best drawing."""
        super().write(folder)
        (folder / "best.yaml").write_text(yaml_text(drawing_tree(self.best)), encoding="utf-8")


def drawings_table(result: GasketGeometryResult) -> pd.DataFrame:
    """Return each drawing: what it is for, its factors, its responses."""
    values = {
        f"{factor.name} [{factor.unit}]": factor.middle + factor.half * column
        for factor, column in zip(result.factors, result.levels.T, strict=True)
    }
    return pd.DataFrame({"kind": result.kinds, **values, **result.responses})


def contributions_table(result: GasketGeometryResult) -> pd.DataFrame:
    """Return the part of each factor in the variance of each response, and its change over it. [%]

    The change is that of the surface from the low to the high end, others in the middle.
    """
    rows = []
    for name in RESPONSES:
        surface = result.surfaces[name]
        parts = 100.0 * surface.contributions(result.sample)
        row: dict[str, Any] = {"response": name, "mean": float(surface.at(result.sample).mean())}
        for index, factor in enumerate(result.factors):
            ends = np.zeros((2, len(result.factors)))
            ends[:, index] = -1.0, 1.0
            low, high = surface.at(ends)
            row[f"{factor.name}_percent"] = parts[index]
            row[f"{factor.name}_change"] = high - low
        row["pairs_percent"] = parts[-1]
        row["error_on_fresh_percent_of_range"] = result.errors(name)
        rows.append(row)
    return pd.DataFrame(rows)


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


def summary(result: GasketGeometryResult) -> str:
    """Return the result in a few sentences."""
    best = ", ".join(
        f"{factor.words} {significant(factor.value(level), 3)} {factor.unit}"
        for factor, level in zip(
            result.factors, result.levels[result.best_at].tolist(), strict=True
        )
    )
    gap = result.responses[GAP]
    expected = float(result.surfaces[GAP].at(result.levels[-1:])[0])
    middle = float(result.surfaces[GAP].at(np.zeros((1, len(result.factors))))[0])
    return (
        f"Best drawing that was run: {best}. Its smallest gap is {number(gap[result.best_at], 2)} "
        f"mm. Limits: {_limits_text(result)}. In the middle of the ranges the surface has "
        f"{number(middle, 2)} mm. The drawing with "
        f"the largest gap on the surface, {number(expected, 2)} mm, has {number(gap[-1], 2)} mm "
        f"when it is run. Error of the surface of the gap on fresh drawings: "
        f"{number(result.errors(GAP))} % of the range."
    )


def _limits_text(result: GasketGeometryResult) -> str:
    texts = [f"{RESPONSES[name]} up to {limit:g}" for name, limit in result.limits.items()]
    return "; ".join(texts) or "none"


def _over_factors(result: GasketGeometryResult) -> Picture:
    surface, levels = result.surfaces[GAP], np.linspace(-1.0, 1.0, 41)
    panels = []
    for index, factor in enumerate(result.factors):
        at = np.zeros((len(levels), len(result.factors)))
        at[:, index] = levels
        x = factor.middle + factor.half * levels
        drawn = factor.middle + factor.half * result.levels[:, index]
        marks = (
            Line(x, surface.at(at), key="surface, others in the middle"),
            Points(drawn, result.responses[GAP], color=MEASURED, size=5.0, key="drawings"),
        )
        label = f"{factor.words}, {factor.unit}"
        panels.append(Panel(marks=marks, x=Axis(label=label), y=Axis(label=RESPONSES[GAP])))
    caption = "Smallest gap of all loads over each factor."
    return picture(
        Figure(panels=in_grid(panels, 2, share="y"), height=220.0),
        "Four panels: the smallest gap over each factor.",
        caption,
    )


def _agreement(result: GasketGeometryResult) -> Picture:
    panels = []
    for name, words in RESPONSES.items():
        computed, surface = result.responses[name], result.surfaces[name].at(result.levels)
        ends = np.array([computed.min(), computed.max()])
        at, count = slice(result.design, -1), result.design
        marks = (
            Line(ends, ends, color=MEASURED, width=1.0),
            Points(computed[:count], surface[:count], color=OURS, size=5.0, key="design"),
            Points(computed[at], surface[at], color=MEASURED, symbol="square", key="fresh"),
        )
        panels.append(
            Panel(title=words, marks=marks, x=Axis(label="computed"), y=Axis(label="surface"))
        )
    return picture(
        Figure(panels=in_grid(panels, 3), height=200.0),
        "Response of the surface over the computed one, for each response.",
        "Surface over computed response; squares: drawings that the fit does not know.",
    )


def contributions_shown(result: GasketGeometryResult) -> Table:
    """Return what each factor contributes, in units for reading."""
    groups = []
    for row in contributions_table(result).to_dict("records"):
        cells = [row["mean"]]
        for factor in result.factors:
            cells += [row[f"{factor.name}_percent"], row[f"{factor.name}_change"]]
        cells += [row["pairs_percent"], row["error_on_fresh_percent_of_range"]]
        groups.append(line(RESPONSES[row["response"]], cells))
    columns = [Column("response"), Column("mean", decimals=2)]
    for factor in result.factors:
        columns += [Column(factor.name, "%", 0), Column(f"its change over {factor.name}", "", 2)]
    columns += [Column("pairs", "%", 0), Column("error on fresh", "% of range", 1)]
    caption = (
        "Part of each factor in the variance of a response over the ranges, and the change of the "
        "response from its low to its high end. The response is the worst of all loads."
    )
    return Table(caption, tuple(columns), tuple(groups))
