"""Machines with simpler dampers: massless struts instead of tubes on bushings."""

import xml.etree.ElementTree as ET
from pathlib import Path

from wm_drake.model.bodies import sdf_path
from wm_drake.parameters import MachineParameters


def strut_machine(parameters: MachineParameters, folder: Path) -> MachineParameters:
    """Return a machine with massless struts in place of its telescopic dampers.

    The struts have the same damper law and the same bending stiffness, damping and friction at
    their ends. They do not model the masses of the tubes, the radial and axial compliance of the
    bushings and the friction about the axis of the damper.

    Args:
        folder: Folder to which its SDF without the tubes is written.
    """
    tree = parameters.model_dump(exclude_unset=True)
    types, dampers = dict(tree["damper_types"]), {}
    for name, damper in parameters.telescopic_dampers.items():
        bushing = parameters.bushing_types[damper.tub_bushing]
        bending = {
            "stiffness": bushing.rotational_stiffness_x,
            "damping": bushing.rotational_damping_x,
            "friction_torque": bushing.friction_torque_x,
            "full_friction_rate": bushing.full_friction_rate_x,
        }
        types[f"{damper.type}_strut"] = {
            **tree["damper_types"][damper.type],
            "end_bushing": bending,
        }
        dampers[name] = {
            "type": f"{damper.type}_strut",
            "tub_frame": damper.tub_frame,
            "housing_frame": damper.housing_frame,
        }
    model = _without_tubes(parameters, folder)
    links = {link.get("name") for link in ET.parse(model).getroot().iter("link")}
    bodies = {name: override for name, override in tree.get("bodies", {}).items() if name in links}
    changes = {
        "name": f"{parameters.name}_struts",
        "model": str(model),
        "bodies": bodies,
        "damper_types": types,
    }
    kept = {key: value for key, value in tree.items() if key not in ("telescopic_dampers", "step")}
    return MachineParameters.model_validate(
        {**kept, **changes, "dampers": {**tree.get("dampers", {}), **dampers}}
    )


def _without_tubes(parameters: MachineParameters, folder: Path) -> Path:
    path = sdf_path(parameters.model)
    tree = ET.parse(path)
    model = tree.getroot().find("model")
    assert model is not None  # the machine was built from it
    joints = {damper.joint for damper in parameters.telescopic_dampers.values()}
    telescopes = [joint for joint in model.iter("joint") if joint.get("name") in joints]
    tubes = {joint.findtext(end, "").strip() for joint in telescopes for end in ("parent", "child")}
    removed = [
        part
        for part in model
        if part.get("name") in tubes | joints or part.get("attached_to") in tubes
    ]
    for part in removed:
        model.remove(part)
    written = folder / f"{path.stem}_without_tubes.sdf"
    tree.write(written, encoding="unicode", xml_declaration=True)
    return written
