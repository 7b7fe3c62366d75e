"""Options that name a component and its masses on a bench."""

from typing import Any

from wm_drake.studies.study import Options, option

AXIS = "radial, axial, tilt, twist; or x, y, z, about_x, about_y, about_z."

ARM: Any = option(
    None, "Radius of the jig through which a rotation is driven, e.g. '100 mm'.", "LENGTH"
)
OUTER_MASS: Any = option(
    None, "Mass of the outer tube, at the driven end ([A] Eq. 6), e.g. '150 g'.", "MASS"
)
JIG_MASS: Any = option(None, "Mass of the jig, at the driven end ([C] Eq. 2), e.g. '2 kg'.", "MASS")


class ComponentOptions(Options):
    """Options of a component: of a machine, or of a file."""

    name: str | None = option(
        None, "Damper type or bushing of the machine; its first by default.", "NAME"
    )
    component: str | None = option(
        None, "Component file, or a shipped one, in place of one of a machine.", "NAME|FILE"
    )
