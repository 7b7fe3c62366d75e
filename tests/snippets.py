"""Snippets of the manual: every fenced block, its command lines, and the files that they need."""

import re
import shutil
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from documents import CHECKOUT, MANUAL, README, name_of, text_of

from wm_drake.batch import simulate_many
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, load_profile
from wm_drake.parameters.components import load_component
from wm_drake.parameters.recorded_sensors import load_recorded_test
from wm_drake.parameters.unbalance_cases import load_unbalance_cases
from wm_drake.rigs import Harmonic, bushing_bench, damper_bench, force_loops
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.runs import simulate
from wm_drake.studies.compare.task import sensor_points
from wm_drake.studies.spin_cycle.study import measures_of, run_spin_cycle
from wm_drake.studies.spin_cycle.tables import rms_table

PAGES = [README, *(path for path in MANUAL if path.parent.name != "decisions")]
SHELL = ("text", "bash", "sh")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: its language and its lines."""

    page: str
    language: str
    lines: tuple[str, ...]

    @property
    def commands(self):
        """Return its command lines without the remarks behind them, if it is for a shell."""
        if self.language not in SHELL:
            return []
        return [re.split(r"\s{3,}|\s+#", line)[0].strip() for line in self.lines if line.strip()]


def blocks_of(path):
    """Return the fenced blocks of a page, in their order."""
    collected, language, lines = [], None, []
    for line in text_of(path).splitlines():
        if line.startswith("```"):
            if language is None:
                language, lines = line[3:].split(" ")[0], []
            else:
                collected.append(Block(name_of(path), language, tuple(lines)))
                language = None
        elif language is not None:
            lines.append(line)
    assert language is None, f"{path}: a block has no end"
    return collected


BLOCKS = [block for path in PAGES for block in blocks_of(path)]

FILES = {  # what a block with a file is called in the commands of its page
    "docs/how-to/accelerometers.md": ["test.yaml"],
    "docs/how-to/balancers.md": ["my_liquid.yaml"],
    "docs/how-to/bench-to-machine.md": ["mine.yaml"],
    "docs/how-to/calibrate.md": ["free.yaml", "responses.csv", "relation.yaml"],
    "docs/how-to/compliant-bearing.md": ["whirling.yaml", "loose.yaml"],
    "docs/how-to/cycle.md": ["towels.yaml"],
    "docs/how-to/designs.md": ["mine.yaml"],
    "docs/how-to/detect-unbalance.md": ["monitor.yaml"],
    "docs/how-to/drive.md": ["drive.yaml"],
    "docs/how-to/floor.md": ["on_my_floor.yaml", "on_soft_feet.yaml"],
    "docs/how-to/gasket-drawing.md": ["one_fold.yaml", "measured_rubber.yaml"],
    "docs/how-to/measure-next.md": ["mine.yaml"],
    "docs/how-to/own-machine.md": [
        "mine.yaml",
        "four_springs.yaml",
        "imperfect.yaml",
        "with_buffer.yaml",
        "bare_parts.yaml",
    ],
    "docs/how-to/rubber.md": ["rubber.yaml"],
    "docs/how-to/tolerances.md": ["mine.yaml", "limits.yaml"],
    "docs/reference/vary-file.md": ["vary.yaml"],
    "docs/theory/ball-ring.md": ["balls.yaml"],
    "docs/theory/liquid-ring.md": ["liquid.yaml"],
}
"""Names of the YAML and CSV blocks of each page."""

MINE = "name: mine\nextends: reference\nbodies: {upper_counterweight: {mass: 9.5 kg}}\n"
TABLE_1 = CHECKOUT / "wm_drake" / "data" / "machines" / "sanchez_tabuenca_2020_table1.csv"
TABLE_3 = TABLE_1.with_name("sanchez_tabuenca_2020_table3.csv")
CYCLES = CHECKOUT / "wm_drake" / "data" / "cycles"


def prepare(folder, page, chosen):
    """Write the files that the chosen commands of a page name: its own blocks, and a laboratory's."""
    (folder / "mine.yaml").write_text(MINE, encoding="utf-8")
    for name, mass in (
        ("a", "9 kg"),
        ("b", "11 kg"),
        ("my_machine", "10 kg"),
        ("mine_machine", "10 kg"),
    ):
        text = MINE.replace("mine", name).replace("9.5 kg", mass)
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    (folder / "spin.csv").write_text("time_s,speed_rpm\n0,30\n10,120\n12,120\n", encoding="utf-8")
    (folder / "limits.yaml").write_text(
        "limits:\n- {quantity: gap, at_least: 5 mm, allowed_share: 1 %}\n", encoding="utf-8"
    )
    amplitudes = pd.concat(pd.read_csv(path, comment="#") for path in (TABLE_1, TABLE_3))
    amplitudes.to_csv(folder / "measured.csv", index=False)
    amplitudes.to_csv(folder / "mine.csv", index=False)
    if re.search(r"\b(bench|fit|held|rubber)/|\b[ratw]\.csv", " ".join(chosen)):
        write_laboratory(folder)
    files = [block for block in BLOCKS if block.page == page and block.language in ("yaml", "csv")]
    for name, block in zip(FILES.get(page, []), files, strict=True):
        (folder / name).write_text("\n".join(block.lines) + "\n", encoding="utf-8")
    if "run_1.mf4" in " ".join(chosen):
        write_runs(folder, CHECKOUT / "docs" / "how-to" / "accelerometers.md")
    if page == "docs/how-to/commands.md":
        write_commands_page(folder, " ".join(chosen))


