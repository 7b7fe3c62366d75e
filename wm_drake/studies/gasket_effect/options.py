"""Options of the study of the gasket's effect, and its declaration."""

from pathlib import Path
from typing import TYPE_CHECKING

from wm_drake.studies.study import MEASURED, PROFILE, Options, Study, Task, option

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.model.machine import Machine


class GasketEffectOptions(Options):
    """Options of the study of the gasket's effect."""

    load: tuple[str, ...] = option(
        (),
        "Load of the machine, or load file. Repeatable. Default: middle and counter, or all loads "
        "of a machine without them.",
        "NAME|FILE",
    )
    profile: Path | None = PROFILE
    measured: tuple[Path, ...] = MEASURED


def _begin(options: GasketEffectOptions, machine: "Machine") -> Task:
    from wm_drake.studies.gasket_effect.study import GasketEffectTask

    return GasketEffectTask(options, machine)


GASKET_EFFECT = Study(
    "gasket-effect",
    "Compare runs without and with the gasket: envelopes, amplitudes and the steady state.",
    GasketEffectOptions,
    _begin,
    quick={"load": ("middle",)},
    has_runs=False,
)
