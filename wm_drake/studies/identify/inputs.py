"""Input of fits to measured loops: loops, laws, bounds and fixed numbers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wm_drake.errors import InputError, Problem, check_known, input_error, nearest_names
from wm_drake.parameters import DAMPER_LAWS, MeasuredLoop, quantities, read_loops
from wm_drake.parameters.units import Share, Unit
from wm_drake.parameters.variation import range_of
from wm_drake.report.quantity import MASS, Quantity
from wm_drake.report.terminal import say
from wm_drake.rigs.measured import MeasuredMotion, inertia_share, measured_motion, without_inertia
from wm_drake.studies.components import Target, existing_files
from wm_drake.studies.fitting.methods import METHODS
from wm_drake.studies.identify.models import (
    FORCE,
    Given,
    fields_of_law,
    unit_of_field,
    units_of_fields,
)
from wm_drake.studies.identify.options import IdentifyOptions
from wm_drake.studies.inputs import LOOP_WORDS, channel_names, pairs_of, quantities_of
from wm_drake.studies.rig.study import FREQUENCY

PART = Quantity("part", Share(), form="{:.3g}".format)


def loops_of(files: Sequence[Path], options: IdentifyOptions) -> list[MeasuredLoop]:
    """Return the loops of files."""
    names, default = channel_names(options, LOOP_WORDS)
    if default:
        raise input_error(f"'{default}' is not NAME=UNIT", where="--unit")
    units = units_of(options.file_units)
    return read_loops(existing_files(files), replace(names, units={**units, **names.units}))


def motions_of(
    files: Sequence[Path], options: IdentifyOptions, *, rotates: bool, driven_mass: float = 0.0
) -> list[MeasuredMotion]:
    """Return the loops of files with the motion of each, sorted by motion.

    Args:
        rotates: Whether the loops must be of moments over angles.
        driven_mass: Mass at the driven end, whose inertia is taken out of the forces. [kg]
    """
    check_known(options.method, METHODS, f"no method '{options.method}'", where="--method")
    cutoff = None
    if options.cutoff is not None:
        cutoff = quantities_of(options.cutoff, FREQUENCY.unit, "--cutoff")[0]
        if not cutoff > 0.0:
            raise input_error(f"is {FREQUENCY.text(cutoff)}; allowed is > 0", where="--cutoff")
    loops = loops_of(files, options)
    if loops[0].rotates != rotates:
        holds, needs = ("angles and moments", "displacements and forces")[
            :: 1 if loops[0].rotates else -1
        ]
        raise input_error(f"holds {holds}, needs {needs} (or --arm)", where=loops[0].path)
    motions, problems = [], list[Problem]()
    for loop in loops:
        try:
            motions.append(measured_motion(loop, cutoff))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    motions.sort(key=lambda measured: measured.order)
    if driven_mass > 0.0:
        for motion in motions:
            inertia, share = inertia_share(motion, driven_mass)
            say(
                f"{motion.loop.name}: {MASS.text(driven_mass)} at the driven end take up to "
                f"{FORCE.reading(inertia, 3)}, {PART.text(share)} of the measured force; "
                "taken out.",
                err=True,
            )
        motions = [without_inertia(motion, driven_mass) for motion in motions]
    return motions


def units_of(text: str | None) -> dict[str, str]:
    """Return the units of time, displacement and force of the option `--file-units`, by word."""
    if text is None:
        return {}
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        raise input_error(
            f"'{text}' is not three units; write for example 's,mm,N'", where="--file-units"
        )
    return dict(zip(LOOP_WORDS, (parts[0], parts[1], parts[1], parts[2], parts[2]), strict=True))


def given_by_law(text: str, axis: str, options: IdentifyOptions) -> dict[str, Given]:
    """Return what the user gives for each law: of several laws, the numbers of its own fields.

    Args:
        text: Laws, separated by commas.
        axis: Axis of a bushing; "" for a damper.
        options: Options with bounds and fixed numbers.

    Raises:
        InputError: A law is unknown or there twice, or no law has a field.
    """
    laws = [part.strip() for part in text.split(",")]
    fields = {law: fields_of_law(law, axis) for law in laws}
    for law in laws:
        if laws.count(law) > 1:
            raise input_error(f"'{law}' is there twice", where="--law")
    bounds, fixed = _ranges(options.bounds), _fixed(options.fix)
    if len(laws) == 1:
        return {laws[0]: Given(bounds, fixed, options.knots)}
    known = sorted({name for names in fields.values() for name in names})
    for option, numbers in (("--bounds", bounds), ("--fix", fixed)):
        for name in numbers:
            if name.split(".")[0] not in known:
                raise input_error(
                    f"none of these laws has a number '{name}'{nearest_names(name, known)}",
                    where=option,
                )
    return {
        law: Given(
            {name: value for name, value in bounds.items() if name.split(".")[0] in names},
            {name: value for name, value in fixed.items() if name.split(".")[0] in names},
            options.knots,
        )
        for law, names in fields.items()
    }


def kept_fields(target: Target, law: str, given: Given) -> dict[str, float]:
    """Return the numbers of a component of the same law that are not unknown and have no bounds."""
    parameters = target.component.parameters
    if law not in DAMPER_LAWS or getattr(parameters, "law", None) != law:
        return {}
    free = {*DAMPER_LAWS[law].unknowns, *given.bounds}
    return {
        key: value for key, value, _ in quantities(parameters) if "." not in key and key not in free
    }


def _ranges(entries: Sequence[str]) -> dict[str, tuple[float, float]]:
    ranges = {}
    for key, text in pairs_of(entries, "--bounds"):
        unit, ends = _unit_of_field(key, "--bounds"), range_of(text)
        if ends is None:
            message = f"'{text}' is not a range; write for example '(50, 300) N/mm'"
            raise input_error(message, where="--bounds", key=key)
        low, high = (quantities_of(end, unit, "--bounds")[0] for end in ends)
        ranges[key] = (low, high)
    return ranges


def _fixed(entries: Sequence[str]) -> dict[str, float]:
    return {
        key: quantities_of(text, _unit_of_field(key, "--fix"), "--fix")[0]
        for key, text in pairs_of(entries, "--fix")
    }


def _unit_of_field(key: str, option: str) -> Unit:
    """Return the unit of a component's field, or of a rise of one of its tables."""
    unit = unit_of_field(key)
    if unit is None:
        raise input_error(
            f"unknown number '{key}'{nearest_names(key, units_of_fields())}", where=option
        )
    return unit
