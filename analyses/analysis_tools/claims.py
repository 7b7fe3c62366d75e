"""What [B] says in words of amplitudes and of its gasket study, checked on ours."""

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from wm_drake.studies.doe.anova import Term
from wm_drake.studies.gasket.screening import LEADING_MAIN_PERCENT, Label, Published, Screening

HOLDS, FAILS = "holds", "**does not hold**"

Amplitudes: TypeAlias = Mapping[tuple[str, bool], Mapping[str, float]]
"""Amplitude of each sensor, by load and whether the gasket is in. [mm]"""


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


def change(amplitudes: Amplitudes, load: str, sensor: str) -> float:
    """Return the change of an amplitude by the gasket, [B] Eq. (1). [%]"""
    without, with_gasket = (amplitudes[load, gasket][sensor] for gasket in (False, True))
    return 100.0 * (with_gasket / without - 1.0)


def _verdict(is_so: bool, text: str) -> str:
    return f"{HOLDS if is_so else FAILS}: {text}"


def _signs(changes: Mapping[str, float], expected: int) -> str:
    """Return whether all changes have a sign, and those of the other one, or all."""
    wrong = {name: value for name, value in changes.items() if value * expected <= 0.0}
    shown = wrong or changes
    return _verdict(not wrong, ", ".join(f"{name} {value:+.0f} %" for name, value in shown.items()))


def _increases(amplitudes: Amplitudes) -> str:
    """Return the largest increase by the gasket along each axis, over both loads and ends."""
    largest = (
        max(change(amplitudes, load, f"{axis}{end}") for load in LOADS for end in "rf")
        for axis in "XYZ"
    )
    return ", ".join(f"{axis} {value:+.0f} %" for axis, value in zip("xyz", largest, strict=True))


def _plane(amplitudes: Amplitudes, load: str, end: str) -> str:
    """Return the plane of the two largest amplitudes at the rear or at the front of the tub."""
    smallest = min("XYZ", key=lambda axis: amplitudes[load, True][f"{axis}{end}"])
    return "XYZ".replace(smallest, "").lower()


def _planes(amplitudes: Amplitudes) -> str:
    found = [_plane(amplitudes, load, end) for load in ("back", "front") for end in "rf"]
    return _verdict(found == ["xz", "xz", "xy", "xz"], ", ".join(found))


def _changes_have_sign(load: str, sensors: str, expected: int) -> Callable[[Amplitudes], str]:
    return lambda of: _signs({name: change(of, load, name) for name in sensors.split()}, expected)


MEASURED_CLAIMS: dict[str, tuple[str, Callable[[Amplitudes], str]]] = {
    "2.2: middle load: the gasket increases all amplitudes but X_f": (
        "increase",
        _changes_have_sign("middle", "Xr Yr Zr Yf Zf", 1),
    ),
    "2.2: middle load: it reduces X_f": ("-1.0 %", _changes_have_sign("middle", "Xf", -1)),
    "2.2: counter load: it reduces X_r and Y_f": (
        "Xr -23.7 %, Yf -16.3 %",
        _changes_have_sign("counter", "Xr Yf", -1),
    ),
    "2.2: largest increases along x, y and z": ("80, 605, 25 %", _increases),
    "3.2: plane of the largest amplitudes: back load rear, front; front load rear, front": (
        "xz, xz, xy, xz",
        _planes,
    ),
}
"""Statements of sections 2.2 and 3.2: what is printed, and what amplitudes give."""


def measured_claims(computed: Mapping[str, Amplitudes]) -> list[list[str]]:
    """Return each statement on amplitudes, what is printed, and what each machine gives."""
    return [
        [words, printed, *(found(amplitudes) for amplitudes in computed.values())]
        for words, (printed, found) in MEASURED_CLAIMS.items()
    ]


def _least_main(screening: Screening) -> str:
    """Return the smallest share of the main effects, Dx of the middle load apart."""
    shares = {
        label: table.main_percent
        for label, table in screening.tables.items()
        if label != ("middle", "Dx")
    }
    least = min(shares, key=lambda label: shares[label])
    good = sum(share >= 92.5 for share in shares.values())
    return f"{shares[least]:.1f} % ({', '.join(least)}); {good} of {len(shares)} reach 92.5 %"


def _elsewhere(screening: Screening, names: str, own: str = "") -> str:
    """Return the largest contribution of factors to responses other than one."""
    percents = {
        (*label, name): _mains(screening, label)[name].percent
        for label in screening.tables
        for name in names.split()
        if label[1] != own
    }
    worst = max(percents, key=lambda key: percents[key])
    return f"{percents[worst]:.0f} % ({', '.join(worst)})"


def _damping_ratios(screening: Screening, published: Published) -> str:
    """Return smallest and largest ratio of effects of damping on displacements to printed ones."""
    ratios = [
        term.effects[(-1,)] / published.effects(label, term)[(-1,)]
        for label, term in published.compared_terms(screening)
        if label[1].startswith("D") and term.name in ("C_L", "C_T")
    ]
    return f"{np.min(ratios):.1f} to {np.max(ratios):.1f} times"


def numbers(screenings: Mapping[str, Screening], published: Published) -> list[list[str]]:
    """Return the numbers behind statements of section 4: printed, and of each machine."""
    rows: dict[str, tuple[str, Callable[[Screening], str]]] = {
        "smallest share of the main effects, D_x of the middle load apart": (
            "92.50 % (middle, Dz); 17 of 17 reach 92.5 %",
            _least_main,
        ),
        "largest contribution of K_Ty to another response than M_y": (
            "below 10 %",
            lambda s: _elsewhere(s, "K_Ty", "My"),
        ),
        "contribution of K_Ty to D_z, middle load": (
            "below 10 %",
            lambda s: f"{_mains(s, ('middle', 'Dz'))['K_Ty'].percent:.0f} %",
        ),
        "largest contribution of K_Tx or K_Tz": (
            "below 10 %",
            lambda s: _elsewhere(s, "K_Tx K_Tz"),
        ),
        "effects of C_L and C_T on displacements at level -1, by the printed ones": (
            "1",
            lambda s: _damping_ratios(s, published),
        ),
    }
    return [
        [words, printed, *(found(screening) for screening in screenings.values())]
        for words, (printed, found) in rows.items()
    ]
