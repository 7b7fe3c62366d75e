"""Options of the study of a cycle, and its declaration."""

from wm_drake.studies.study import Options, Study, imported, option


class CycleOptions(Options):
    """Options of the study of a cycle."""

    load: str = option(
        "",
        "Load of the machine, or load file. Default: the shipped load of wet laundry, which dries.",
        "NAME|FILE",
    )
    profile: str = option(
        "household",
        "Name of a shipped profile (household, spin_cycle, run_up, ifb_9kg), or file.",
        "NAME|FILE",
    )


CYCLE = Study(
    "cycle",
    "Run a whole cycle with a load that dries: unbalance, speed, swing, gap, floor forces.",
    CycleOptions,
    imported("wm_drake.studies.cycle.task:CycleTask"),
    quick={"profile": "run_up"},
    has_runs=False,
)
