"""Generated hostile inputs for every door of the command line; the number of a case is its seed."""

import functools
import json
import math
import random
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import xarray as xr
from ruamel.yaml import YAML

from wm_drake.model.bodies import SDF_FOLDER
from wm_drake.parameters.components import COMPONENTS_FOLDER
from wm_drake.parameters.files import CYCLES_FOLDER, MACHINES_FOLDER
from wm_drake.parameters.gasket_drawing import GASKETS
from wm_drake.parameters.vary_file import VARY_FILES


@dataclass
class FuzzCase:
    """A command with hostile input.

    Attributes:
        door: Name of the input door.
        arguments: The command, without its first word.
        names: Texts of which a message must contain at least one: file or option.
        keys: Texts of which a message must contain at least one; empty if no key can be named.
    """

    door: str
    arguments: list[str]
    names: list[str]
    keys: list[str] = field(default_factory=list)


WORDS = [
    "", " ", "~", "nan", "inf", "-inf kg", "1e999 kg", "-1 kg", "0", "1", "1 kg", "1 mm", "-5 N/mm",
    "6,5 N/mm", "1e308 m", "1e-308 N/m", "５ N/mm", "٣ kg", "1 kg**kg", "1 m" + "m" * 30,
    "1 " + "m" * 5000, "1 9**9**9**9", "1 mm**9**9**9", "1 " + "(" * 3000 + "m" + ")" * 3000,
    "1 m" + "*m" * 3000, "1 m^999999999", "1 [m]", "1 __import__('os')", "(1, 2", "(1, 2, 3) mm",
    "(" + "1," * 50_000 + "1) mm", "()", "(nan, 1) mm", "9" * 5000 + " kg", "x" * 100_000,
    "<script>alert(1)</script>", "[/]", "[/b] name", "[bold", "a\x1b[31mred", "a\nb", "a\rb",
    "../../escape", "/", "/dev/zero", "/dev/stdin", "/proc/self/mem", "http://localhost/mesh.obj",
    "file:///etc/passwd", "a" * 300 + ".yaml", "a\0b", "%s%n{0}", "null", "true", "2020-13-45",
    "{}", "💥", "\u202e", "1_000 kg", "0x10 kg", "1 kg # comment", "5 a" + " " * 200_000 + "b",
    "5 kg" + " " * 200_000, "1e300 kg", "1e300 N/mm", "1e-300 s", "1e6 s", "1e9 s", "(0, 1e308) s",
    "(0, 1e9) s", "1510 N/mm", "--out", "-h",
]  # fmt: skip
"""Texts that a value may be replaced by."""

BRANCHES = [
    None,
    [],
    {},
    [[]],
    [None],
    {"": ""},
    {"value": "1 kg"},
    {"source": "x"},
    {"value": {"value": {"value": "1 kg"}}},
    [["1 kg"] * 3] * 3,
    {"law": "mstv"},
    {"law": []},
    {"steps": [{"steps": []}]},
    {"time": "(0, 1) s", "speed": "(0, 1) rpm"},
    {"displacement": "(0, 0) mm", "force": "(0, 0) N"},
    {"displacement": "(0, 1e300) mm", "force": "(0, 1e300) N"},
    {"unbalances": [{"mass": "1e300 kg", "radius": "1e300 m", "y": "0 mm"}]},
]
"""Groups that a value may be replaced by."""


def deep(depth: int, left: str, right: str) -> str:
    """Return nested brackets."""
    return left * depth + right * depth


