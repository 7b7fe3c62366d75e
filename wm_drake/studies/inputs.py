"""Input of studies and commands: machines with changed numbers, cases, files, built machines."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wm_drake.errors import (
    InputError,
    Problem,
    check_known,
    input_error,
    nearest_names,
    problems_at,
    shortened,
)

DRIVES = ("prescribed", "motor")
"""Drives of the option `--drive`."""

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.model.machine import Machine
    from wm_drake.parameters import MachineParameters, SpinProfile
    from wm_drake.parameters.keys import Tree
    from wm_drake.parameters.recorded import ChannelNames
    from wm_drake.parameters.units import Unit
    from wm_drake.simulation.cases import Case


@contextmanager
def located_in(file: str) -> Iterator[None]:
    """Add file and line of a machine file to the problems that the block raises."""
    from wm_drake.parameters import located, machine_path

    try:
        yield
    except InputError as error:
        raise located(error, machine_path(file)) from None


@contextmanager
def problems_of_file(path: Path) -> Iterator[None]:
    """Add the path of a file to the problems that the block raises."""
    try:
        yield
    except InputError as error:
        raise InputError(
            Problem(": ".join(filter(None, [str(path), p.where])), p.key, p.message)
            for p in error.problems
        ) from None


def profile_of(parameters: "MachineParameters", path: Path | None) -> "SpinProfile":
    """Return the spin profile of the option `--profile`; that of the machine without it."""
    if path is None:
        return parameters.profile
    return runnable_profile(path, parameters)


def runnable_profile(name_or_path: str | Path, parameters: "MachineParameters") -> "SpinProfile":
    """Return a spin profile, after checking that a run of a machine has a place in memory."""
    from wm_drake.engines.memory import check_size
    from wm_drake.parameters import load_profile

    profile = load_profile(name_or_path)
    with problems_of_file(Path(name_or_path)):
        check_size(profile, parameters.step, profile.sample_period(parameters.output_period))
    return profile


def load_parameters(
    file: str,
    sets: Sequence[str] | None,
    change: "Callable[[MachineParameters], MachineParameters]" = lambda machine: machine,
) -> "MachineParameters":
    """Return the machine of a file or a shipped name, changed by the `--set` options.

    Args:
        file: Name or path.
        sets: Changes of numbers.
        change: Change of the machine before them.
    """
    from wm_drake.parameters import load_machine

    return changed_parameters(change(load_machine(file)), sets)


def changed_parameters(
    parameters: "MachineParameters", sets: Sequence[str] | None
) -> "MachineParameters":
    """Return parameters with the changes of `--set`."""
    changed, sources = with_sets(parameters, parameters.sources, sets)
    return changed.model_copy(update={"sources": sources})


def with_sets(
    parameters: "Tree", sources: Mapping[str, str], sets: Sequence[str] | None
) -> "tuple[Tree, dict[str, str]]":
    """Return parameters and the sources of their numbers, changed by the `--set` options.

    All changes are applied before the result is checked, so their order does not matter: two
    numbers may need each other. Of two values of one key the last one counts.
    """
    from wm_drake.parameters import with_values
    from wm_drake.parameters.keys import is_index

    changes: dict[str, Any] = {}
    for name, text in pairs_of(sets, "--set"):
        if _RELATIVE.match(text) or is_index(name.rpartition(".")[2]):
            parameters = _with_sdf_number(parameters, name)
        for key, value in _set(parameters, name, text).items():
            changes.pop(key, None)
            changes[key] = value
    if not changes:
        return parameters, dict(sources)
    with problems_at("--set"):
        changed = with_values(parameters, changes)
    return changed, {**sources, **dict.fromkeys(changes, "set on the command line")}


def _set(parameters: "Tree", name: str, text: str) -> dict[str, Any]:
    """Return the values by key that an option `--set NAME=TEXT` sets.

    The name is a key path, or a symbol of [B] such as C_L, whose numbers change together. The text
    is a value, or relative to the machine: percents of its number, or nominal + a distance.
    """
    from wm_drake.parameters import MachineParameters
    from wm_drake.parameters.variation import Change, change_of, common_form, number_at
    from wm_drake.parameters.vary_file import gasket_entries

    if not isinstance(parameters, MachineParameters):
        return {name: _value(text)}
    entry = None if "." in name else gasket_entries().get(name)
    with problems_at("--set", name):
        if entry is None and not _RELATIVE.match(text):
            return {name: _value(text)}
        keys = entry.keys if entry else (name,)
        numbers = [number_at(parameters, key) for key in keys]
        change, _ = change_of(text, numbers[0].unit, name)
        if change is Change.VALUE:  # in place of a table too; percents of a share are values
            return dict.fromkeys(keys, text)
        change, values = common_form(numbers, {name: text})
    return {number.key: number.changed(change, values[name]) for number in numbers}


_RELATIVE = re.compile(r"\s*nominal\b|[^(]*%\s*$")


def _value(text: str) -> str | None:
    return None if text in ("null", "~") else text


def _with_sdf_number(parameters: Any, key: str) -> Any:
    """Return a machine with the numbers at a key path that only its SDF may have."""
    from wm_drake.parameters import MachineParameters

    if not key.startswith(("bodies.", "frames.")) or not isinstance(parameters, MachineParameters):
        return parameters
    from wm_drake.model.bodies import with_sdf_values
    from wm_drake.model.drawn_machine import DrawnMachine

    return with_sdf_values(DrawnMachine(parameters).plant, parameters, [key])


def pairs_of(entries: Sequence[str] | None, option: str) -> list[tuple[str, str]]:
    """Return the keys and values of a repeatable option KEY=VALUE."""
    pairs = []
    for entry in entries or []:
        key, separator, text = entry.partition("=")
        if not separator:
            raise input_error(f"'{entry}' does not have the form KEY=VALUE", where=option)
        pairs.append((key.strip(), text.strip()))
    return pairs


def machine_warnings(parameters: "MachineParameters", profile: Path | None = None) -> list[str]:
    """Return warnings of what a machine has and runs do not use, and of a band that cuts them.

    Args:
        profile: File of the option `--profile`.
    """
    from wm_drake.simulation.band import band_warnings
    from wm_drake.simulation.cases import UNUSED_PHASE_ERROR

    unused = [UNUSED_PHASE_ERROR] if parameters.imperfections.phase_error else []
    chosen = profile_of(parameters, profile)
    return [*unused, *band_warnings(chosen)]


def friction_warnings(parameters: "MachineParameters") -> list[str]:
    """Return the warning of friction that no fixed step resolves; runs print it as a notice."""
    from wm_drake.simulation.cases import JUMPING_FRICTION, has_jumping_friction

    return [JUMPING_FRICTION] if has_jumping_friction(parameters) else []


def selected_cases(
    parameters: "MachineParameters", loads: Sequence[str] | None, gasket: bool, profile: Path | None
) -> "list[Case]":
    """Return the cases that `--load`, `--no-gasket` and `--profile` select."""
    from wm_drake.parameters import load_load
    from wm_drake.parameters.text_files import is_file
    from wm_drake.simulation.cases import Case

    spin_profile = profile_of(parameters, profile)
    cases = []
    for name in loads or list(parameters.loads):
        if name in parameters.loads:
            cases.append(Case(name, parameters.loads[name], spin_profile, gasket))
        elif is_file(Path(name)):
            cases.append(Case(Path(name).stem, load_load(Path(name)), spin_profile, gasket))
        else:
            hint = nearest_names(name, parameters.loads)
            raise input_error(
                f"'{name}' is neither a load of machine '{parameters.name}' nor a file{hint}",
                where="--load",
            )
    names = [case.name for case in cases]
    for name in names:
        if names.count(name) > 1:
            raise input_error(
                f"'{name}' is given twice, but file record_{name}.nc can hold only one run",
                where="--load",
            )
    return cases


def with_measured(
    parameters: "MachineParameters", files: Sequence[Path] | None, option: str
) -> "MachineParameters":
    """Return the machine with other files of measured amplitudes, if any are given."""
    if not files:
        return parameters
    paths = tuple(str(existing_file(path, option).resolve()) for path in files)
    return parameters.model_copy(update={"measured": paths})


def existing_file(path: Path, option: str) -> Path:
    """Return the path if it is a file; otherwise raise an InputError for the option."""
    from wm_drake.parameters.text_files import is_file

    if not is_file(path):
        raise input_error(f"no such file '{path}'", where=option)
    return path


def build_checked(file: str, parameters: "MachineParameters", *, batch: bool = True) -> "Machine":
    """Return the built machine, after the checks of `built_with_problems`, to run it.

    Args:
        batch: Whether it makes many runs whose samples are not kept.
    """
    from wm_drake.simulation.first_call import compile_in_two_processes

    compile_in_two_processes(parameters, batch=batch)
    return built_with_problems(file, parameters)[0]


def built_with_problems(
    file: str, parameters: "MachineParameters"
) -> "tuple[Machine, tuple[Problem, ...]]":
    """Return the built machine, and what is legal but unusual in it, with file and line."""
    from wm_drake.engines.compiled.packing import pack
    from wm_drake.engines.compiled.stepping import choose_stepping
    from wm_drake.engines.memory import check_size
    from wm_drake.model.build import build_machine
    from wm_drake.model.expectations import unexpected, unusual_values
    from wm_drake.model.scene import Scene
    from wm_drake.parameters import located, machine_path, measured_amplitudes, published_results
    from wm_drake.parameters.files import check_tables
    from wm_drake.simulation.steps import checked_step

    with located_in(file):
        check_tables(parameters)
        measured_amplitudes(parameters)
        published_results(parameters.published)
        step = checked_step(parameters, None)
        period = parameters.profile.sample_period(parameters.output_period)
        check_size(parameters.profile, step, period)
        machine = build_machine(parameters)
        setup = machine.set_up()
        choose_stepping(setup, *pack(setup), parameters.profile, step, parameters.integrator)
        scene = Scene(parameters)
    unusual = [*unusual_values(setup), *unexpected(setup, scene)]
    problems = located(InputError(unusual), machine_path(file)).problems if unusual else ()
    return machine, problems


def with_drive(parameters: "MachineParameters", drive: str | None) -> "MachineParameters":
    """Return a machine with the drive of the option `--drive`, with the sources of its numbers."""
    from wm_drake.parameters import Drive, load_machine, with_value
    from wm_drake.parameters.drive import motor_of

    if drive is None or drive == parameters.drive.kind:
        return parameters
    check_known(drive, DRIVES, f"no drive '{drive}'", where="--drive")
    joint, others = parameters.drive.joint, dict(parameters.sources)
    if drive == "prescribed":
        return with_value(parameters, "drive", Drive(joint=joint))
    shipped = load_machine("motor")
    motor = motor_of(shipped.drive)
    assert motor  # that is what this machine is for
    sources = {key: text for key, text in shipped.sources.items() if key.startswith("drive")}
    changed = with_value(parameters, "drive", motor.model_copy(update={"joint": joint}))
    return changed.model_copy(update={"sources": others | sources})


def quantities_of(text: str, unit: "Unit", option: str) -> tuple[float, ...]:
    """Return numbers with one unit, ``(1, 3, 5) mm`` or ``1,3,5 mm``, in SI."""
    from wm_drake.parameters.units import LONGEST_NUMBER, convert, plain_number

    body = text.strip()
    if len(body) > LONGEST_NUMBER:
        message = f"has {len(body)} characters; allowed are up to {LONGEST_NUMBER}"
        raise input_error(message, where=option)
    if not body.startswith("("):
        size = len(_digits(body))
        body = f"({body[:size]}) {body[size:]}"
    numbers, _, written = body[1:].partition(")")
    try:
        values = [plain_number(part) for part in numbers.split(",")]
    except ValueError:
        raise input_error(
            f"'{text}' is not a number with a unit; write for example '1 {unit.shown}'",
            where=option,
        ) from None
    try:
        return tuple(convert(value, written.strip() or None, unit) for value in values)
    except ValueError as error:
        raise input_error(f"'{text}': {error}", where=option) from None


def _digits(text: str) -> str:
    """Return the leading numbers of a text, with the commas between them."""
    number = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
    match = re.match(rf"[\s,]*+(?:{number}[\s,]*+)*+", text.strip())
    return match[0] if match else ""


LOOP_WORDS = ("time", "displacement", "angle", "force", "moment")
"""Words of a force loop, for `channels_of`."""


def channel_names(options: Any, words: tuple[str, ...] = ()) -> "tuple[ChannelNames, str]":
    """Return what the options `--channels` and `--unit` say of recorded channels.

    Args:
        options: Options with `channels` and `unit`.
        words: Allowed words of `--channels`; any word if empty.

    Returns:
        Names and units by channel, and the unit of all channels that have no other; "" if none.

    Raises:
        InputError: a part has another form, or a word is not allowed or there twice.
    """
    from wm_drake.parameters.recorded import ChannelNames
    from wm_drake.parameters.units import is_unit

    units, default = dict[str, str](), ""
    for entry in options.unit:
        name, equals, unit = (part.strip() for part in entry.rpartition("="))
        if not unit or (equals and not name) or (default and not equals):
            raise input_error(f"'{entry}' is not NAME=UNIT", where="--unit")
        if not is_unit(unit):
            raise input_error(
                f"unit '{shortened(unit, 40)}' is not known; write for example 'Acc 1=g'",
                where="--unit",
            )
        if equals:
            units[name] = unit
        else:
            default = unit
    return ChannelNames(channels_of(options.channels, words), units, words), default


def channels_of(text: str | None, words: tuple[str, ...] = ()) -> dict[str, str]:
    """Return the names of the channels of the option `--channels`, by word.

    A comma within a name is part of it.

    Args:
        words: Allowed words; any word if empty.

    Raises:
        InputError: a part is not WORD=NAME, a word is not allowed or there twice.
    """
    channels: dict[str, str] = {}
    for part in re.split(r",(?=[^,=]+=)", text) if text else []:
        word, separator, name = (piece.strip() for piece in part.partition("="))
        if not (separator and name and word):
            raise input_error(f"'{part.strip()}' is not WORD=NAME", where="--channels")
        if words:
            check_known(word, words, f"no word '{word}'", where="--channels")
        if word in channels:
            raise input_error(f"'{word}' is there twice", where="--channels")
        channels[word] = name
    return channels
