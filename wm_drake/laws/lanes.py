"""Lanes: a scalar type of the compiler that carries several runs side by side through the processor's vector units.

A law that is compiled for floats can be compiled for `LANES` as well: every number in it is then `WIDTH` numbers, one a run,
and every operation acts on each of them alone. Operations are those of IEEE arithmetic, one by one, none fused or
reordered; so each lane gives bit for bit what the law gives for floats, whatever its neighbours hold. A law qualifies
if it chooses with `elementary.where` in place of `if`; what holds for all lanes alike (number of a law, points of a table)
may be asked with `int`, which reads the first lane.

The vectors are LLVM's: on a processor with narrower units the same code takes several instructions for one.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

WIDTH = 8
"""Runs side by side: one register of 512 bits, two of 256."""

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_FIRST = ir.Constant(ir.IntType(32), 0)


class LanesType(types.Type):
    """Type of `WIDTH` floats; a plain number that meets it becomes the same number in each lane."""

    def __init__(self) -> None:
        """One type, by its name."""
        super().__init__("Lanes")

    def can_convert_from(self, typingctx: Any, other: Any) -> Conversion | None:
        """Numbers convert."""
        return Conversion.promote if isinstance(other, types.Float | types.Integer) else None

    def unify(self, typingctx: Any, other: Any) -> "LanesType | None":
        """A variable that is now a number, now lanes, is lanes."""
        return self if isinstance(other, types.Float | types.Integer) else None


class MaskType(types.Type):
    """Type of the answer to a comparison of lanes: yes or no for each."""

    def __init__(self) -> None:
        """One type, by its name."""
        super().__init__("Mask")


class LaneArrayType(types.Type):
    """Type of an array of lanes: entry i is the numbers [i * WIDTH, (i + 1) * WIDTH) of a contiguous array of floats."""

    def __init__(self) -> None:
        """One type, by its name."""
        super().__init__("LaneArray")


class NumberArrayType(types.Type):
    """Type of a contiguous array of floats whose indices never count from its end; to ask for that costs a third of a law."""

    def __init__(self) -> None:
        """One type, by its name."""
        super().__init__("NumberArray")


LANES, MASK, LANE_ARRAY, NUMBER_ARRAY = LanesType(), MaskType(), LaneArrayType(), NumberArrayType()
_ENTRIES = {LANE_ARRAY: LANES, NUMBER_ARRAY: types.float64}


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), WIDTH))


@register_model(LaneArrayType)
@register_model(NumberArrayType)
class _PointerModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.DoubleType().as_pointer())


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
def _in_each_lane(context: Any, builder: Any, given: Any, _: Any, value: Any) -> Any:
    number = context.cast(builder, value, given, types.float64)
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    order = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(builder.insert_element(nothing, number, _FIRST), nothing, order)


def _declare(operation: Any, kinds: tuple[Any, ...], result: Any, emit: Callable[..., Any], mixed: bool = False) -> None:
    """Teaches the compiler an operation on `kinds`; `mixed` lets plain numbers stand for some of the lanes."""

    def fits(given: tuple[Any, ...]) -> bool:
        if not mixed or LANES not in given:
            return given == kinds
        return len(given) == len(kinds) and all(kind == LANES or isinstance(kind, types.Number) for kind in given)

    @infer_global(operation)
    class _Template(AbstractTemplate):
        def generic(self, args: tuple[Any, ...], kws: Any) -> Any:
            return signature(result, *kinds) if not kws and fits(tuple(args)) else None

    @lower_builtin(operation, *kinds)
    def _emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, *args)


def _compare(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


for _operation, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv")):
    _declare(_operation, (LANES, LANES), LANES, lambda builder, a, b, name=_name: getattr(builder, name)(a, b), mixed=True)
for _operation, _sign in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _declare(_operation, (LANES, LANES), MASK, _compare(_sign), mixed=True)
_declare(operator.and_, (MASK, MASK), MASK, lambda builder, a, b: builder.and_(a, b))
_declare(operator.or_, (MASK, MASK), MASK, lambda builder, a, b: builder.or_(a, b))
_declare(operator.neg, (LANES,), LANES, lambda builder, a: builder.fneg(a))
_declare(abs, (LANES,), LANES, lambda builder, a: _llvm(builder, "fabs", a))
_declare(int, (LANES,), types.int64, lambda builder, a: builder.fptosi(builder.extract_element(a, _FIRST), ir.IntType(64)))


def _llvm(builder: Any, name: str, lanes: Any) -> Any:
    """One of LLVM's functions of a vector."""
    kind = ir.FunctionType(_VECTOR, [_VECTOR])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64"), [lanes])


