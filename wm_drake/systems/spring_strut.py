"""Suspension spring between a point of the tub and a point of the housing."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.spring import evaluate_spring_strut
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element_system import ElementSystem, define_system


@define_system("SpringStrut_", __name__)
def SpringStrut_(T: type) -> Any:
    """Return the class SpringStrut for a scalar type."""

    class SpringStrut(ElementSystem, LeafSystem_[T]):
        """Suspension spring; law `spring_tension`.

        plant_state (14) ──▶ [ SpringStrut ] ──▶ generalized_force (7) [N m, N]
                                             ──▶ force (1), tension > 0 [N]
        """

        def _construct(self, parameters: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(T, evaluate_spring_strut, parameters, {"force": slice(0, 1)})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, converter=converter)

    Impl = SpringStrut
    return SpringStrut


SpringStrut = SpringStrut_[None]
