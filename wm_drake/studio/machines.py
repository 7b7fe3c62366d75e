"""Machines that a page can open: the given one, those of a folder, and the shipped ones."""

from dataclasses import dataclass, field
from pathlib import Path

from wm_drake.errors import InputError, check_known, input_error
from wm_drake.live.machine import OpenMachine
from wm_drake.model.build import build_machine
from wm_drake.model.same_elements import check_same_elements
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, load_machine, shipped_machines
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.vary import ranges_in
from wm_drake.studio.turns import SharedValues

GIVEN = "given"
"""Identifier of the machine of the command line, if it is a file."""

MOST_OPEN = 16
"""Largest number of machines that are kept open."""

_SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True)
class Machines:
    """Machines that a page can open: the given one, those of the folder, and the shipped ones.

    Attributes:
        given: Name or path of the machine of the command line.
        folder: Folder for saved machine files.
        vary: Name or path of a vary file with the ends of its sliders; "" for the usual ones.
    """

    given: str
    folder: Path
    vary: str = ""
    _open: "SharedValues[OpenMachine]" = field(default_factory=lambda: SharedValues(MOST_OPEN))

    def listed(self) -> dict[str, str]:
        """Return the kind of each machine that can be opened, by identifier: given first."""
        saved = sorted(p.name for p in self.folder.glob("*") if p.suffix in _SUFFIXES)
        first = [] if self.given in shipped_machines() else [GIVEN]
        return {
            **dict.fromkeys(first, "given"),
            **dict.fromkeys((name for name in saved if (self.folder / name).is_file()), "saved"),
            **dict.fromkeys(shipped_machines(), "shipped"),
        }

    @property
    def first(self) -> str:
        """Identifier of the machine that a page opens first."""
        return self.given if self.given in shipped_machines() else GIVEN

    def name_or_path(self, identifier: str) -> str | Path:
        """Return what `load_machine` reads for an identifier."""
        listed = self.listed()
        check_known(identifier, listed, f"no machine '{identifier}'", key="machine")
        if identifier == GIVEN:
            return Path(self.given)
        return identifier if listed[identifier] == "shipped" else self.folder / identifier

    def open(self, identifier: str) -> "OpenMachine":
        """Return an open machine; a file that has changed is read again."""
        name = self.name_or_path(identifier)
        path = shipped_machines().get(str(name), Path(name))
        try:
            key = path.resolve(), path.stat().st_mtime_ns
        except OSError:
            raise input_error("this file is gone", where=identifier, key="machine") from None
        vary = self.vary if identifier == self.first else ""
        return self._open.get(key, lambda: self._opened(load_machine(name), vary))

    def _opened(self, parameters: MachineParameters, vary: str) -> "OpenMachine":
        """Return a machine, built anew only if no open one has the same elements."""
        checked_step(parameters, None)
        if vary:
            built = build_machine(parameters)
            return OpenMachine(parameters, built, Scene(parameters), ranges_in(built, vary))
        for other in self._open.ready():
            try:
                check_same_elements(other.machine.parameters, parameters)
            except InputError:
                continue
            if list(other.parameters.sensors) == list(parameters.sensors):
                scene = Scene(parameters)
                return OpenMachine(parameters, other.machine, scene, lock=other.lock)
        return OpenMachine(parameters, build_machine(parameters), Scene(parameters))