DOCUMENTS = [
    "",
    "\n",
    "~\n",
    "a\n",
    "- a\n",
    "a: [\n",
    "a: 'b\n",
    "\t",
    "%YAML 9.9\n---\na: b\n",
    "--- a\n--- b\n",
    "a: !!python/object/apply:os.system ['touch hacked']\n",
    "a: !!binary '//8='\n",
    "a: !x {b: c}\n",
    "? [a, b]\n: c\n",
    "? {a: b}\n: c\n",
    "a: &a [*a]\n",
    'name: "\\ud83d"\n',
    "a: &a {b: *a}\n",
    "a: &a\n  <<: *a\n",
    "<<: 1\n",
    "<<: [1, 2]\n",
    "extends: &a [*a]\n",
    "a: " + deep(500, "[", "]") + "\n",
    "a: " + deep(20_000, "[", "]") + "\n",
    "a: " + deep(5_000, "{a: ", "}") + "\n",
    "\n".join(" " * n + "a:" for n in range(600)) + "\n",
    "a: " + "- " * 3000 + "b\n",
    "a0: &a0 [x, x]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 26)),
    "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 10)),
    "a0: &a0 {k0: x}\n" + "".join(f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 9)}], k{n}: x}}\n" for n in range(1, 10)),
    "name: " + "x" * 3_000_000 + "\n",
    "".join(f"key{n}: value\n" for n in range(60_000)),
    "a: b\n" * 2,
    "\ufeffname: x\n",
    "name: \x07\n",
    "# only a comment",
    "loads: {<script>: 1}\n",
    "1: 2\n",
    "null: 2\n",
    "true: {1.5: 2}\n",
    "? |\n  a\n  b\n: c\n",
    "extends: reference\nextends: reference\n",
    "extends: [reference]\n",
    "extends: {a: b}\n",
    "extends: null\n",
    "extends: .\n",
    "extends: ''\n",
    f"extends: {'x' * 400}.yaml\n",
    'extends: "a\\0b"\n',
    "extends: /dev/zero\n",
    "extends: reference\nmeasured: [/dev/zero]\n",
    "extends: reference\nmeasured: ['\\0', /dev/null, /]\n",
    'extends: reference\nmeasured: ["a\\0b"]\n',
    f"extends: reference\nmeasured: [{'x' * 400}]\n",
    f"extends: reference\nmodel: {'x' * 400}.sdf\n",
    'extends: reference\nmodel: "a\\0b"\n',
    "extends: reference\nmodel: /dev/zero\n",
    "extends: reference\nmodel: ''\n",
    "extends: reference\nmodel: .\n",
    "extends: reference\nname: <script>alert(1)</script>\n",
    "extends: reference\nname: '[/]'\n",
    "extends: reference\nstep: 7 ms\n",
    "extends: reference\nstep: 1e-300 s\n",
    "extends: reference\nbodies: {tub: {mass: 1e300 kg}}\n",
    "extends: reference\nbodies: {tub: {mass: 1e-300 kg}}\n",
    "extends: reference\nbodies: {tub: {inertia: {xx: 1e-320 kg*m^2, yy: 1e-320 kg*m^2, zz: 1e-320 kg*m^2}}}\n",
    "extends: reference\ngravity: 1e300 m/s^2\n",
    "extends: reference\nsprings: {left: {tub_frame: 'a\\nb'}}\n",
]  # fmt: skip
"""Whole documents: syntax, tags, bombs, links."""

TABLES = [
    "",
    "\n\n",
    ",",
    "time,displacement,force\n",
    "time [s],displacement [mm],force [N]\n" + "1,2,3\n" * 30,
    "time [s],displacement [" + "m" * 5000 + "],force [N]\n" + "1,2,3\n" * 30,
    "time [s],displacement [9**9**9**9],force [N]\n" + "1,2,3\n" * 30,
    "a,b\n1\n",
    "a\n1,2,3\n",
    '"unclosed\n1,2\n',
    "time_s,speed_rpm\n0,0\n" + "x" * 140_000 + ",1\n",
    "time [s],displacement [mm],force [N]\n" + '"' + "x" * 140_000 + '",1,2\n',
    "time_s,speed_rpm\n0,0\n1,nan\n",
    "time_s,speed_rpm\n0,0\n1,inf\n",
    "time_s,speed_rpm\n0,0\n1,1e300\n",
    "time_s,speed_rpm\n0,0\n٣,٥\n",
    "time_s,speed_rpm,region\n0,0,<script>\n1,1,<script>\n2,2,\n",
    "time_s,speed_rpm,region\n0,0,[/b]\n1,1,[/b]\n2,2,\n",
    "time_s;speed_rpm\n0;0\n1;6,5\n",
    "time_s,speed_rpm\n0,0\n1,6,5\n",
    "case,front_g,rear_g,phase_deg\n1,-1,0,0\n",
    "case,front_g,rear_g,phase_deg\n1,nan,0,0\n",
    "case,front_g,rear_g,phase_deg\n1,1e300,1e300,1e300\n",
    "case,front_g,rear_g,phase_deg\n[/b],1,1,1\n",
    "case,front_g,rear_g,phase_deg\n../../x,1,1,1\n",
    "case,front_g,rear_g,phase_deg\n" + "1,1,1,1\n" * 2,
    "case,region,sensor,axis,rms_mm\n1,R1,S1,x,-1\n",
    "case,region,sensor,axis,rms_mm\n1,R1,S1,x,text\n",
    "case,region,sensor,axis,rms_mm\n" + "1,R1,S1,x,1\n" * 2,
    "load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf\nmiddle,yes,experiment,text,1,1,1,1,1\n",
    "load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf\nmiddle,maybe,experiment,1,1,1,1,1,1\n",
    "load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf\nnowhere,yes,experiment,1,1,1,1,1,1\n",
    "load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf\nmiddle,yes,experiment,0,0,0,0,0,0\n",
    "\0\0\0",
    "a," * 50_000 + "a\n" + "1," * 50_000 + "1\n",
]
"""Whole tables."""

