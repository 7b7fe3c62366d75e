"""Water in a mass of laundry: packed numbers, and the rate of what is left.

The share of the water that is left is a state of the machine. Drake's diagram, the compiled engine
and the records read it from here.
"""

from collections import namedtuple

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.packed import SCALAR, PackedLayout
from wm_drake.laws.table import CURVE, pack_table, stiffness_force
from wm_drake.laws.water import draining_rate
from wm_drake.parameters import Load
from wm_drake.parameters.monotone import monotone_cubics
from wm_drake.parameters.types import FloatArray

DRAINING = PackedLayout("DrainingNumbers", time_constant=SCALAR, lasting=CURVE)
"""Time constant [s], and the share that lasts over the size of the drum's rate [rad/s]."""
read_draining = DRAINING.read

Water = namedtuple("Water", ("draining", "masses", "dry"))
"""Wet masses of a load, for compiled functions.

draining: index of the `DRAINING` of each; masses: index of the numbers of each that the bodies
follow from (`wm_drake.engines.compiled.water`); dry: index of those of all that does not dry.
"""


@law
def rate_of_water(left, drum_rate, p, at):
    """Return the rate of the share of water that is left. [1/s]

    Args:
        left: The share.
        drum_rate: Rate of the drum against the tub. [rad/s]
        p, at: Array that holds the numbers of `DRAINING`, and where they begin.
    """
    numbers = read_draining(p, at)
    lasting = stiffness_force(abs(drum_rate), *numbers.lasting)
    return draining_rate(left, lasting, numbers.time_constant)


@law
def write_water_rates(x, dx, drum_rate, p, water, first):
    """Write the rates of the shares of water that are left.

    Args:
        x, dx: State and its time derivative.
        drum_rate: Rate of the drum against the tub. [rad/s]
        p: Packed numbers.
        water: `Water`; None for a load that stays.
        first: Index in the state of the first share.
    """
    if water is not None:
        for i in range(len(water.draining)):
            dx[first + i] = rate_of_water(x[first + i], drum_rate, p, water.draining[i])


def packed_water(load: Load) -> list[FloatArray]:
    """Return the numbers of `DRAINING` of each wet mass of a load."""
    packed = []
    for k in load.wet:
        water = load.unbalances[k].water
        assert water is not None  # it is wet
        speed, left = np.array(water.speed), np.array(water.left)
        cubics = monotone_cubics(speed, left[:, None])[:, :, 0]
        lasting = pack_table(speed, cubics, 0.0)
        packed.append(DRAINING.pack(time_constant=water.time_constant, lasting=lasting))
    return packed
