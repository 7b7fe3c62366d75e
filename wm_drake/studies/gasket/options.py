"""Options of the gasket study, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import PROFILE, Options, Study, imported, option

DEFAULT_MODEL = "main+2fi"


class GasketOptions(Options):
    """Options of the gasket study."""

    load: tuple[str, ...] = option(
        (),
        "Load of the machine, or load file. Repeatable. Default: all loads. [B] has middle and "
        "counter.",
        "NAME|FILE",
    )
    design: str = option(
        "d-optimal",
        "Design: d-optimal, orthogonal, full, or a CSV file or workbook with a column per factor: "
        "levels, -1 and 1 for the ends, or values with a unit in cell or head (K_Lx [N/mm]).",
    )
    trials: int | None = option(
        None,
        "Number of trials. Default: 1000 for d-optimal. Allowed for orthogonal: 243 or 729. A full "
        "design has all level combinations.",
        "N",
        ge=1,
    )
    model: str | None = option(
        None,
        "Effects to estimate: main (main effects) or main+2fi (with two-factor interactions). Of a "
        "file also a polynomial: linear, linear+2fi, quadratic, or terms such as "
        "'C_L, K_Lx, C_L:K_Lx, C_L^2'. Default: main+2fi; quadratic if the levels are not -1, 0, "
        "1, or too few for it.",
    )
    seed: int = option(0, "Seed of the D-optimal design.", ge=0, le=2**32 - 1)
    factor: tuple[str, ...] = option(
        (),
        "Factor to study instead of all entries of --vary: one of C_L, K_Lx, ..., or any key of "
        "the machine file. Bounds are in percent of its value, or numbers with a unit. Default: "
        "50 %..150 %. Repeatable.",
        "NAME|KEY[=LOW..HIGH]",
    )
    vary: str | None = option(
        None,
        "Shipped vary file, or a YAML file: its entries are the factors. Default: gasket.",
        "NAME|FILE",
    )
    response: tuple[str, ...] = option(
        (),
        "What is measured of each run: D, F, M, gap, amplitude, critical_speed, power_mean, "
        "region_displacement, region_displacement_integrated, mounts, cabinet, mount_force_peak, "
        "mount_force_rms, mount_force_dynamic_rms, cabinet_force_peak, ..., feet, "
        "smallest_foot_load, slide_margin, turn_margin, tilt_margin, or one number such as Dx, "
        "amplitude_Xr or mount_force_rms_springs.left. Repeatable. Default: D, F, M and gap.",
        "NAME",
    )
    tables: str = option(
        "scaled",
        "Treatment of a stiffness that is given as a table. scaled: multiply its forces by the "
        "level, so that level 0 is the machine. linear: replace it by the slope of a line "
        "through its first 20 % times the level, as in [B]. The page shows how much both differ at "
        "level 0.",
    )
    published: tuple[Path, ...] = option(
        (),
        "Published results to compare with: load, response, term, percent, effects. Repeatable. "
        "Default: those of the machine file, for its own numbers, loads and profile and the "
        "factors of [B].",
        "CSV",
    )
    check: tuple[str, ...] = option(
        (),
        "Run this setting of the factors too and compare it with the fitted model: 'C_L=0.5 "
        "N*s/mm, K_Lx=120 %'. Other factors are at their middle level. Repeatable; the page gives "
        "the text for the setting of its sliders.",
        "NAME=VALUE,...",
    )
    profile: Path | None = PROFILE


GASKET = Study(
    "gasket",
    "Find how stiffness and damping of the gasket affect displacement, force and moment.",
    GasketOptions,
    imported("wm_drake.studies.gasket.task:GasketTask"),
    quick={"trials": 150, "load": ("middle",)},
)
