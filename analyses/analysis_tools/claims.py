"""What section 4 of [B] says of its gasket study in words, checked on a screening."""

from collections.abc import Callable, Mapping

from wm_drake.studies.doe.anova import Term
from wm_drake.studies.gasket.screening import LEADING_MAIN_PERCENT, Label, Screening

HOLDS, FAILS = "holds", "**does not hold**"


def _mains(screening: Screening, label: Label) -> dict[str, Term]:
    return {t.name: t for t in screening.tables[label].terms if len(t.factors) == 1}


def _leader(screening: Screening, label: Label) -> str:
    mains = _mains(screening, label)
    return max(mains, key=lambda name: mains[name].percent)


def _leading(screening: Screening, factor: str) -> set[Label]:
    """Return the responses of which a factor explains more than the threshold of [B]."""
    labels = screening.tables
    limit = LEADING_MAIN_PERCENT
    return {label for label in labels if _mains(screening, label)[factor].percent > limit}


def _low(screening: Screening, load: str, name: str, factor: str) -> float:
    return _mains(screening, (load, name))[factor].effects[(-1,)]


def _spread(screening: Screening, load: str, name: str) -> float:
    values = screening.responses.values[load][name]
    return float(values.max() - values.min())


def _mean(screening: Screening, load: str, name: str) -> float:
    return screening.tables[load, name].constant


LOADS = ("middle", "counter")

CLAIMS: dict[str, Callable[[Screening], bool]] = {
    "the lowest displacement of the middle load is along y": lambda s: (
        _mean(s, "middle", "Dy") < min(_mean(s, "middle", "Dx"), _mean(s, "middle", "Dz"))
    ),
    "it has the most variability": lambda s: (
        _spread(s, "middle", "Dy") > max(_spread(s, "middle", "Dx"), _spread(s, "middle", "Dz"))
    ),
    "the lowest one of the counter load is along z, with the least variability": lambda s: all(
        measure(s, "counter", "Dz") < min(measure(s, "counter", "Dx"), measure(s, "counter", "Dy"))
        for measure in (_mean, _spread)
    ),
    "main effects explain at least 92.5 % of every response but D_x, middle load": lambda s: all(
        table.main_percent >= 92.5 for label, table in s.tables.items() if label != ("middle", "Dx")
    ),
    "K_Tx and K_Tz are insignificant for every response": lambda s: (
        not _leading(s, "K_Tx") | _leading(s, "K_Tz")
    ),
    "K_Ty affects M_y alone, with both loads": lambda s: (
        _leading(s, "K_Ty") == {(load, "My") for load in LOADS}
    ),
    "C_T is the most influential factor of M_x and M_z": lambda s: all(
        _leader(s, (load, name)) == "C_T" for load in LOADS for name in ("Mx", "Mz")
    ),
    "level -1 of C_T reduces M_x and M_z; that of K_Lx M_z, middle load": lambda s: (
        all(_low(s, load, name, "C_T") < 0.0 for load in LOADS for name in ("Mx", "Mz"))
        and _low(s, "middle", "Mz", "K_Lx") < 0.0
    ),
    "each force is governed by the stiffness along its own axis": lambda s: all(
        _leader(s, (load, f"F{axis}")) == f"K_L{axis}" for load in LOADS for axis in "xyz"
    ),
    "high C_L reduces D_x, middle load, and D_y and D_z, counter load": lambda s: all(
        _low(s, load, name, "C_L") > 0.0
        for load, name in (("middle", "Dx"), ("counter", "Dy"), ("counter", "Dz"))
    ),
    "low K_Ly reduces D_y, counter load": lambda s: _low(s, "counter", "Dy", "K_Ly") < 0.0,
    "high K_Lz reduces D_z with both loads": lambda s: all(
        _low(s, load, "Dz", "K_Lz") > 0.0 for load in LOADS
    ),
    "low K_Lx reduces D_x, counter load, and D_y and D_z, middle load": lambda s: all(
        _low(s, load, name, "K_Lx") < 0.0
        for load, name in (("counter", "Dx"), ("middle", "Dy"), ("middle", "Dz"))
    ),
    "high C_T reduces D_x of both loads, and D_y and D_z of the counter load": lambda s: all(
        _low(s, load, name, "C_T") > 0.0
        for load, name in (
            ("middle", "Dx"),
            ("counter", "Dx"),
            ("counter", "Dy"),
            ("counter", "Dz"),
        )
    ),
}
"""Statements of section 4, and whether a screening with D, F and M of both loads agrees."""


def claims(screenings: Mapping[str, Screening]) -> list[tuple[str, list[str]]]:
    """Return each statement with whether it holds in each screening."""
    return [
        (words, [HOLDS if holds(screening) else FAILS for screening in screenings.values()])
        for words, holds in CLAIMS.items()
    ]
