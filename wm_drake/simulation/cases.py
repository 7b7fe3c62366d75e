"""The case: one run to make."""

import warnings
from dataclasses import dataclass

from wm_drake.errors import InputNotice, check_known
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.damper_laws import DamperNumbers

UNUSED_PHASE_ERROR = (
    "imperfections.phase_error has no effect on the loads of a machine, only on the front and rear "
    "masses of spin-cycle cases. To shift a mass of a load, change its phase."
)
"""Warning about a machine whose phase error a study of its loads does not use."""

JUMPING_FRICTION = (
    "Coulomb friction jumps where a damper reverses. Amplitudes of the compiled engine were 5 to "
    "80 % off in tests (docs/theory/integrator.md); the law mstv does not jump."
)
"""Notice about a machine whose dampers have friction that no fixed step resolves."""


@dataclass(frozen=True)
class Case:
    """One run to make.

    Attributes:
        name: Label of the run in records, tables and messages.
        load: Point masses in the drum.
        profile: Drum speed over time.
        gasket: False removes the gasket from the machine.
        parameters: Parameters of the machine in this run; those of the built machine if None.

    Example:
        >>> import wm_drake as wm
        >>> parameters = wm.load_machine("reference")
        >>> case = wm.Case("mine", parameters.loads["middle"], parameters.profile, gasket=False)
        >>> case.name, case.gasket
        ('mine', False)
    """

    name: str
    load: Load
    profile: SpinProfile
    gasket: bool = True
    parameters: MachineParameters | None = None


def is_as_measured(parameters: MachineParameters, case: Case) -> bool:
    """Return whether a case has numbers, load and spin profile of a machine file.

    Only such a case may be compared with what the machine file says was measured or published.
    """
    return (
        case.parameters in (None, parameters)
        and case.load == parameters.loads.get(case.name)
        and case.profile == parameters.profile
    )


def load_of(case: Case, machine: MachineParameters, changed: MachineParameters) -> Load:
    """Return the load of a case for a changed machine.

    A change may be a mass of one of the machine's own loads.
    """
    is_of_machine = machine.loads.get(case.name) == case.load
    return changed.loads[case.name] if is_of_machine else case.load


def case_of(parameters: MachineParameters, load: str, *, gasket: bool = True) -> Case:
    """Return the case that runs one of a machine's loads over the machine's own profile.

    The case has the numbers of these parameters, whatever machine it is given to.

    Args:
        parameters: Machine that defines load, profile and numbers.
        load: Name of the load.
        gasket: False removes the gasket from the machine.

    Raises:
        InputError: the machine has no load of this name.

    Example:
        >>> import wm_drake as wm
        >>> wm.case_of(wm.load_machine("reference"), "counter", gasket=False).name
        'counter'
    """
    message = f"no load '{load}' in machine '{parameters.name}'"
    check_known(load, parameters.loads, message, key="loads")
    return Case(load, parameters.loads[load], parameters.profile, gasket, parameters)


def has_jumping_friction(parameters: MachineParameters) -> bool:
    """Return whether a damper of a machine has friction that no fixed step resolves."""
    types = {damper.type for damper in parameters.dampers.values()}
    types |= {damper.type for damper in parameters.telescopic_dampers.values()}
    return any(_jumps(parameters.damper_types[name]) for name in types)


def _jumps(damper: DamperNumbers) -> bool:
    """Return whether the friction of a damper jumps: by its law, or in a transition of no width."""
    return damper.law == "coulomb" or getattr(damper, "transition_velocity", None) == 0.0


def notice_jumping_friction(parameters: MachineParameters) -> None:
    """Issue an `InputNotice` if a damper of a machine has friction that no fixed step resolves.

    All cases of a built machine have the same damper laws.
    """
    if has_jumping_friction(parameters):
        warnings.warn(JUMPING_FRICTION, InputNotice, stacklevel=3)
