"""Command `wm-drake study`: questions that need many runs, one module per study."""

import typer

from wm_drake.cli.figures import writes_pages
from wm_drake.cli.study import (
    design,
    drive,
    gasket,
    gasket_damping,
    gasket_effect,
    modes,
    response,
    spin_cycle,
    spin_identify,
    tolerance,
)

app = typer.Typer(help="Run a study of many runs and write a report.", no_args_is_help=True)
app.command("design")(writes_pages(design.design))
app.command("drive")(writes_pages(drive.drive))
app.command("gasket")(writes_pages(gasket.gasket))
app.command("gasket-damping")(writes_pages(gasket_damping.gasket_damping))
app.command("gasket-effect")(writes_pages(gasket_effect.gasket_effect))
app.command("modes")(writes_pages(modes.modes))
app.command("response")(writes_pages(response.response))
app.command("spin-cycle")(writes_pages(spin_cycle.spin_cycle))
app.command("spin-identify")(writes_pages(spin_identify.spin_identify))
app.command("tolerance")(writes_pages(tolerance.tolerance))