NUMBERS = [
    "-1", "0", "1", "nan", "inf", "-inf", "1e999", "1.5", "x", "", "99999999999999999999", "٣",
    "-9223372036854775809", "1e300", "1e-300", "0x10", "[/b]", "a" * 2000,
]  # fmt: skip
OPTIONS = [
    ("calibrate --vary FREE", ["--starts", "--iterations", "--seed", "--deviation", "--resolution", "--workers", "--weight", "--limit", "--leave-out", "--method"]),
    ("study gasket --trials 200", ["--seed", "--workers", "--design", "--model", "--tables", "--factor", "--load"]),
    ("study gasket", ["--trials"]),
    ("study spin-cycle", ["--workers", "--engine", "--profile", "--case"]),
    ("study spin-identify --out out", ["--seed", "--noise", "--workers", "--unknown", "--case"]),
    ("study gasket-damping", ["--workers", "--load"]),
    ("identify damper LOOP", ["--seed", "--knots", "--method", "--file-units", "--law", "--bounds", "--fix", "--name", "--cutoff"]),
    ("studio --no-browser", ["--machine", "--port"]),
    ("rig damper", ["--frequency", "--amplitude", "--matrix", "--sponge-mass", "--name", "--component"]),
    ("rig gasket --axis x -f 1Hz", ["--amplitude", "--arm", "--axis"]),
    ("spin", ["--load", "--engine", "--machine", "--profile", "--set", "--out"]),
    ("spin --machine reference --machine free_stroke", ["--machine", "--load", "--compare-gasket", "--measured"]),
    ("spin --compare-gasket", ["--no-gasket", "--replay", "--load", "--measured"]),
    ("study gasket --trials 100 --model main", ["--published", "--response"]),
    ("study tolerance --samples 16", ["--samples", "--sensitivity", "--subset", "--limits", "--response", "--seed"]),
    ("study design --evaluations 8 --population 4", ["--evaluations", "--population", "--seed"]),
    ("study modes", ["--amplitude", "--load"]),
    ("study response", ["--from", "--to", "--points", "--harmonics", "--rate", "--load", "--workers"]),
    ("record orders record.csv", ["--highest", "--unit"]),
    ("calibrate --vary FREE", ["--targets"]),
]  # fmt: skip
VALUED = {
    "--weight": ["middle=", "=", "middle:Xf=", "nowhere="],
    "--factor": ["C_L=", "gasket.stiffness_x=", "C_L=1 %..", "x="],
    "--unknown": ["gasket.stiffness_x=", "gasket.stiffness_x=(-5, 2) N/mm", "", "gasket.stiffness_x+gravity="],
    "--bounds": ["sponge_stiffness=", "x="],
    "--fix": ["slider_damping=", ""],
    "--leave-out": ["middle,middle", "middle", ",", "middle,nowhere", "middle,counter,front,back"],
    "--set": ["gravity=", "gasket.stiffness_x=", "x.y=", "bodies.tub.mass=", "profile="],
}  # fmt: skip
UNITS = {
    "--frequency": " Hz",
    "--amplitude": " mm",
    "--arm": " mm",
    "--sponge-mass": " g",
    "--cutoff": " Hz",
    "--from": " rpm",
    "--to": " rpm",
    "--rate": " rpm/s",
}


def leaves(node, path=()):
    """Yield the path of each node below the root of a tree."""
    entries = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()  # fmt: skip
    for key, child in entries:
        yield (*path, key)
        yield from leaves(child, (*path, key))


def plain(node):
    """Return a tree without the types of the YAML reader."""
    if isinstance(node, dict):
        return {str(key): plain(child) for key, child in node.items()}
    return [plain(child) for child in node] if isinstance(node, list) else node


def mutated_tree(random_: random.Random, tree: Any) -> tuple[str, list[str]]:
    """Return a document with one to three changed entries, and the keys that were changed."""
    keys = []
    for _ in range(random_.choice([1, 1, 1, 2, 3])):
        paths = list(leaves(tree))
        if not paths:
            break
        *parents, last = random_.choice(paths)
        node = tree
        for part in parents:
            node = node[part]
        change = random_.randrange(6)
        keys += [str(last), *(str(part) for part in parents)]
        if change <= 2:
            node[last] = random_.choice(WORDS)
        elif change == 3:
            node[last] = random_.choice(BRANCHES)
        elif change == 4:
            del node[last]
        elif isinstance(node, dict):
            name = random_.choice(WORDS)
            node[name] = node.pop(last)
            keys.append(name[:10])
            if len(name) > 1000:
                return json.dumps(
                    tree, ensure_ascii=False
                ), []  # YAML refuses a key of this length by itself
    return json.dumps(tree, ensure_ascii=False), keys


