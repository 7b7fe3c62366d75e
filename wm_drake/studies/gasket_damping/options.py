"""Options of the gasket-damping study, and its declaration."""

from wm_drake.studies.study import Options, Study, imported, option


class GasketDampingOptions(Options):
    """Options of the gasket-damping study."""

    record: tuple[str, ...] = option(
        (),
        "Measured displacements of a load: CSV with time_s, Xr, Yr, ... in mm, another recorded "
        "file with these channels, or netCDF record of the command spin. Repeatable. Default: the "
        "records of a virtual experiment.",
        "LOAD=FILE",
    )
    planted_linear: str = option(
        "0.0287 N s/mm", "Linear damping C_L of the virtual experiment.", "VALUE"
    )
    planted_torsional: str = option(
        "87 N mm s/deg", "Torsional damping C_T of the virtual experiment.", "VALUE"
    )
    seed: int = option(0, "Seed of the noise of the virtual experiment.", "N", ge=0, le=2**32 - 1)
    mesh: float | None = option(
        None,
        "Also search by the grids of [B] section 3.1.2, with the surface of its distance, until "
        "this spacing in percent of the region (0 to 0.05 N s/mm, 0 to 200 N mm s/deg). A grid "
        "moves on to a better point, and is halved where there is none.",
        "PERCENT",
        ge=1e-3,
        le=25.0,
    )
    paper_mesh: bool = option(
        False,
        "Search by these grids with the rule of [B]: each is half as wide as the one before, until "
        "the distance falls by less than 0.02 mm.",
    )


GASKET_DAMPING = Study(
    "gasket-damping",
    "Find the gasket damping for which computed and measured envelopes agree best.",
    GasketDampingOptions,
    imported("wm_drake.studies.gasket_damping.task:GasketDampingTask"),
    has_runs=False,
)
