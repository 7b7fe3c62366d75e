"""Values of `--set` relative to the machine."""

import pytest

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.parameters.variation import number_at
from wm_drake.studies.inputs import changed_parameters


@pytest.mark.parametrize(
    ("key", "text", "factor", "distance"),
    [
        ("spring_types.suspension.stiffness", "120 %", 1.2, 0.0),
        ("loads.front.unbalances.0.radius", "nominal - 10 mm", 1.0, -0.01),
        ("frames.detergent_point.position.0", "nominal + 5 mm", 1.0, 0.005),
        ("bodies.drum.mass", "nominal", 1.0, 0.0),
    ],
)
def test_set_takes_percents_and_distances(key, text, factor, distance):
    machine = wm.load_machine("reference")
    changed = number_at(changed_parameters(machine, [f"{key}={text}"]), key).nominal
    if key.startswith(("bodies", "frames")):  # only the SDF has it
        plant = wm.build_machine(machine).drawn.plant
        point = plant.GetFrameByName("detergent_point").GetFixedPoseInBodyFrame().translation()
        in_sdf = {"bodies": plant.GetBodyByName("drum").default_mass(), "frames": point[0]}
        before = in_sdf[key.partition(".")[0]]
    else:
        before = number_at(machine, key).nominal
    assert changed == pytest.approx(factor * before + distance)


def test_percent_of_zero_is_refused_in_set():
    machine = wm.load_machine("reference")
    with pytest.raises(InputError, match="percents of it are 0"):
        changed_parameters(machine, ["imperfections.residual_imbalance.mass=50 %"])
