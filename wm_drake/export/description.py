"""`modelDescription.xml` of an FMU, for FMI 2.0 and 3.0."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from wm_drake.export.model import ExportedModel, FmuVariable
from wm_drake.parameters.units import registry

DIMENSIONS = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[angle]": "rad", "[current]": "A"}
"""Base units of the standard, by pint's dimension."""
IDENTIFIER = "wm_drake_machine"
"""Name of the library files of an FMU."""


@dataclass(frozen=True)
class Identity:
    """What an FMU is, beside the model in it.

    Attributes:
        token: GUID of an FMU of version 2, instantiation token of version 3.
        version: 2 or 3, version of the standard.
        program: Name and version of this program.
        sources: Names of the source files that an importer can compile; none without sources.
    """

    token: str
    version: int
    program: str
    sources: tuple[str, ...] = ()


def model_description(model: ExportedModel, identity: Identity) -> bytes:
    """Return the description of a model as XML."""
    root = _root(model, identity)
    _add_kinds(root, identity)
    _add_units(root, model.variables)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="logStatusError", description="errors")
    end = _number(model.setup.parameters.profile.duration)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime=end, stepSize="0.005")
    variables = ET.SubElement(root, "ModelVariables")
    write = _write_2 if identity.version == 2 else _write_3
    write(root, variables, model)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _root(model: ExportedModel, identity: Identity) -> ET.Element:
    parameters = model.setup.parameters
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0" if identity.version == 2 else "3.0",
        modelName=parameters.name,
        description=f"{parameters.about or parameters.name} Load: {model.load}.",
        generationTool=identity.program,
        generationDateAndTime=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        variableNamingConvention="structured",
    )
    root.set("guid" if identity.version == 2 else "instantiationToken", identity.token)
    if identity.version == 2:
        root.set("numberOfEventIndicators", "0")
    return root


def _add_kinds(root: ET.Element, identity: Identity) -> None:
    """Add what model exchange and co-simulation can do."""
    state = "state" if identity.version == 2 else "State"
    common = {
        "modelIdentifier": IDENTIFIER,
        f"canGetAndSetFMU{state}": "true",
        f"canSerializeFMU{state}": "true",
    }
    steps = {"canHandleVariableCommunicationStepSize": "true"}
    for kind, more in (("ModelExchange", {}), ("CoSimulation", steps)):
        element = ET.SubElement(root, kind, common | more)
        if identity.version == 2 and identity.sources:
            files = ET.SubElement(element, "SourceFiles")
            for name in identity.sources:
                ET.SubElement(files, "File", name=name)


def _add_units(root: ET.Element, variables: Sequence[FmuVariable]) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit in sorted({v.unit for v in variables if v.unit} | {"s"}):
        element = ET.SubElement(definitions, "Unit", name=unit)
        ET.SubElement(element, "BaseUnit", _base_unit(unit))


def _base_unit(unit: str) -> dict[str, str]:
    """Return the exponents of the base units of an SI unit."""
    powers: dict[str, Any] = dict(registry().Quantity(1.0, unit).dimensionality)
    return {DIMENSIONS[name]: str(round(power)) for name, power in powers.items() if power}


def _attributes(variable: FmuVariable) -> dict[str, str]:
    """Return what both versions write of a variable alike."""
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.index),
        "causality": variable.causality,
        "variability": variable.variability,
        "description": variable.words,
    }
    if variable.causality in ("output", "local"):
        attributes["initial"] = "calculated"
    elif variable.causality == "parameter":
        attributes["initial"] = "exact"
    return attributes


def _of_float(variable: FmuVariable) -> dict[str, str]:
    """Return the attributes of a number."""
    attributes = {"unit": variable.unit} if variable.unit else {}
    for name, value in (
        ("min", variable.minimum),
        ("max", variable.maximum),
        ("nominal", variable.nominal),
        ("start", variable.start),
    ):
        if value is not None and not (name == "start" and variable.causality == "local"):
            attributes[name] = _number(value)
    return attributes


def _write_2(root: ET.Element, variables: ET.Element, model: ExportedModel) -> None:
    position = {variable.index: k for k, variable in enumerate(model.variables, start=1)}
    for variable in model.variables:
        scalar = ET.SubElement(variables, "ScalarVariable", _attributes(variable))
        real = ET.SubElement(scalar, "Real", _of_float(variable))
        if variable.derivative >= 0:
            real.set("derivative", str(position[variable.derivative]))
    structure = ET.SubElement(root, "ModelStructure")
    groups = {
        "Outputs": [v for v in model.variables if v.causality == "output"],
        "Derivatives": [v for v in model.variables if v.derivative >= 0],
        "InitialUnknowns": [v for v in model.variables if v.causality in ("output", "local")],
    }
    for name, unknowns in groups.items():
        group = ET.SubElement(structure, name)
        for variable in unknowns:
            ET.SubElement(group, "Unknown", index=str(position[variable.index]))


def _write_3(root: ET.Element, variables: ET.Element, model: ExportedModel) -> None:
    time = {"name": "time", "valueReference": "0", "unit": "s", "description": "time"}
    independent = {"causality": "independent", "variability": "continuous"}
    ET.SubElement(variables, "Float64", time | independent)
    for variable in model.variables:
        attributes = _attributes(variable) | _of_float(variable)
        if variable.causality == "input":
            attributes.pop("initial", None)
        if variable.derivative >= 0:
            attributes["derivative"] = str(variable.derivative)
        ET.SubElement(variables, "Float64", attributes)
    structure = ET.SubElement(root, "ModelStructure")
    for name, unknowns in (
        ("Output", [v for v in model.variables if v.causality == "output"]),
        ("ContinuousStateDerivative", [v for v in model.variables if v.derivative >= 0]),
        ("InitialUnknown", [v for v in model.variables if v.causality in ("output", "local")]),
    ):
        for variable in unknowns:
            ET.SubElement(structure, name, valueReference=str(variable.index))


def _number(value: float) -> str:
    return repr(float(value))