def write_runs(folder, page):
    """Write four recordings of the test that a page declares, with gains that scatter by 1 %.

    Three are of its own load, one of another.
    """
    from lab_writers import write_mdf

    block = next(block for block in blocks_of(page) if block.language == "yaml")
    (folder / "test.yaml").write_text("\n".join(block.lines) + "\n", encoding="utf-8")
    test, machine = load_recorded_test(folder / "test.yaml"), build_machine(load_machine())
    points, generator = sensor_points(machine, test), np.random.default_rng(1)
    records = {load: simulate(machine, load) for load in (test.load, "counter")}
    for number, record in enumerate([records[test.load]] * 3 + [records["counter"]], 1):
        time, angle = record.time.values, record.drum_angle.values
        fine = np.arange(0.0, time[-1], 2.5e-4)
        turns = test.speed.pulses_per_turn * test.speed.ratio * np.interp(fine, time, angle)
        channels = {"Tacho": (5.0 * (np.sin(turns) > 0.0), "V")}
        for name, sensor in test.sensors.items():
            signal = recorded_signal(record, sensor, points[name])
            signal *= generator.normal(1.0, 0.01)
            channels[sensor.channel] = (signal, sensor.signal_unit.si.replace("*", " "))
        write_mdf(folder / f"run_{number}.mf4", time, channels)


def write_laboratory(folder):
    """Write measured loops of a damper and of a gasket, with noise, and quasi-static tests."""
    damper = damper_bench(load_component("mstv_damper").parameters)
    machine = load_machine("free_stroke")
    bushing = machine.bushing_types["connecting"]
    write_loops(folder / "bench", damper, [(1.0, 0.3), (1.0, 1.0), (3.0, 1.0), (10.0, 1.0)])
    write_loops(folder / "fit", damper, [(1.0, 0.3), (3.0, 1.0), (10.0, 1.0)])
    write_loops(folder / "held", damper, [(1.0, 1.0)])
    write_loops(
        folder / "rubber", bushing_bench(bushing, "y"), [(1.0, 0.4), (3.0, 0.4), (5.0, 0.4)]
    )
    there = np.concatenate(
        [np.linspace(0, 20, 60), np.linspace(20, -20, 120), np.linspace(-20, 0, 60)]
    )
    time = np.arange(len(there)) / 4.0
    for name, unit, size, rate in (
        ("r", "mm", 1.0, 3.0), ("a", "mm", 1.0, 5.0), ("t", "deg", 0.25, 0.8), ("w", "deg", 0.25, 0.5)
    ):  # fmt: skip
        what, force = ("displacement", "force [N]") if unit == "mm" else ("angle", "moment [N m]")
        table = {"time [s]": time, f"{what} [{unit}]": size * there, force: rate * size * there}
        pd.DataFrame(table).to_csv(folder / f"{name}.csv", index=False)


