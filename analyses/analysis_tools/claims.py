"""What [B] says in words of amplitudes and of its gasket study, checked on ours."""

from collections.abc import Callable, Mapping
from typing import TypeAlias

import xarray as xr

from wm_drake.studies.gasket.screening import (
    LEADING_MAIN,
    Label,
    at,
    compared_terms,
    labels_of,
    mains,
)

HOLDS, FAILS = "holds", "**does not hold**"

Amplitudes: TypeAlias = Mapping[tuple[str, bool], Mapping[str, float]]
"""Amplitude of each sensor, by load and whether the gasket is in. [mm]"""


def _share(screening: xr.Dataset, label: Label, factor: str) -> float:
    return float(at(screening, label).share.sel(term=factor))


def _leader(screening: xr.Dataset, label: Label) -> str:
    return str(mains(at(screening, label)).term.values[0])


def _leading(screening: xr.Dataset, factor: str) -> set[Label]:
    """Return the responses of which a factor explains more than the threshold of [B]."""
    labels = labels_of(screening)
    return {label for label in labels if _share(screening, label, factor) > LEADING_MAIN}


def _low(screening: xr.Dataset, load: str, name: str, factor: str) -> float:
    """Return the effect of a factor at its lowest level. [SI]"""
    effect = at(screening, (load, name)).effect.sel(term=factor, other_level="", level=-1)
    return float(effect)


def _spread(screening: xr.Dataset, load: str, name: str) -> float:
    of = at(screening, (load, name))
    return float(of.largest - of.smallest)


def _mean(screening: xr.Dataset, load: str, name: str) -> float:
    return float(at(screening, (load, name))["mean"])


def _main_shares(screening: xr.Dataset) -> dict[Label, float]:
    """Return the shares of all main effects, Dx of the middle load apart."""
    labels = [label for label in labels_of(screening) if label != ("middle", "Dx")]
    return {label: float(at(screening, label).main) for label in labels}


LEAST_MAIN = 0.925
"""Share of the main effects that [B] finds in every response but D_x of the middle load."""

LOADS = ("middle", "counter")

CLAIMS: dict[str, Callable[[xr.Dataset], bool]] = {
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
        share >= LEAST_MAIN for share in _main_shares(s).values()
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


def claims(screenings: Mapping[str, xr.Dataset]) -> list[tuple[str, list[str]]]:
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


def _least_main(screening: xr.Dataset) -> str:
    """Return the smallest share of the main effects, Dx of the middle load apart."""
    shares = _main_shares(screening)
    least = min(shares, key=lambda label: shares[label])
    good = sum(share >= LEAST_MAIN for share in shares.values())
    text = f"{100.0 * shares[least]:.1f} % ({', '.join(least)})"
    return f"{text}; {good} of {len(shares)} reach 92.5 %"


def _elsewhere(screening: xr.Dataset, names: str, own: str = "") -> str:
    """Return the largest contribution of factors to responses other than one."""
    shares = {
        (*label, name): _share(screening, label, name)
        for label in labels_of(screening)
        for name in names.split()
        if label[1] != own
    }
    worst = max(shares, key=lambda key: shares[key])
    return f"{100.0 * shares[worst]:.0f} % ({', '.join(worst)})"


def _damping_ratios(screening: xr.Dataset, published: xr.Dataset) -> str:
    """Return smallest and largest ratio of effects of damping on displacements to printed ones."""
    names = [name for name in screening.response.values.tolist() if name.startswith("D")]
    ours, theirs = (
        data.effect.sel(response=names, term=["C_L", "C_T"], other_level="", level=-1)
        for data in (screening, published)
    )
    compared = compared_terms(published).sel(response=names, term=["C_L", "C_T"])
    ratios = (ours / theirs).where(compared)
    return f"{float(ratios.min()):.1f} to {float(ratios.max()):.1f} times"


def numbers(screenings: Mapping[str, xr.Dataset], published: xr.Dataset) -> list[list[str]]:
    """Return the numbers behind statements of section 4: printed, and of each machine."""
    rows: dict[str, tuple[str, Callable[[xr.Dataset], str]]] = {
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
            lambda s: f"{100.0 * _share(s, ('middle', 'Dz'), 'K_Ty'):.0f} %",
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
