"""Every kind of page that the commands write, each from a small run.

`KINDS` has the commands of each page; `tests/report/test_every_page.py` holds the list to the
templates of `wm_drake/report`.
"""

import contextlib
import io
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

FREE = """vary:
  friction: {bounds: "(10, 60) N", prior: "(30, 10) N", sets: damper_types.friction.friction_force, source: test}
  radius: {bounds: "(230, 250) mm", prior: "(240, 5) mm", sets: loads.middle.unbalances.0.radius, source: test}
"""
SHORT = (
    "extends: reference\nname: short\nprofile: {time: '(0, 4, 6) s', speed: '(60, 250, 250) rpm'}\n"
)
DAMPER = ("--component", "mstv_damper")


@dataclass(frozen=True)
class Kind:
    """A kind of page.

    Attributes:
        template: Template of the page in `wm_drake/report`.
        commands: Commands that write it, one after the other, in one folder. The last one writes
            to the folder `out`. `*` stands for the loops of the folder `bench`, `recording` for its
            record as a recorded file.
        page: Its path in the folder `out`.
    """

    template: str
    commands: tuple[tuple[str, ...], ...]
    page: str = "report.html"


def _one(template: str, *words: str, page: str = "report.html") -> Kind:
    return Kind(template, (words,), page)


def _fit(template: str, bench: tuple[str, ...], *words: str) -> Kind:
    return Kind(template, (("rig", *bench, "--out", "bench"), ("identify", *words)))


KINDS = {
    "machine": _one("sections.html", "machine", "check", "ball_rings", "--page", "out/report.html"),
    "spin": _one("sections.html", "spin"),
    "spin_of_motor": _one("sections.html", "spin", "--machine", "motor", "--load", "middle", "--detail"),
    "spin_of_cabinet": _one("sections.html", "spin", "--machine", "light_cabinet", "--load", "middle"),
    "spin_of_rings": _one("sections.html", "spin", "--machine", "ball_rings", "--load", "back", "--profile", "short_cycle.yaml"),
    "comparison": _one("sections.html", "spin", "--compare-gasket", "--load", "middle", "--load", "front"),
    "rig_damper": _one("sections.html", "rig", "damper", *DAMPER, "-f", "1,10 Hz", "-a", "0.3,1 mm"),
    "rig_gasket": _one("sections.html", "rig", "gasket", "--axis", "axial", "--matrix", "A"),
    "identify_damper": _fit("sections.html", ("damper", *DAMPER, "-f", "1,10 Hz", "-a", "0.3,1 mm"), "damper", "*"),
    "identify_table": _fit(
        "sections.html", ("gasket", "--axis", "axial", "-f", "1,5 Hz", "-a", "1,10 mm"),
        "gasket", "*", "--axis", "axial", "--law", "table",
    ),
    "identify_rivals": _fit(
        "sections.html",
        ("damper", *DAMPER, "-f", "1,5,10 Hz", "-a", "0.3,1 mm"),
        "damper", "*", "--law", "mstv,stv,coulomb",
    ),
    "identify_static": _one("sections.html", "identify", "gasket", "--static", "radial=r.csv", "axial=a.csv"),
    "calibration": _one(
        "sections.html", "calibrate", "--machine", "short.yaml", "--vary", "free.yaml",
        "--targets", "measured.csv", "--starts", "1", "--iterations", "3",
        "--leave-out", "back",
    ),
    "gasket": _one(
        "sections.html", "study", "gasket", "--trials", "150", "--check", "C_L=120 %",
        "--load", "middle", "--load", "counter", "--response", "D", "--response", "F",
        "--profile", "short_cycle.yaml",
    ),
    "gasket_of_one_load": _one(
        "sections.html", "study", "gasket", "--design", "orthogonal", "--trials", "243",
        "--model", "main", "--load", "back", "--response", "mount_force_peak", "--response", "amplitude",
        "--profile", "short_cycle.yaml",
    ),
    "gasket_curves": _one("sections.html", "gasket", "curves", "folded", "--quick", "--axial", "8 mm"),
    "gasket_geometry": _one(
        "sections.html", "study", "gasket-geometry", "--quick", "--profile", "short_cycle.yaml"
    ),
    "gasket_damping": Kind(
        "sections.html",
        (
            ("spin", "--load", "middle", "--out", "bench"),
            (*["study", "gasket-damping", "--mesh", "20", "--record"], "middle=bench/record_middle.nc"),
        ),
    ),
    "spin_cycle": _one("sections.html", "study", "spin-cycle", "--case", "2", "--case", "29", "--profile", "eight_regions.yaml"),
    "spin_identify": _one(
        "sections.html", "study", "spin-identify", "--case", "2",
        "--unknown", "gasket.stiffness_y=(1, 4) N/mm", "--profile", "short_cycle.yaml",
    ),
    "modes": _one("sections.html", "study", "modes"),
    "response": _one(
        "sections.html", "study", "response", "--load", "middle", "--points", "15",
        "--harmonics", "3", "--rate", "20 rpm/s", "--rate", "50 rpm/s",
    ),
    "orders": Kind("sections.html", (("spin", "--load", "middle", "--out", "bench"), ("record", "orders", "record"))),
    "compare": Kind(
        "sections.html",
        (
            ("spin", "--load", "middle", "--profile", "short_cycle.yaml", "--out", "bench"),
            ("record", "compare", "recording", "--load", "middle", "--profile", "short_cycle.yaml"),
        ),
    ),
    "calibrate_records": Kind(
        "sections.html",
        (
            ("spin", "--load", "middle", "--profile", "short_cycle.yaml", "--out", "bench"),
            (
                "calibrate", "recording", "--load", "middle", "--profile", "short_cycle.yaml",
                "--unknown", "damper_types.friction.friction_force",
            ),
        ),
    ),
    "tolerance": _one(
        "sections.html", "study", "tolerance", "laundry", "--samples", "64",
        "--sensitivity", "16", "--subset", "100", "--limits", "limits.yaml",
        "--profile", "short_cycle.yaml",
    ),
    "verdict": _one("sections.html", "verdict", "short.yaml", "--samples", "16", "--profile", "short_cycle.yaml"),
    "next": _one(
        "sections.html", "study", "next", "--vary", "free.yaml", "--samples", "32", "--budget", "2",
        "--profile", "short_cycle.yaml",
    ),
    "design": _one("sections.html", "study", "design", "gasket", "--evaluations", "48", "--population", "16", "--profile", "short_cycle.yaml"),
    "balancer": _one("sections.html", "study", "balancer", "--quick"),
    "detect": _one("sections.html", "study", "detect", "--quick"),
    "cycle": _one("sections.html", "study", "cycle", "--profile", "short_cycle.yaml"),
    "drive": _one("sections.html", "study", "drive", "--load", "middle", "--torques", "3", "--unbalances", "2"),
}  # fmt: skip


