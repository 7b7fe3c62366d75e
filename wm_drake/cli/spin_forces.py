"""Forces on cabinet and floor in the JSON of `wm-drake spin`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import xarray as xr

    from wm_drake.simulation.cabinet import Walk
    from wm_drake.simulation.measures import Measures

FEET = {
    "smallest_normal_force_N": "smallest_foot_load",
    "slide_margin_N": "slide_margin",
    "turn_margin_Nm": "turn_margin",
    "tilt_margin_Nm": "tilt_margin",
}
"""Keys of the JSON, and the measures of the feet."""


def forces_as_json(measures: "Measures") -> dict[str, Any]:
    """Return forces of the mounts, their resultant on the cabinet, and loads of the feet.

    Args:
        measures: Measures of one case.
    """
    from wm_drake.simulation.mounts import POINT

    return {
        "mount_force_N": _sizes(measures, "mount_force"),
        "cabinet_wrench": {
            "about": POINT,
            "force_N": _sizes(measures, "cabinet_force"),
            "moment_Nm": _sizes(measures, "cabinet_moment"),
        },
        "feet": None if measures.feet is None else _feet(measures.feet),
        "walk": None if measures.walk is None else _walk(measures.walk),
    }


def forces_of_run_as_json(forces: "xr.Dataset") -> dict[str, Any]:
    """Return forces of the mounts and loads of the feet of one run.

    Args:
        forces: Measures of the run by name, those of the feet only if the machine has a cabinet.
    """
    return {
        "mount_force_N": _sizes(forces, "mount_force"),
        "feet": _feet(forces) if "turn_margin" in forces else None,
    }


def _sizes(measures: "Measures | xr.Dataset", name: str) -> dict[str, dict[str, float | None]]:
    """Return peak and RMS values of forces on the cabinet, by mount or axis. [N or N m]"""
    found: dict[str, dict[str, float | None]] = {}
    for kind in ("peak", "rms", "dynamic_rms"):
        values = getattr(measures, f"{name}_{kind}")
        labels = values[values.dims[0]].values
        for label, value in zip(labels, map(float, values.values), strict=True):
            found.setdefault(str(label), {})[kind] = _number(value)
    return found


def _walk(walk: "Walk") -> dict[str, float]:
    """Return distance and turn of a cabinet that moves, at the end of the run."""
    from wm_drake.parameters.units import Unit

    return {
        "distance_mm": Unit("m", "mm").from_si(walk.distance),
        "turn_deg": Unit("rad", "deg").from_si(walk.turn),
    }


def _feet(feet: "xr.Dataset") -> dict[str, Any]:
    """Return the smallest load and margins of the feet over the run and in each region."""
    of_run = {key: _number(float(feet[name])) for key, name in FEET.items()}
    of_regions = {
        str(region): {
            key: _number(float(feet[f"region_{name}"][index])) for key, name in FEET.items()
        }
        for index, region in enumerate(feet.region.values)
    }
    return of_run | {"regions": of_regions}


def _number(value: float) -> float | None:
    """Return a number, or None for NaN, which JSON does not have."""
    return value if value == value else None
