"""Compiled functions of a machine in a web page: they set it up, run it and measure the run.

As in `wm_drake.export.kernel`, all numbers of an instance are in one array v, and what does not
change in a second array c. Only the equilibrium (`page_statics`) and the search for the smallest
gap (`page_gap`) have functions of their own; the run is that of a batch (`page_run`).
"""

import json
from collections.abc import Sequence
from typing import Any

from numba import cfunc, types

from wm_drake.compiler.kept import all_sources, kept
from wm_drake.elements.motion import tub_motion
from wm_drake.elements.sensor import POINT_SIZE, displacement_at
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.export.kernel import (
    HARMONICS_BEGIN,
    HARMONICS_SIZE,
    OPTIONS,
    POINTER,
    load_adder,
    numbers_at,
    row_writer,
)
from wm_drake.export.page_gap import gap_finder
from wm_drake.export.page_run import force_binner, integrator, measurer, mount_measurer, smoother
from wm_drake.export.page_statics import (
    body_changer,
    foot_loader,
    settler,
    strut_placer,
    taut_setter,
)


def _set_up(plan: Any) -> Any:
    """Return the function (v, c) that packs all numbers and puts the machine to rest.

    It returns 0, or why there is no equilibrium.
    """
    at, of, count = plan.at, plan.of, plan.count
    settles, size = plan.settles, plan.elements.begins.size
    write_rows, add_load = row_writer(plan), load_adder(plan)
    add_bodies, set_taut = body_changer(plan), taut_setter(plan)
    place_struts, settle = strut_placer(plan, set_taut), settler(plan, set_taut)
    load_feet, stands = foot_loader(plan), settles and plan.elements.cabinet is not None

    @cfunc(types.float64(POINTER, POINTER), **OPTIONS)
    def wm_set_up(v, c):
        numbers, constants, p = numbers_at(v, 0), numbers_at(c, 0), numbers_at(v, at.packed)
        state, rest = numbers_at(v, at.state), numbers_at(v, at.rest)
        write_rows(v, c)
        add_bodies(v, c)
        place_struts(v)
        for k in range(size):
            state[k] = constants[of.initial + k]
        for k in range(6):
            rest[k] = state[k]
        status = 0.0
        if settles:
            status = settle(v)
        for k in range(6):
            state[k] = rest[k]
        state[DRUM_RATE] = 0.0
        motion = tub_motion(state)
        if stands:
            load_feet(v, motion)
        for k in range(count.points):
            point = count.numbers + count.springs + POINT_SIZE * k
            p[point + POINT_SIZE - 1] = 0.0
            p[point + POINT_SIZE - 1] = displacement_at(motion, p, point)
        state[DRUM_RATE] = numbers[at.speed]
        add_load(v, c)
        for k in range(HARMONICS_SIZE):
            p[HARMONICS_BEGIN + k] = p[HARMONICS_BEGIN + k] + numbers[at.of_load + k]
        return status

    return wm_set_up


FUNCTIONS = {
    "wm_set_up": _set_up,
    "wm_bin_forces": force_binner,
    "wm_integrate": integrator,
    "wm_measure": measurer,
    "wm_measure_mounts": mount_measurer,
    "wm_smooth": smoother,
    "wm_find_gap": gap_finder,
}
"""What makes each compiled function of a plan, by its name. `wm_bin_forces` comes early: it has
laws of `wm_set_up`, which another process then finds on disk."""
FIRST = ("wm_set_up",)
"""What an export runs; unlike the others, it depends on how many numbers may change in the page."""
AFTERWARDS = ("wm_find_gap",)
"""What the same process compiles after it."""
MEANWHILE = tuple(name for name in FUNCTIONS if name not in FIRST + AFTERWARDS)
"""What a second process compiles meanwhile: half of the work."""


def page_code(plan: Any, names: Sequence[str]) -> dict[str, str]:
    """Return LLVM's text of functions of a page, from the files of compiled code if kept."""

    def compiled() -> bytes:
        code = {name: FUNCTIONS[name](plan).inspect_llvm() for name in names}
        return json.dumps(code).encode()

    key = f"{names} by {all_sources()} of {plan!r}"
    return dict(json.loads(kept(key, compiled)))