def write_page(name: str, folder: Path, *more: str) -> Path:
    """Run the commands of a kind of page in a folder, and return the page.

    Args:
        name: Name in `KINDS`.
        folder: Empty folder.
        more: More words of the last command.
    """
    kind = KINDS[name]
    _write_inputs(folder)
    with contextlib.chdir(folder):
        for command in kind.commands:
            added = more if command is kind.commands[-1] else ()
            _run([*_with_files(command, folder), "--quiet", *added])
    return folder / "out" / kind.page


def _with_files(command: tuple[str, ...], folder: Path) -> list[str]:
    words = []
    for word in command:
        if word == "*":
            words += [str(path) for path in sorted((folder / "bench").glob("loop_*.csv"))]
        elif word == "record":
            words.append(str(next((folder / "bench").glob("*.nc"))) if words else word)
        elif word == "recording":
            words.append(str(_write_recording(folder / "bench")))
        else:
            words.append(word)
    return words if {"--out", "--page"} & set(words) else [*words, "--out", "out"]


def _write_recording(folder: Path) -> Path:
    """Write the displacements and the speed of the record in a folder as a recorded file."""
    record, path = xr.load_dataset(next(folder.glob("*.nc"))), folder / "recording.csv"
    names = record.sensor.values.tolist()
    table = pd.DataFrame(1.1 * record.displacement.values, columns=[f"{n} [m]" for n in names])
    table.insert(0, "time [s]", record.time.values)
    table["speed [rad/s]"] = record.drum_speed.values
    table.to_csv(path, index=False)
    return path


def _run(words: list[str]) -> None:
    from wm_drake.cli import main

    before, sys.argv = sys.argv, ["wm-drake", *words]
    said, code = io.StringIO(), None
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            main()
    except SystemExit as ended:
        code = ended.code
    finally:
        sys.argv = before
    assert not code, f"{words}: {said.getvalue()}"


def _write_inputs(folder: Path) -> None:
    write_inputs_of_studies(folder)
    for name, stiffness in (("r", 3.0), ("a", 5.0)):
        _write_ramp(folder / f"{name}.csv", stiffness)


def write_inputs_of_studies(folder: Path) -> None:
    """Write the files that studies are given."""
    (folder / "free.yaml").write_text(FREE)
    (folder / "short.yaml").write_text(SHORT)
    (folder / "limits.yaml").write_text(
        "limits:\n  - {quantity: gap, at_least: 10 mm, allowed_share: 1 %}\n"
    )
    (folder / "short_cycle.yaml").write_text(
        "time: (0, 4, 6) s\nspeed: (60, 250, 250) rpm\n"
        "regions: [{name: R1, begin: 0 s, end: 3 s}, {name: R2, begin: 3 s, end: 6 s}]\n"
    )
    regions = [f"{{name: R{k + 1}, begin: {k} s, end: {k + 1} s}}" for k in range(8)]
    (folder / "eight_regions.yaml").write_text(
        f"time: (0, 8) s\nspeed: (60, 250) rpm\nregions: [{', '.join(regions)}]\n"
    )
    rows = [
        ["middle", "yes", "experiment", 16.0, 5.0, 12.0, 17.0, 5.0, 13.0],
        ["back", "yes", "experiment", 15.0, 4.0, 11.0, 9.0, 4.0, 7.0],
    ]
    sensors = ["Xr", "Yr", "Zr", "Xf", "Yf", "Zf"]
    pd.DataFrame(rows, columns=["load", "gasket", "source", *sensors]).to_csv(
        folder / "measured.csv", index=False
    )


def _write_ramp(path: Path, stiffness: float) -> None:
    """Write a quasi-static test with 3 N of friction: to both ends and back. [N/mm]"""
    ends = np.array([0.0, 10.0, -10.0, 10.0, -10.0, 0.0])
    displacement = np.interp(np.linspace(0, len(ends) - 1, 4000), range(len(ends)), ends)
    rate = np.gradient(displacement)
    force = stiffness * displacement + 3.0 * np.sign(rate) + 0.02 * displacement**3
    noise = np.random.default_rng(0).normal(scale=0.2, size=len(force))
    pd.DataFrame(
        {
            "time_s": np.linspace(0.0, 200.0, len(force)),
            "displacement_mm": displacement,
            "force_N": force + noise,
        }
    ).to_csv(path, index=False)
