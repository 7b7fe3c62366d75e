"""Say in words what the tub does at its stops, for pages whose question is contact."""

from collections.abc import Iterator

import xarray as xr

from wm_drake.report.formatting import listed
from wm_drake.report.quantity import of_measure


def stops_sentence(runs: xr.Dataset) -> str:
    """Return which stops the tub meets, with force, velocity and number of hits.

    Args:
        runs: Measures over `load`, with those of "stops" and "mounts".

    Returns:
        A sentence; "" for a machine without stops.
    """
    if "stop" not in runs.sizes or not runs.sizes["stop"]:
        return ""
    met = list(_met(runs))
    if not met:
        return "The tub does not meet its stops."
    return f"The tub meets its stops: {listed(met)}."


def _met(runs: xr.Dataset) -> Iterator[str]:
    """Yield name, force, velocity and load of each stop that is met, at the load of its force."""
    velocity, force = of_measure("stop_hit_velocity"), of_measure("mount_force_peak")
    for name in runs["stop"].values.tolist():
        hit = runs.sel(stop=name, mount=f"elements.{name}")
        forces = hit.mount_force_peak.where(hit.stop_hits > 0.0).fillna(-1.0)
        worst = hit.isel(load=int(forces.argmax("load")))
        if not worst.stop_hits.item() > 0.0:
            continue
        count = int(worst.stop_hits.item())
        yield (
            f"{name} with {force.text(worst.mount_force_peak)} at "
            f"{velocity.text(worst.stop_hit_velocity)} (load {worst['load'].item()}, "
            f"{count} hit{'s' if count > 1 else ''})"
        )
