"""A machine that rests exactly as drawn: its springs hang straight down."""

from wm_drake.parameters import with_values


def with_upright_springs(machine):
    """Return a machine's parameters with the hooks of the housing straight above those of the tub.

    Three upright springs balance the weight and its moments exactly: the drawn pose is at rest.
    Springs that lean leave a lateral force, which moves the rest pose.
    """
    return with_values(
        machine.parameters,
        {
            f"frames.{machine.parameters.springs[name].housing_frame}.position": (
                *map(float, spring.p_ToA_T[:2]),
                float(spring.p_WH[2]),
            )
            for name, spring in machine.set_up().springs.items()
        },
    )