def broken_text(random_: random.Random, text: str) -> bytes:
    """Return a text with flipped, removed, repeated or foreign bytes."""
    data = bytearray(text.encode())
    for _ in range(random_.choice([1, 1, 2, 5])):
        at = random_.randrange(len(data) + 1)
        change = random_.randrange(5)
        if change == 0 and data:
            data[at - 1] ^= 1 << random_.randrange(8)
        elif change == 1:
            del data[at : at + random_.choice([1, 5, 100, 10_000])]
        elif change == 2:
            data[at:at] = random_.choice(WORDS).encode()
        elif change == 3:
            data[at:at] = data[at : at + random_.choice([10, 1000])]
        else:
            number = random_.choice([b"nan", b"-1", b"1e999", b"0", b"inf", b",", b"'", b":", b"<"])
            data[at : at + random_.choice([0, 1, 3])] = number
    return bytes(data)


SHIPPED = {
    "machine": MACHINES_FOLDER / "reference.yaml",
    "telescopic machine": MACHINES_FOLDER / "free_stroke.yaml",
    "profile": CYCLES_FOLDER / "profile_run_up.yaml",
    "regions": CYCLES_FOLDER / "profile_spin_cycle.yaml",
    "component": COMPONENTS_FOLDER / "mstv_damper.yaml",
    "factors": VARY_FILES.path("gasket"),
    "tolerance": VARY_FILES.path("laundry"),
    "design file": VARY_FILES.path("gasket"),
    "drawing": GASKETS.path("folded"),
}
TEXTS = {
    "limits": "limits:\n- {quantity: gap, at_least: 0 mm, allowed_share: 0.1 %}\n",
    "load": "unbalances:\n- {mass: 400 g, radius: 240 mm, y: 0 mm, phase: 10 deg}\n",
    "free": (
        "vary:\n  spring:\n    bounds: (1, 20) N/mm\n    prior: (7.5, 2) N/mm\n"
        "    sets: {spring_types.suspension.stiffness: '1'}\n    source: guess\n"
    ),
}


def loop_text() -> str:
    """Return a loop of a damper."""
    rows = [
        f"{0.005 * n:g},{5 * math.sin(0.1 * math.pi * n):.6g},{40 * math.cos(0.1 * math.pi * n):.6g}"
        for n in range(80)
    ]
    return "\n".join(["time [s],displacement [mm],force [N]", *rows]) + "\n"


CSV = {
    "csv profile": "time_s,speed_rpm,region\n0,0,\n1,60,R1\n2,90,R1\n3,120,\n",
    "cases": "case,front_g,rear_g,phase_deg\na,100,200,90\nb,0,300,0\n",
    "rms": "case,region,sensor,axis,rms_mm\n" + "".join(
        f"1,R{r},S{s},{axis},0.5\n" for r in range(1, 9) for s in (1, 2, 3) for axis in "xyz"
    ),
    "acceleration": "time_s,S1_x,S1_y,S1_z,S2_x,S2_y,S2_z,S3_x,S3_y,S3_z\n" + "".join(
        f"{0.01 * n:g}," + ",".join(["0.1"] * 9) + "\n" for n in range(50)
    ),
    "targets": (MACHINES_FOLDER / "sanchez_tabuenca_2020_table3.csv").read_text(encoding="utf-8"),
    "loop": loop_text(),
    "design": "C_L\n-1\n0\n1\n",
    "published": (MACHINES_FOLDER / "sanchez_tabuenca_2020_tables45.csv").read_text("utf-8"),
    "signals": "time_s,speed_rpm,Xr,Zf\n" + "".join(f"{0.01 * n:g},{0.3 * n:g},{n % 7},{n % 5}\n" for n in range(3000)),
    "record": "time_s,Xr,Yr,Zr,Xf,Yf,Zf\n" + "".join(f"{0.01 * n:g},{n % 7},0,1,2,3,{n % 5}\n" for n in range(60)),
}  # fmt: skip


def commands(file: str) -> dict[str, list[str]]:
    """Return the command that reads a file, by door."""
    return {
        "machine": ["machine", "check", file],
        "telescopic machine": ["machine", "check", file],
        "sdf": ["machine", "check", "machine.yaml"],
        "mesh": ["machine", "check", "machine.yaml"],
        "profile": ["spin", "--profile", file],
        "csv profile": ["spin", "--profile", file],
        "regions": ["study", "spin-cycle", "--case", "1", "--profile", file],
        "load": ["spin", "--load", file],
        "component": ["rig", "damper", "--component", file, "-f", "1 Hz", "-a", "1 mm"],
        "factors": ["study", "gasket", "--trials", "200", "--vary", file],
        "design": ["study", "gasket", "--model", "main", "--factor", "C_L", "--design", file],
        "free": ["calibrate", "--vary", file],
        "targets": ["calibrate", "--vary", "free.yaml", "--targets", file],
        "cases": ["study", "spin-cycle", "--cases", file],
        "rms": ["study", "spin-cycle", "--case", "1", "--measured", file],
        "acceleration": ["study", "spin-cycle", "--case", "1", "--accelerations", "."],
        "loop": ["identify", "damper", file],
        "record": ["study", "gasket-damping", "--record", f"middle={file}"],
        "published": ["study", "gasket", "--trials", "100", "--model", "main", "--published", file],
        "signals": ["record", "orders", file],
        "tolerance": ["study", "tolerance", file, "--samples", "16"],
        "limits": ["study", "tolerance", "--samples", "16", "--limits", file],
        "drawing": ["gasket", "curves", file, "--quick"],
        "design file": ["study", "design", file, "--evaluations", "8", "--population", "4"],
    }


