"""Command `wm-drake machine new`: files to start from, from another machine or from numbers."""

import json
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from wm_drake.errors import InputError, input_error
from wm_drake.report.terminal import say
from wm_drake.studies.inputs import existing_file
from wm_drake.studies.study import OptionModel, option
from wm_drake.written_files import OTHER_NAME, check_new, write_files


class NewOptions(OptionModel):
    """Numbers of a new machine, as text with units; their defaults are those of `FirstNumbers`."""

    tub_mass: str = option("", "All that hangs and does not turn. Default: 35 kg.", "VALUE")
    drum_mass: str = option("", "All that turns. Default: 9 kg.", "VALUE")
    tub_centre: str = option(
        "", "Centre of mass of the tub with all that is fixed to it. Default: the origin.", "VALUE"
    )
    springs: str = option("", "Number of springs, 2 to 4. Default: 2.", "N")
    dampers: str = option("", "Number of dampers, 2 to 4; a third is at the rear. Default: 2.", "N")
    spring_rate: str = option("", "Rate of one spring. Default: for 2.5 Hz vertically.", "VALUE")
    friction: str = option("", "Friction force of one damper. Default: 80 N in all.", "VALUE")
    gasket_stiffness: str = option("", "Stiffness of the door gasket. Default: 2 N/mm.", "VALUE")
    drum_radius: str = option("", "Radius of the drum. Default: 240 mm.", "VALUE")
    drum_depth: str = option("", "Depth of the drum. Default: 340 mm.", "VALUE")
    gap: str = option("", "Distance between tub and cabinet at the sides. Default: 38 mm.", "VALUE")
    unbalance: str = option("", "Mass of the unbalance. Default: 0.5 kg.", "VALUE")
    speed: str = option("", "Highest drum speed. Default: 1200 rpm.", "VALUE")
    parts: Path | None = option(
        None,
        "Table of parts: part, body (tub or drum), mass_kg, x_mm, y_mm, z_mm, ixx_kgm2, ..., "
        "combined to tub and drum. In place of their masses and centre.",
        "CSV",
    )


def machine_new(
    name: Annotated[
        str, typer.Argument(help="Name of the new machine, or path of its file.", metavar="NAME")
    ],
    base: Annotated[
        str,
        typer.Option("--extends", help="Machine that the new one changes.", metavar="NAME|FILE"),
    ] = "reference",
    **chosen: Any,
) -> None:
    """Write a machine file: one that extends another machine, or one from a few numbers.

    Without numbers, the file has all numbers of the other machine as comments. With any of them
    (--tub-mass '40 kg' --springs 2) the machine stands alone: a commented file and its SDF, which
    run at once. What is not given is marked as an assumption.
    """
    path = _new_path(name)
    parts = chosen.pop("parts")
    given = {key: text for key, text in chosen.items() if text}
    if given or parts:
        if base != "reference":
            raise input_error("not allowed with numbers, which need no base", where="--extends")
        _write_first_machine(path, given, parts)
        return
    write_files({path: _template(path, base)}, replace=False, way_out=OTHER_NAME)
    say(f"{path} extends '{base}'. Edit it, then: wm-drake machine check {path}")


def _new_path(name: str) -> Path:
    """Return the path of a new machine file."""
    path = Path(name) if name.endswith((".yaml", ".yml")) else Path(f"{name}.yaml")
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", path.stem):
        raise input_error(
            f"'{path.stem}' is no name of a machine; letters, digits, '_' and '-' are allowed, and "
            "a letter first",
            where="machine new",
        )
    return path


def _write_first_machine(path: Path, given: dict[str, str], table: Path | None) -> None:
    """Write machine file and SDF of a machine from numbers."""
    from pydantic import ValidationError

    from wm_drake.parameters.first_machine import FirstMachine, FirstNumbers, read_parts
    from wm_drake.parameters.problems import problems_of

    both = sorted({"tub_mass", "drum_mass", "tub_centre"} & set(given)) if table else []
    if both:
        flag = f"--{both[0].replace('_', '-')}"
        raise input_error("not allowed with --parts, whose table has it", where=flag)
    try:
        numbers = FirstNumbers.model_validate(given)
    except ValidationError as error:
        raise InputError(
            replace(p, where=f"--{p.key.replace('_', '-')}", key="")
            for p in problems_of(error, FirstNumbers)
        ) from None
    parts = read_parts(existing_file(table, "--parts")) if table else {}
    machine, sdf = FirstMachine(path.stem, numbers, parts), path.with_suffix(".sdf")
    contents = {sdf: machine.sdf(), path: machine.yaml(str(path), sdf.name)}
    check_new([path], replace=False, way_out=OTHER_NAME)  # named before its SDF
    write_files(contents, replace=False, way_out=OTHER_NAME)
    say(
        f"{path} and {sdf} are a machine of their own; what you did not give is marked as an "
        f"assumption. Check it: wm-drake machine check {path}"
    )


def _template(path: Path, base: str) -> str:
    """Return the text of a machine file that extends a machine and changes nothing yet."""
    from wm_drake.parameters import load_machine
    from wm_drake.parameters.files import machine_path, machine_yaml, shipped_machines

    parameters = load_machine(base)
    extends = base
    if base not in shipped_machines():
        extends = os.path.relpath(machine_path(base).resolve(), path.parent.resolve())
    header_keys = {"name", "about", "model", "measured", "published"}
    lines = machine_yaml(parameters.model_copy(update={"sources": {}})).splitlines()
    comments, skipped = [], False
    for line in lines:
        if not line.startswith((" ", "-")):  # a key at the top
            skipped = line.split(":")[0] in header_keys
        if not skipped:
            comments.append(f"# {line}")
    return "\n".join(
        [
            f"# A machine of your own. It has every number of '{base}' that this file does not "
            "change.",
            "# To change a number, remove '# ' from its line and from the lines of the keys above",
            "# it that are less indented; write the new value with its unit. A list, a table and a",
            "# profile are replaced as a whole. 'null' in place of an element removes it.",
            f"# Check it: wm-drake machine check {path}",
            f"# Run it:   wm-drake spin --machine {path}",
            f"extends: {json.dumps(extends)}",
            f"name: {path.stem}",
            f"about: {json.dumps(f'changes to {base}')}",
            "",
            *comments,
            "",
        ]
    )
