"""Refusal of studies that stand on a fixed cabinet."""

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters


def check_fixed_cabinet(parameters: MachineParameters) -> None:
    """Raise InputError if the cabinet of a machine moves."""
    if parameters.cabinet_moves:
        raise input_error(
            f"the cabinet of machine '{parameters.name}' moves; modes and steady states are those "
            "of a machine on a fixed cabinet: set it to false",
            key="cabinet.moves",
        )
