"""Forces of the mounts on the cabinet: peak, RMS, and RMS without the mean."""

from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.kind import Measure, Variable, each_run
from wm_drake.simulation.mounts import KINDS, POINT, cabinet_measures, mount_measures

TITLES = dict(zip(KINDS, ("peak", "RMS", "dynamic RMS"), strict=True))
WORDS = dict(zip(KINDS, ("largest size", "RMS", "RMS without the mean"), strict=True))

MOUNTS = Measure(
    "mounts",
    tuple(
        Variable(
            f"mount_force_{kind}",
            ("mount",),
            Unit("N", "N"),
            f"{TITLES[kind]} force of a mount",
            f"{WORDS[kind]} of the force of each mount on the cabinet",
            title=f"{TITLES[kind]} force {{}}",
            short="{}",
            studio=1 if kind == "peak" else None,
        )
        for kind in KINDS
    ),
    each_run(lambda run: mount_measures(run.mount_sums)),
    ("mounts",),
    has_table=False,
)

CABINET = Measure(
    "cabinet",
    tuple(
        Variable(
            f"cabinet_{quantity}_{kind}",
            ("axis",),
            unit,
            f"{TITLES[kind]} {quantity} on the cabinet",
            f"{WORDS[kind]} of the {quantity} of all mounts on the cabinet{about}",
            studio=None,
        )
        for quantity, unit, about in (
            ("force", Unit("N", "N"), ""),
            ("moment", Unit("N*m", "N*m"), f" about {POINT}"),
        )
        for kind in KINDS
    ),
    each_run(lambda run: cabinet_measures(run.mount_sums)),
    ("mounts",),
    has_table=False,
)
