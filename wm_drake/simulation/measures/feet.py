"""Loads of the feet, and margins against lift-off, sliding, turning and tilting of the cabinet."""

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.units import Unit
from wm_drake.simulation.feet import BY_FOOT, MARGINS
from wm_drake.simulation.measures.kind import Evaluate, Measure, Variable, each_run

_FORCE, _MOMENT = Unit("N", "N"), Unit("N*m", "N*m")

_LOADS = {
    "foot_normal_smallest": "smallest normal load of each foot",
    "foot_normal_largest": "largest normal load of each foot",
    "foot_tangential_largest": "largest horizontal load of each foot",
}

_MARGINS = {
    "smallest_foot_load": (
        _FORCE,
        "smallest normal load of any foot; 0 if one lifts off",
    ),
    "slide_margin": (
        _FORCE,
        "horizontal force that friction can still take; the cabinet slides below 0",
    ),
    "turn_margin": (
        _MOMENT,
        "vertical moment that friction can still take beside the horizontal force; the cabinet "
        "turns below 0",
    ),
    "tilt_margin": (
        _MOMENT,
        "moment that keeps the cabinet from tipping over; it tips below 0",
    ),
}
"""Unit and words of each margin."""


def _words(name: str) -> str:
    return name.replace("_", " ")


def _evaluate(names: tuple[str, ...]) -> Evaluate:
    return each_run(lambda run: [run.foot_measures[name] for name in names])


def _has_cabinet(machine: MachineParameters) -> bool:
    return machine.cabinet is not None


FEET = Measure(
    "feet",
    (
        *(
            Variable(
                name,
                ("foot",),
                _FORCE,
                _words(name),
                _LOADS[name],
                better="smaller" if name.endswith("largest") else "larger",
                is_in_spin=False,
                studio=None,
            )
            for name in BY_FOOT
        ),
        *(
            Variable(
                name,
                (),
                unit,
                _words(name),
                about,
                better="larger",
                studio=None,
            )
            for name, (unit, about) in _MARGINS.items()
        ),
    ),
    _evaluate((*BY_FOOT, *MARGINS)),
    ("feet",),
    has_table=False,
    applies=_has_cabinet,
)

IN_REGIONS = Measure(
    "feet regions",
    tuple(
        Variable(
            f"region_{name}",
            ("region",),
            unit,
            _words(name),
            f"{about}; smallest in each region",
            better="larger",
            studio=None,
        )
        for name, (unit, about) in _MARGINS.items()
    ),
    _evaluate(tuple(f"region_{name}" for name in MARGINS)),
    ("feet",),
    has_table=False,
    applies=_has_cabinet,
)
