"""Ports of a machine by name: a wrong name is refused with those that there are."""

from typing import NoReturn, TypeVar

from wm_drake.errors import input_error

Port = TypeVar("Port")

OF_OTHER_DRIVES = {
    "drum_acceleration": "it belongs to a drive that prescribes the speed",
    "drum_speed_reference": "it needs a drive with a motor, as in load_machine('motor')",
    "drum_torque": "it needs a drive with a motor, as in load_machine('motor')",
    "drum_friction_torque": "it needs a drive with a motor, as in load_machine('motor')",
    "tub_in_cabinet": "it needs a cabinet that moves",
    "feet_floor_force": "it needs a cabinet that moves",
}
"""Why a machine may lack a port."""


class Ports(dict[str, Port]):
    """Ports by name."""

    kind = "port"

    def __missing__(self, name: str) -> NoReturn:
        """Refuse a name that no port has.

        Raises:
            InputError: always; it lists the ports.
        """
        reason = f"; {OF_OTHER_DRIVES[name]}" if name in OF_OTHER_DRIVES else ""
        raise input_error(
            f"no {self.kind} '{name}'{reason}. The {self.kind}s are {', '.join(sorted(self))}"
        )


class Inputs(Ports[Port]):
    """Input ports by name."""

    kind = "input"


class Outputs(Ports[Port]):
    """Output ports by name."""

    kind = "output"
