"""One machine by itself: packed numbers, its struts side by side, and memory to integrate in."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from wm_drake.compiler.lanes import QUAD
from wm_drake.engines.compiled.integration import derivative_alone, integrate_alone
from wm_drake.engines.compiled.mechanics import LINE_SIZE, STATE_SIZE, Elements
from wm_drake.engines.compiled.packing import aligned, pack
from wm_drake.engines.schedule import Schedule
from wm_drake.model.machine import Setup
from wm_drake.parameters.types import FloatArray


class Alone:
    """A machine as it is set up, which no other runs beside.

    Attributes:
        p, layout: Packed numbers, from `pack`.
    """

    def __init__(self, setup: Setup) -> None:
        """Packs a machine.

        Raises:
            InputError: it has something that the compiled engine does not represent.
        """
        self.p, self.layout = pack(setup)
        self._struts, self._elements = struts_side_by_side(setup, self.layout.elements)
        self._scratch = aligned(QUAD * LINE_SIZE * max(1, len(self._elements.dampers)))

    def derivative(self, x: FloatArray, acceleration: float) -> FloatArray:
        """Derivative of a state (size,) at an acceleration of the drum [rad/s^2], for integrators of others."""
        padded = np.append(x, np.zeros(QUAD))
        dx = np.empty_like(padded)
        derivative_alone(
            padded, dx, acceleration, self.p, self._struts, self._elements, self._scratch
        )
        return dx[: len(x)]

    def integrate(
        self, schedule: Schedule, begin: int, end: int, x: FloatArray, samples: FloatArray
    ) -> None:
        """Steps a state from the begin of one step of a schedule to that of another.

        Args:
            schedule: The steps.
            begin, end: Numbers of steps.
            x: State (size,), which is advanced.
            samples: (rows, size + `Layout.rates_size`) states and accelerations; those on the way are written.
        """
        work = (*(aligned(len(x) + QUAD) for _ in range(3)), self._scratch)
        numbers = self.p, self._struts, self._elements
        integrate_alone(schedule.steps, begin, end, *numbers, x, work, samples.reshape(-1))


def struts_side_by_side(setup: Setup, elements: Elements) -> tuple[FloatArray, Elements]:
    """Springs and dampers of one machine once more, neighbours of one structure together in lanes.

    Returns:
        Their packed numbers as an array of quads, before each group the weights that `kernel.side_by_side` speaks of; and where
        things begin with these in place of those of `pack`.
    """
    springs, dampers = (
        list(_alike(list(struts.values()))) for struts in (setup.springs, setup.dampers)
    )
    groups = [*springs, *dampers]
    sizes = [1 + len(group[0].packed()) for group in groups]
    begins = np.cumsum([1, *sizes])[:-1]  # behind the weights
    struts = aligned(QUAD * sum(sizes))
    struts[:] = np.concatenate([_in_lanes(group) for group in groups]) if groups else 0.0
    deformations = STATE_SIZE + np.cumsum([0, *map(len, dampers)])[:-1]
    return struts, elements._replace(
        springs=begins[: len(springs)], dampers=begins[len(springs) :], deformations=deformations
    )


def _alike(struts: list[Any]) -> Iterator[list[Any]]:
    """Neighbours of one structure, up to `QUAD` at a time."""
    for _, neighbours in itertools.groupby(struts, key=lambda strut: strut.structure):
        group = list(neighbours)
        yield from (group[begin : begin + QUAD] for begin in range(0, len(group), QUAD))


def _in_lanes(group: list[Any]) -> FloatArray:
    """Weights and packed numbers of a group of struts, each number of all of them together. (flat)"""
    idle = QUAD - len(group)
    rows = [strut.packed() for strut in group]
    weights = np.repeat([1.0, 0.0], [len(group), idle])
    return np.concatenate([weights, np.column_stack([*rows, *rows[-1:] * idle]).ravel()])