@intrinsic
def lanes_sqrt(typing_context, x):
    """Square root in each lane."""
    return LANES(LANES), lambda context, builder, sig, args: _llvm(builder, "sqrt", args[0])


@intrinsic
def lanes_floor(typing_context, x):
    """Largest whole number not above, in each lane."""
    return LANES(LANES), lambda context, builder, sig, args: _llvm(builder, "floor", args[0])


@intrinsic
def lanes_select(typing_context, condition, a, b):
    """`a` where the condition holds, else `b`, in each lane."""
    return LANES(MASK, LANES, LANES), lambda context, builder, sig, args: builder.select(*args)


def _mask_against(sign: str, bits: int) -> Callable[..., Any]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        mask = builder.bitcast(args[0], ir.IntType(WIDTH))
        return builder.icmp_unsigned(sign, mask, ir.Constant(ir.IntType(WIDTH), bits))

    return emit


@intrinsic
def lanes_any(typing_context, condition):
    """Whether the condition holds in any lane."""
    return types.boolean(MASK), _mask_against("!=", 0)


@intrinsic
def lanes_all(typing_context, condition):
    """Whether the condition holds in all lanes."""
    return types.boolean(MASK), _mask_against("==", 2**WIDTH - 1)


@intrinsic
def lane_array(typing_context, array):
    """An array of lanes over a contiguous array of floats, which must outlive it; nothing checks its bounds."""
    return (LANE_ARRAY(array), _address_of) if _is_flat(array) else None


@intrinsic
def number_array(typing_context, array):
    """The same of single numbers."""
    return (NUMBER_ARRAY(array), _address_of) if _is_flat(array) else None


def _is_flat(array: Any) -> bool:
    return isinstance(array, types.Array) and array.dtype == types.float64 and array.layout == "C"


def _address_of(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return context.make_array(sig.args[0])(context, builder, args[0]).data


@intrinsic
def align_stack(typing_context):
    """Makes the function that calls this keep vectors at addresses a vector load takes in one go."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        with builder.goto_entry_block():
            slot = builder.alloca(_VECTOR)
            slot.align = 64
        # an address that leaves for an (empty) piece of assembly cannot be optimised away
        kind = ir.FunctionType(ir.VoidType(), [_VECTOR.as_pointer()])
        builder.asm(kind, "", "r", [slot], side_effect=True)
        return context.get_dummy_value()

    return types.none(), emit


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args: tuple[Any, ...], kws: Any) -> Any:
        fits = args[0] in _ENTRIES and isinstance(args[1], types.Integer)
        return signature(_ENTRIES[args[0]], args[0], types.intp) if fits else None


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args: tuple[Any, ...], kws: Any) -> Any:
        fits = args[0] in _ENTRIES and isinstance(args[1], types.Integer)
        return signature(types.none, args[0], types.intp, _ENTRIES[args[0]]) if fits else None


def _place(builder: Any, array: Any, index: Any) -> Any:
    begin = builder.gep(array, [builder.mul(index, ir.Constant(index.type, WIDTH))])
    return builder.bitcast(begin, _VECTOR.as_pointer())


@lower_builtin(operator.getitem, LaneArrayType, types.intp)
def _get_lanes(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(_place(builder, *args), align=8)


@lower_builtin(operator.setitem, LaneArrayType, types.intp, LanesType)
def _set_lanes(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], _place(builder, *args[:2]), align=8)
    return context.get_dummy_value()


@lower_builtin(operator.getitem, NumberArrayType, types.intp)
def _get_number(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(builder.gep(args[0], [args[1]]))


@lower_builtin(operator.setitem, NumberArrayType, types.intp, types.float64)
def _set_number(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], builder.gep(args[0], [args[1]]))
    return context.get_dummy_value()
