"""Command `wm-drake study`: questions that need many runs, one module per study."""

import typer

from wm_drake.cli.study import (
    design,
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
app.command("design")(design.design)
app.command("gasket")(gasket.gasket)
app.command("gasket-damping")(gasket_damping.gasket_damping)
app.command("gasket-effect")(gasket_effect.gasket_effect)
app.command("modes")(modes.modes)
app.command("response")(response.response)
app.command("spin-cycle")(spin_cycle.spin_cycle)
app.command("spin-identify")(spin_identify.spin_identify)
app.command("tolerance")(tolerance.tolerance)