def write_loops(folder, bench, motions):
    """Write force loops with 1 % of noise."""
    folder.mkdir()
    noise = np.random.default_rng(1)
    harmonics = [Harmonic(frequency, 1e-3 * amplitude) for frequency, amplitude in motions]
    for harmonic, loop in zip(harmonics, force_loops(bench, harmonics), strict=True):
        force = loop.force + 0.01 * np.abs(loop.force).max() * noise.standard_normal(
            len(loop.force)
        )
        table = {
            "time [s]": loop.time,
            "displacement [mm]": 1e3 * loop.displacement,
            "force [N]": force,
        }
        name = f"loop_{harmonic.frequency:g}Hz_{1e3 * harmonic.amplitude:g}mm.csv"
        pd.DataFrame(table).to_csv(folder / name, index=False)


def write_spin_cycle(path):
    """Write RMS displacements of the case that both commands with `--measured rms.csv` have."""
    machine = load_machine("free_stroke")
    cases = [case for case in load_unbalance_cases() if case.name == "2"]
    runs = partial(simulate_many, build_machine(machine), measures=measures_of(machine))
    result = run_spin_cycle(machine, cases, load_profile("spin_cycle"), runs)
    rms_table("rms", result.rms).frame().to_csv(path, index=False)


def write_design(path):
    """Write an orthogonal design of the factors of the gasket."""
    from wm_drake.studies.doe.design import make_design

    names = ("C_L", "C_T", "K_Lx", "K_Ly", "K_Lz", "K_Tx", "K_Ty", "K_Tz")
    design = make_design("orthogonal", names, trials=243)
    pd.DataFrame(design.levels, columns=names).to_csv(path, index=False)


def write_record(path):
    """Write the displacements of a run-up."""
    load = {"m": "middle", "c": "counter"}[path.stem]
    record = simulate(build_machine(load_machine("reference")), load)
    (1e3 * record.displacement).to_pandas().rename_axis("time_s").to_csv(path)


COMPUTED = {
    "design.csv": write_design,
    "rms.csv": write_spin_cycle,
    "m.csv": write_record,
    "c.csv": write_record,
}
"""Files that take seconds to compute, written where a command names them."""


def write_commands_page(folder, text):
    """Write the records, cases and designs that docs/how-to/commands.md names."""
    for name, write in COMPUTED.items():
        if re.search(rf"\b{name}", text):
            write(folder / name)
    (folder / "tolerances.yaml").write_text(
        "loads: middle\nvary:\n  friction: {keys: [damper_types.friction.friction_force], "
        "distribution: uniform, low: 35 N, high: 45 N}\n",
        encoding="utf-8",
    )
    shutil.copy(TABLE_1, folder / "amplitudes.csv")
    shutil.copy(TABLE_1.with_name("sanchez_tabuenca_2020_tables45.csv"), folder / "results.csv")
    shutil.copy(CYCLES / "profile_spin_cycle.yaml", folder / "my_cycle.yaml")
    cases = (CYCLES / "cases_table9.csv").read_text(encoding="utf-8").splitlines()
    (folder / "my_cases.csv").write_text("\n".join(cases[:4]) + "\n", encoding="utf-8")
    time = np.arange(0.0, 40.0, 2e-3)
    rpm = 60.0 + 6.0 * time
    angle = np.cumsum(rpm) * 2e-3 * np.pi / 30.0
    pd.DataFrame({"time_s": time, "speed_rpm": rpm, "front": np.sin(angle)}).to_csv(
        folder / "vibration.csv", index=False
    )
