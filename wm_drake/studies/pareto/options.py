"""Options of the design study, and its declaration."""

from pathlib import Path
from typing import TYPE_CHECKING

from wm_drake.studies.study import PROFILE, SEED, Options, Study, Task, option

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.model.machine import Machine


class DesignOptions(Options):
    """Options of the design study."""

    file: str = option(
        "gasket", "Shipped design file (gasket), or a YAML file.", "NAME|FILE", "argument"
    )
    evaluations: int = option(2000, "Number of designs to evaluate.", "N", ge=4)
    population: int = option(64, "Designs of a generation.", "N", ge=4)
    search: str = option(
        "genetic",
        "genetic: NSGA-II, or NSGA-III for more than two objectives. surfaces: NSGA on response "
        "surfaces of the designs so far, which needs fewer designs.",
        "NAME",
    )
    profile: Path | None = PROFILE
    seed: int = SEED


def _begin(options: DesignOptions, machine: "Machine") -> Task:
    from wm_drake.studies.pareto.task import DesignTask

    return DesignTask(options, machine)


DESIGN = Study(
    "design",
    "Find the designs of which no other is better in every objective.",
    DesignOptions,
    _begin,
    quick={"evaluations": 48, "population": 16},
)
