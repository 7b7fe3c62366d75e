"""Wet loads in the compiled engine: bodies that follow the water that is left.

The masses are held over a step and follow the state from step to step. Water leaves within many
seconds, a step takes milliseconds.
"""

import functools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.packed import ARRAY, SCALAR, PackedLayout
from wm_drake.elements.state_map import StateMap, water_part
from wm_drake.elements.water import DRAINING, packed_water
from wm_drake.engines.compiled.mechanics import BODIES
from wm_drake.engines.compiled.packing import DrawnBodies, Layout, drawn_bodies, pack
from wm_drake.model.machine import Setup
from wm_drake.parameters import Load
from wm_drake.parameters.types import FloatArray

FIRST, BEHIND = BODIES.offsets["drum_moment_x"], BODIES.offsets["joint_damping"]
HARMONICS = BEHIND - FIRST
INVERSE_MASS = BODIES.offsets["inverse_mass"]

MASS = PackedLayout("MassNumbers", mass=SCALAR, harmonics=ARRAY(HARMONICS))
"""A mass [kg], and what it adds to the harmonics of the drum in `BODIES`."""


@law
def hold_masses(p, x, first, water):
    """Write the bodies with the water that is left.

    Args:
        p: Packed numbers, of which those of `BODIES` are written.
        x, first: Array with the share that is left of each wet mass, and index of the first.
        water: `Water`; nothing is done if it is None.
    """
    if water is None:
        return
    mass = p[water.dry]
    for i in range(len(water.masses)):
        mass = mass + x[first + i] * p[water.masses[i]]
    p[INVERSE_MASS] = 1.0 / mass
    for k in range(HARMONICS):
        value = p[water.dry + 1 + k]
        for i in range(len(water.masses)):
            value = value + x[first + i] * p[water.masses[i] + 1 + k]
        p[FIRST + k] = value


def pack_run(setup: Setup) -> tuple[FloatArray, Layout, FloatArray]:
    """Return the packed numbers of a run, their layout, and what is left of the water at its start.

    Raises:
        InputError: the machine has something that the compiled engine does not represent.
    """
    packed, layout = with_water(*pack(setup), setup.load, drawn_bodies(setup))
    return packed, layout, np.ones(len(setup.load.wet) if setup.load else 0)


def with_water(
    packed: FloatArray, layout: Layout, load: Load | None, drawn: DrawnBodies
) -> tuple[FloatArray, Layout]:
    """Return packed numbers and layout of a machine whose load dries.

    They are those given for a load that stays.

    Args:
        packed, layout: From `pack`, with all water in the load.
        load: The load.
        drawn: The bodies without the load, or with it.
    """
    if load is None or not load.wet:
        return packed, layout
    size, parts, structure = len(packed), list[FloatArray](), list[int]()
    draining, masses = list[int](), list[int]()

    def add(numbers: FloatArray, at: list[int]) -> None:
        at.append(size + sum(map(len, parts)))
        parts.append(numbers)

    mass, harmonics = 1.0 / packed[INVERSE_MASS], packed[FIRST:BEHIND].copy()
    for k, numbers in zip(load.wet, packed_water(load), strict=True):
        unbalance = load.unbalances[k]
        assert unbalance.water is not None  # it is wet
        of_water = unbalance.water.share * unbalance.mass
        change = of_water * _harmonics(drawn, unbalance.position())
        mass, harmonics = mass - of_water, harmonics - change
        add(MASS.pack(mass=of_water, harmonics=change), masses)
        add(numbers, draining)
        structure += DRAINING.structure(numbers)
    dry = list[int]()
    add(MASS.pack(mass=mass, harmonics=harmonics), dry)
    numbers = np.concatenate([packed, *parts])
    return numbers, _layout_with(layout, (tuple(draining), tuple(masses), dry[0]), tuple(structure))


def _harmonics(drawn: DrawnBodies, position: Sequence[float]) -> FloatArray:
    """Return what a unit mass at a place in D adds to the harmonics of the drum."""
    operator, rotation, origin = drawn.of_point_masses
    r = rotation @ np.array(position) - origin
    inertia = r @ r * np.eye(3) - np.outer(r, r)
    six = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return np.asarray(operator @ np.concatenate([r, six]))


@functools.lru_cache(maxsize=64)  # loads of a study have the same shape
def _layout_with(
    layout: Layout, water: tuple[tuple[int, ...], tuple[int, ...], int], structure: tuple[int, ...]
) -> Layout:
    """Return a layout with wet masses; arguments as the fields of `Layout`."""
    states = StateMap.of([*layout.states.parts, water_part(len(water[0]))])
    structure = (*layout.structure, *structure)
    return replace(layout, water=water, states=states, structure=structure)
