"""Command `wm-drake study`: questions that need many runs, one module per study."""

import typer

from wm_drake.cli.study import design, gasket, gasket_damping, spin_cycle, spin_identify, tolerance

app = typer.Typer(help="Run a study of many runs and write a report.", no_args_is_help=True)
app.command("gasket")(gasket.gasket)
app.command("gasket-damping")(gasket_damping.gasket_damping)
app.command("spin-cycle")(spin_cycle.spin_cycle)
app.command("spin-identify")(spin_identify.spin_identify)
app.command("tolerance")(tolerance.tolerance)
app.command("design")(design.design)