MEASURED = sorted(MACHINES_FOLDER.glob("*.csv"))
YAML_DOORS = (*SHIPPED, *TEXTS)
DOORS = (*YAML_DOORS, *CSV, *("netcdf", "sdf", "mesh", "set", "options", "links", "http", "dxf"))
"""Every door; a case takes them in turn."""


def yaml_text(door: str) -> str:
    """Return a valid document for a door."""
    return TEXTS[door] if door in TEXTS else SHIPPED[door].read_text(encoding="utf-8")


@functools.cache
def json_of(door: str) -> str:
    """Return a valid document for a door as JSON, which is YAML too."""
    return json.dumps(plain(YAML().load(yaml_text(door))))


def tree_of(door: str) -> Any:
    """Return a valid document for a door as a new tree."""
    return json.loads(json_of(door))


def case_of(number: int, folder: Path) -> FuzzCase:
    """Write the files of a case into an empty folder and return its command."""
    random_ = random.Random(number)
    door = DOORS[number % len(DOORS)]
    (folder / "free.yaml").write_text(TEXTS["free"], encoding="utf-8")
    for table in MEASURED if "machine" in door else ():
        (folder / table.name).write_bytes(table.read_bytes())
    if door in OWN_CASES:
        return OWN_CASES[door](random_, folder)
    name = "input.csv" if door in CSV else "input.yaml"
    if door == "acceleration":
        name = "1.csv"
    keys: list[str] = []
    kind = random_.randrange(4)
    if door in CSV:
        content = (
            random_.choice(TABLES).encode()
            if kind == 0
            else _mutated_table(random_, CSV[door]).encode()
            if kind <= 2
            else broken_text(random_, CSV[door])
        )
    elif kind == 0:
        content = random_.choice(DOCUMENTS).encode()
    elif kind <= 2:
        text, keys = mutated_tree(random_, tree_of(door))
        content = text.encode()
    else:
        content = broken_text(random_, yaml_text(door))
    (folder / name).write_bytes(content)
    others = ["/dev/zero", ": measured: "] if "machine" in door else ["/dev/zero"]
    command = commands(name)[door]
    options = [word for word in command if word.startswith("--")]
    return FuzzCase(door, command, [name, *others, *options], keys)


def _mutated_table(random_: random.Random, text: str) -> str:
    rows = [line.split(",") for line in text.splitlines()]
    for _ in range(random_.choice([1, 1, 2])):
        row = random_.choice(rows)
        if row:
            row[random_.randrange(len(row))] = random_.choice([*WORDS, *NUMBERS])
        if random_.random() < 0.2:
            rows.insert(random_.randrange(len(rows)), list(random_.choice(rows)))
        if random_.random() < 0.2:
            row.append(random_.choice(NUMBERS))
    return "\n".join(map(",".join, rows)) + "\n"


@functools.cache
def record() -> xr.Dataset:
    """Return a record with what the commands read of one."""
    time = 0.005 * np.arange(1200)
    angle = 3.0 * time**2
    displacement = 1e-3 * np.outer(np.cos(angle), np.arange(1.0, 7.0))
    return xr.Dataset(
        {
            "displacement": (("time", "sensor"), displacement, {"units": "m"}),
            "drum_angle": ("time", angle, {"units": "rad"}),
            "drum_speed": ("time", 6.0 * time, {"units": "rad/s"}),
        },
        {"time": time, "sensor": ["Xr", "Yr", "Zr", "Xf", "Yf", "Zf"]},
        {"gasket": "yes", "load": "middle"},
    )


