"""Dynamics of front-loading washing machines on Drake.

    import wm_drake as wm
    wm.run_study("spin", "reference", load=["middle"]).plot()
    record = wm.simulate("reference", "middle")
    wm.envelopes(record).upper.sel(sensor="Xr").plot()

The rooms, in the order of the data flow: `parameters`, `solid`, `laws`, `elements`, `systems`,
`model`, `engines`, `simulation`, `export`, `batch`, `rigs`, `report`, `live`, `studies`, `studio`,
`cli`.
"""

import importlib
from typing import Any

_HOMES = {
    "Case": "simulation.cases",
    "FmuOptions": "export.options",
    "Element": "parameters.element_kinds",
    "ElementKind": "elements.kind",
    "Output": "elements.kind",
    "Scene": "model.scene",
    "State": "elements.kind",
    "add_washing_machine": "model.build",
    "advance_to": "engines.drake",
    "anova": "studies.gasket.steps",
    "build_machine": "model.build",
    "case_of": "simulation.cases",
    "contributions": "studies.gasket.steps",
    "doe_report": "studies.gasket.steps",
    "describe": "studies.machine_show.description",
    "export_fmu": "export.fmu",
    "envelopes": "simulation.displacements",
    "factors": "studies.gasket.steps",
    "filtered_displacement": "simulation.displacements",
    "load_load": "parameters",
    "load_machine": "parameters",
    "load_profile": "parameters",
    "load_record": "simulation.records",
    "make_design": "studies.doe.design",
    "measure": "simulation.measures",
    "modes": "studies.modes.study",
    "natural_modes": "studies.modes.natural",
    "progress_bar": "report.progress",
    "PageBlock": "studies.blocks",
    "register_block": "studies.blocks",
    "register_element": "elements.kind",
    "register_study": "studies.study",
    "register_measure": "simulation.measures",
    "run_spin": "studies.spin.study",
    "run_study": "studies.run",
    "run_trials": "studies.gasket.steps",
    "save_record": "simulation.records",
    "simulate": "simulation.runs",
    "simulate_many": "batch",
    "steady_response": "studies.response.response",
    "with_value": "parameters",
    "with_values": "parameters",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """Load a public name from its room when it is first used, because importing Drake takes 1 s."""
    if name == "__version__":
        from importlib.metadata import version  # slow to import

        return version("wm-drake")
    if name not in _HOMES:
        raise AttributeError(f"module 'wm_drake' has no attribute '{name}'")
    with importlib.import_module("wm_drake.errors").libraries_named():
        return getattr(importlib.import_module(f"wm_drake.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    special = {name for name in globals() if name.startswith("__")}
    return sorted({*special, "__version__", *_HOMES})
