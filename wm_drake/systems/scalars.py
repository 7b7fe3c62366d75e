"""Scalar types of all systems, and what a system needs to convert between them."""

import inspect
import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import BasicVector_, NumericParameterIndex
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.compiler.compilation import generic
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.callbacks import NO_SLOTS

SCALARS = (float, AutoDiffXd)
"""Scalar types of all systems. With `Expression`, Drake would trace the callbacks symbolically."""


def define_system(name: str, module: str) -> Callable[[Callable[[type], Any]], Any]:
    """Return the decorator of a system that converts between `SCALARS`.

    It is `TemplateSystem.define` of Drake. For each class Drake reads all frames of the stack,
    twice, which takes seconds in total during an import of this package. The first system of the
    template needs the classes for all scalars. They are therefore defined in a thread of their own,
    whose stack is short.

    A class defines `_construct`. A copy for another scalar is constructed from the attributes that
    have the names of its arguments.

    Args:
        name: Name of the template.
        module: `__name__` of the module that defines it.
    """
    scope = sys.modules[module]

    def decorate(of_scalar: Callable[[type], Any]) -> Any:
        def with_copy(scalar: type) -> Any:
            system = of_scalar(scalar)
            _, *arguments, _ = inspect.signature(system._construct).parameters

            def _construct_copy(self: Any, other: Any, converter: Any = None) -> None:
                given = (getattr(other, argument) for argument in arguments)
                system._construct(self, *given, converter=converter)

            system._construct_copy = _construct_copy
            return system

        template = TemplateSystem.define(name, T_list=SCALARS, scope=scope)(with_copy)
        thread = threading.Thread(target=lambda: [template[scalar] for scalar in SCALARS])
        thread.start()
        thread.join()
        plain = template[float]
        plain.__name__ = plain.__qualname__ = name.rstrip("_")  # as Drake's own systems of doubles
        return template

    return decorate


def evaluator(compiled: Any, scalar: type) -> Callable[..., None]:
    """Return the function to call for a scalar type.

    Args:
        compiled: A compiled law.
        scalar: float gets the compiled law; AutoDiffXd gets the same source, interpreted.
    """
    return compiled if scalar is float else generic(compiled)


def empty(size: int, scalar: type) -> Any:
    """Return an uninitialized array of a scalar type. (size,)"""
    return np.empty(size, float if scalar is float else object)


class Packed:
    """Mixin of systems whose packed numbers are one numeric parameter of the Context."""

    __slots__ = NO_SLOTS

    def declare_numbers(self, scalar: type, packed: FloatArray) -> Any:
        """Declare the parameter and return its ticket."""
        system: Any = self
        self.packed = packed  # a scalar-converted copy is constructed from these
        self._numbers = system.DeclareNumericParameter(BasicVector_[scalar](packed))
        return system.numeric_parameter_ticket(NumericParameterIndex(self._numbers))

    def set_parameters(self, context: Any, packed: FloatArray) -> None:
        """Set the packed numbers in the system's own Context.

        Raises:
            ValueError: a table has another number of points than in the built system.
        """
        if len(packed) != len(self.packed):
            name = self.get_name()  # type: ignore[attr-defined]
            raise ValueError(
                f"{name}: a table has another number of points than the built machine's; "
                "rebuild the machine"
            )
        context.get_mutable_numeric_parameter(self._numbers).SetFromVector(packed)

    def packed_numbers(self, context: Any) -> Any:
        """Return the packed numbers in the system's own Context."""
        return context.get_numeric_parameter(self._numbers).CopyToVector()