def _netcdf_case(random_: random.Random, folder: Path) -> FuzzCase:
    """Return a case of a record: broken bytes, lost and odd variables, other files."""
    path, kind = folder / "input.nc", random_.randrange(4)
    if kind == 0:
        path.write_bytes(
            random_.choice([b"", b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"x" * 100_000, b"\0" * 5000])
        )
    elif kind == 1:
        record().to_netcdf(path, engine="h5netcdf")
        data = bytearray(path.read_bytes())
        for _ in range(random_.choice([1, 3, 30, 300])):
            data[random_.randrange(len(data))] ^= 1 << random_.randrange(8)
        path.write_bytes(data[: random_.choice([None, None, len(data) // 2, 100])])
    else:
        _changed_record(random_).to_netcdf(path, engine="h5netcdf")
    command = random_.choice(
        [
            ["record", "orders", path.name],
            ["study", "gasket-damping", "--record", f"middle={path.name}"],
        ]
    )
    return FuzzCase("netcdf", command, [path.name, "--record"])


def _changed_record(random_: random.Random) -> xr.Dataset:
    """Return a record with a lost, an odd or a short variable."""
    changed, name = record().copy(deep=True), random_.choice(list(record().variables))
    kind = random_.randrange(6)
    if kind == 0:
        return changed.drop_vars(name)
    if kind == 1:
        return changed.isel(time=slice(0, random_.choice([0, 1, 2, 5, 20])))
    if kind == 2:
        return changed.isel(sensor=slice(0, random_.choice([0, 1, 5])))
    if kind == 3:
        return changed.assign_coords(sensor=random_.sample([*WORDS[:20], "<script>"], 6))
    if kind == 4:
        return changed.rename({name: "odd"})
    values = changed["displacement"].values if name == "sensor" else changed[name].values
    values = values.copy()
    values[random_.randrange(len(values))] = random_.choice([np.nan, np.inf, -1e300, 0.0, 1e300])
    name = "displacement" if name == "sensor" else name
    return (
        changed.assign_coords(time=values)
        if name == "time"
        else changed.assign({name: (changed[name].dims, values)})
    )


SHAPES = [
    "<plane><normal>0 0 1</normal><size>1 1</size></plane>",
    "<sphere><radius>nan</radius></sphere>",
    "<sphere><radius>0</radius></sphere>",
    "<sphere><radius>-1</radius></sphere>",
    "<box><size>1 1</size></box>",
    "<box><size>1 nan 1</size></box>",
    "<box><size>0 0 0</size></box>",
    "<cylinder><radius>1e300</radius><length>1e300</length></cylinder>",
    "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>",
    "<capsule><radius>0.1</radius><length>0.2</length></capsule>",
    "<heightmap><uri>a.png</uri></heightmap>",
    "<empty/>",
    "",
]
MESHES = {
    "missing.obj": None,
    "empty.obj": "",
    "nan.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n",
    "inf.obj": "v inf 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n",
    "flat.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "point.obj": "v 0 0 0\n",
    "text.obj": "hello\n",
    "face.obj": "v 0 0 0\nf 1 2 99\n",
    "good.obj": "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n",
    "bad.stl": "solid\n",
    "bad.gltf": "{}",
    "http://localhost/mesh.obj": None,
    "file:///dev/zero": None,
    "/dev/zero": None,
    "package://nowhere/mesh.obj": None,
    "model://nowhere/mesh.obj": None,
    "a.unknown": "x",
    "x" * 400 + ".obj": None,
}


URIS = [
    "bodies.sdf", "other.sdf", "missing.sdf", ".", "..", "", "/dev/zero", "/etc/passwd", "file:///etc/passwd",
    "model://tub", "package://x/y.sdf", "http://localhost/x.sdf", "../work/bodies.sdf", "x" * 5000, "machine.yaml",
]  # fmt: skip
"""Names of included files."""


def _with_include(random_: random.Random, text: str, folder: Path) -> str:
    """Return an SDF that includes another file, which may include it again."""
    again = random_.choice(["<include><uri>bodies.sdf</uri></include>", "", "<html/>", "<a>"])
    other = f"<sdf version='1.9'><model name='other'>{again}</model></sdf>"
    (folder / "other.sdf").write_text(other, encoding="utf-8")
    added = f"<include><uri>{random_.choice(URIS)}</uri></include>"
    opening = '<model name="oscillating_group">'
    return text.replace(opening, opening + added)


def _without_mass_properties(random_: random.Random, text: str) -> str:
    """Return an SDF in which a link that moves lacks its mass or inertia, or states nonsense."""
    part = random_.choice(["mass", "inertial", "inertia", "ixx", "iyy", "izz"])
    found = list(re.finditer(f"<{part}>.*?</{part}>", text, re.DOTALL))
    content = random_.choice(["", "", " ", "nan", "-1", "1e300", "x"])
    chosen = random_.choice(found)
    changed = random_.choice(["", f"<{part}>{content}</{part}>"])
    return text[: chosen.start()] + changed + text[chosen.end() :]


def _sdf_case(random_: random.Random, folder: Path, door: str) -> FuzzCase:
    text = (SDF_FOLDER / "oscillating_group.sdf").read_text(encoding="utf-8")
    (folder / "machine.yaml").write_text("extends: reference\nmodel: bodies.sdf\n", "utf-8")
    if door == "mesh":
        name = random_.choice(list(MESHES))
        content = MESHES[name]
        if content is not None:
            (folder / name).write_text(content, encoding="utf-8")
        shape = f"<mesh>{random_.choice(['', '<drake:declare_convex/>'])}<uri>{name}</uri></mesh>"
    else:
        shape = random_.choice(SHAPES)
    kind = random_.randrange(6) if door == "sdf" else 0
    if kind == 4:
        data = _with_include(random_, text, folder).encode()
    elif kind == 5:
        data = _without_mass_properties(random_, text).encode()
    elif kind <= 1:
        link, tag = (
            random_.choice(["housing", "tub", "drum"]),
            random_.choice(["collision", "visual"]),
        )
        added = f'<{tag} name="odd"><geometry>{shape}</geometry></{tag}>'
        opening = f'<link name="{link}">'
        text = text.replace(opening, opening + added)
        data = text.encode()
    elif kind == 2:
        data = broken_text(random_, text)
    else:
        data = random_.choice(
            [
                b"",
                b"<sdf/>",
                b"<sdf version='1.9'><model name='x'/></sdf>",
                b"<!DOCTYPE x [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;'>]><sdf>&b;</sdf>",
                b"<a>" * 20_000 + b"</a>" * 20_000,
                b"<sdf version='1.9'><include><uri>http://localhost/x</uri></include></sdf>",
                b"\xff\xfe\x00",
                text.encode() + b" " * 80_000_000,
            ]
        )
    (folder / "bodies.sdf").write_bytes(data)
    return FuzzCase(door, commands("")[door], ["machine.yaml", "bodies.sdf", "odd"])


SET_KEYS = [
    "gravity", "gasket.stiffness_x", "gasket", "gasket.stiffness_x.force", "name", "model", "measured",
    "loads.middle.unbalances.0.mass", "loads.middle.unbalances.9.mass", "bodies.tub.mass", "bodies.tub.inertia",
    "bodies.tub.inertia.xx", "bodies.<script>.mass", "frames.sensor_Xr.position", "frames.[/b].position", "step",
    "damper_types.friction.law", "damper_types.friction.friction_force", "profile.time", "profile.steps", "sources",
    "sources.gravity", "imperfections.bearing", "imperfections.residual_imbalance.mass", "", ".", "..", "a" * 5000,
    ".".join("a" * 3000), "bodies." + ".".join("a" * 3000), "bodies.tub" + ".inertia" * 2000, "gravity.0", "springs.left.type",
    "unbalance_planes.front.radius", "sensors.Xr.axis", "extends", "٣", "\x1b[31m", "loads", "clearance.detergent_frame",
]  # fmt: skip


def _set_case(random_: random.Random, _folder: Path) -> FuzzCase:
    key = random_.choice(SET_KEYS)
    value = random_.choice([*WORDS, *NUMBERS]).replace("\0", "")
    entry = f"{key}={value}" if random_.random() < 0.95 else value
    command = random_.choice(
        [["spin"], ["machine", "show"], ["rig", "damper", "-f", "1 Hz", "-a", "1 mm"]]
    )
    parts = [part[:10] for part in key.split(".") if part and part.isprintable()] or ["--set"]
    parts = parts if "=" in entry else ["--set"]
    return FuzzCase("set", [*command, "--set", entry], ["--set", "reference.yaml"], parts)


def _options_case(random_: random.Random, folder: Path) -> FuzzCase:
    (folder / "loop.csv").write_text(CSV["loop"], encoding="utf-8")
    (folder / "record.csv").write_text(CSV["signals"], encoding="utf-8")
    command, options = random_.choice(OPTIONS)
    option = random_.choice(options)
    value = random_.choice(NUMBERS)
    if option in UNITS and random_.random() < 0.8:
        value += UNITS[option]
    if option in VALUED:
        value = random_.choice(VALUED[option]) + (value if option != "--leave-out" else "")
    words = command.replace("FREE", "free.yaml").replace("LOOP", "loop.csv").split()
    if command == "rig damper":
        given = {"--frequency": "1 Hz", "--amplitude": "1 mm"} | {option: value}
        words += [f"{name}={text}" for name, text in given.items()]
    else:
        words.append(f"{option}={value}")
    return FuzzCase(
        "options", words, [option, option.removeprefix("--"), "reference.yaml", "-f and -a"]
    )


def _links_case(  # noqa: C901 - one branch a kind of link
    random_: random.Random, folder: Path
) -> FuzzCase:
    """Return a case of files that name each other: chains, cycles, links, devices, folders."""
    kind = random_.randrange(9)
    file = "machine.yaml"
    path = folder / file
    if kind == 0:
        for n in range(1500):
            (folder / f"m{n}.yaml").write_text(f"extends: m{n + 1}.yaml\n", encoding="utf-8")
        (folder / "m1500.yaml").write_text("extends: reference\n", encoding="utf-8")
        path.write_text("extends: m0.yaml\n", encoding="utf-8")
    elif kind == 1:
        (folder / "link.yaml").symlink_to(path)
        path.write_text("extends: link.yaml\n", encoding="utf-8")
    elif kind == 2:
        path.symlink_to(folder / "other.yaml")
        (folder / "other.yaml").symlink_to(path)
    elif kind == 3:
        (folder / "loop").symlink_to(folder)
        path.write_text("extends: loop/machine.yaml\n", encoding="utf-8")
    elif kind == 4:
        path.symlink_to("/dev/zero")
    elif kind == 5:
        path.mkdir()
    elif kind == 6:
        file = random_.choice(["x" * 300, "x/" * 3000, "/dev/zero", "\x1b[31m", "[/b]", "a\nb"])
    elif kind == 7:
        path.write_text("extends: a.yaml\n", encoding="utf-8")
        for one, other in ("ab", "bc", "ca"):
            (folder / f"{one}.yaml").write_text(f"extends: {other}.yaml\n", encoding="utf-8")
    else:
        path.write_text("extends: reference\n", encoding="utf-8")
        path.chmod(0)
    return FuzzCase("links", ["machine", "check", file], [file[:20], ".yaml", "no such file"])


REQUESTS = {
    "run": {"page": "p", "state": {}, "keys": ["gasket.stiffness_x"]},
    "ranking": {"page": "p", "state": {}, "keys": []},
    "save": {"state": {}, "name": "mine", "overwrite": True},
    "studies": {"state": {}, "study": "tolerance", "options": {"samples": "16", "load": "middle"}},
}
"""Requests of the studio by address; each has the state below."""
STATE = {
    "machine": "reference",
    "values": {"gasket.stiffness_x": "4 N/mm", "bodies.tub.mass": "7 kg"},
    "load": "middle",
    "masses": [{"mass": "500 g", "radius": "235 mm", "y": "0 mm", "phase": "0 deg"}],
    "gasket": True,
}
PATHS = [
    "", "machines", "machine?id=reference", "machine?id=../x", "studies", "place?page=p",
    "nowhere",
]  # fmt: skip


def _request_case(random_: random.Random, _folder: Path) -> FuzzCase:
    """Return a request to the studio: method, address and body."""
    name = random_.choice(list(REQUESTS))
    body = {**REQUESTS[name], "state": STATE} if name != "ranking" else {"page": "p"}
    kind = random_.randrange(8)
    if kind == 0:
        method, path = random_.choice(["GET", "HEAD", "PUT", "DELETE"]), random_.choice(PATHS)
        return FuzzCase("http", ["http", method, f"api/{path}", ""], [""])
    if kind == 1:
        act, study = random_.choice(["cancel", "resume", "x"]), random_.choice(WORDS)[:300]
        path = f"api/studies/{quote(study, safe='')}/{act}"
        return FuzzCase("http", ["http", "POST", path, "{}"], [""])
    if kind == 2:
        text = broken_text(random_, json.dumps(body)).decode(errors="replace")
    else:
        text, _ = mutated_tree(random_, json.loads(json.dumps(body)))
    return FuzzCase("http", ["http", "POST", f"api/{name}", text], [""])


def _dxf_case(random_: random.Random, folder: Path) -> FuzzCase:
    """Return a case of the middle line of a gasket: broken text, odd values of odd groups."""
    entities = ["0\nLINE\n8\nwall\n10\n160\n20\n0\n11\n160\n21\n20\n"]
    entities.append("0\nARC\n8\nwall\n10\n170\n20\n20\n40\n10\n50\n0\n51\n180\n")
    entities.append("0\nLWPOLYLINE\n70\n0\n10\n180\n20\n20\n42\n0.41421356\n10\n190\n20\n10\n")
    random_.shuffle(entities)
    text = f"0\nSECTION\n2\nENTITIES\n{''.join(entities)}0\nENDSEC\n0\nEOF\n"
    content = broken_text(random_, text)
    if random_.random() < 0.5:
        lines = text.splitlines()
        lines[random_.randrange(len(lines))] = random_.choice([*WORDS, *NUMBERS])
        content = "\n".join(lines).encode(errors="replace")
    (folder / "wall.dxf").write_bytes(content)
    drawing = "dxf: {file: wall.dxf, unit: mm, thickness: 2 mm}\nrubber: {shore_a: 40}\n"
    (folder / "input.yaml").write_text(drawing, encoding="utf-8")
    command = ["gasket", "curves", "input.yaml", "--quick"]
    return FuzzCase("dxf", command, ["wall.dxf", "input.yaml"])


OWN_CASES = {
    "dxf": _dxf_case,
    "http": _request_case,
    "set": _set_case,
    "options": _options_case,
    "links": _links_case,
    "netcdf": _netcdf_case,
    "sdf": functools.partial(_sdf_case, door="sdf"),
    "mesh": functools.partial(_sdf_case, door="mesh"),
}
"""Doors whose cases are not a changed file of one kind."""
