"""Machines with a motor for tests: an isotropic one with closed forms, and the shipped one."""

from simple_machines import isotropic_machine

from wm_drake.parameters import MotorDrive, load_machine

SHIPPED = load_machine("motor").drive


def isotropic_motor(**changes):
    """Return an isotropic machine with the shipped motor, and changes of the drive's numbers."""
    tree = SHIPPED.model_dump() | {"rotor_inertia": 0.0, "bearing_friction": {}} | changes
    drive = MotorDrive.model_validate(tree)
    return isotropic_machine().model_copy(update={"drive": drive})
