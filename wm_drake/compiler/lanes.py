"""Lanes: a scalar type of the compiler that carries several numbers side by side through the processor's vector units.

A law that is compiled for floats can be compiled for lanes as well: every number in it is then `WIDTH` numbers, one a run, or
`QUAD` numbers, one a strut of one machine, and every operation acts on each of them alone. Operations are those of IEEE
arithmetic, none reordered, products and sums fused where the processor can; so each lane gives what the law gives for floats,
whatever its neighbours hold. A law qualifies if it chooses with `elementary.where` in place of `if`; what holds for all lanes
alike (number of a law, points of a table) may be asked with `int`, which reads the first lane.

The vectors are LLVM's: on a processor with narrower units the same code takes several instructions for one.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.compiler import Compiler
from numba.core.typeconv import Conversion
from numba.core.types.containers import UniTuple
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

WIDTH = 8
"""Runs side by side: one register of 512 bits, two of 256."""

QUAD = 4
"""Struts of one machine side by side: half such a register; four of one kind are rarely exceeded."""

_FIRST = ir.Constant(ir.IntType(32), 0)


class _OfLanes(types.Type):
    """Types by the number of lanes, and their vectors."""

    def __init__(self, width: int) -> None:
        """One type for each width, by its name."""
        self.width = width
        super().__init__(f"{type(self).__name__.removesuffix('Type')}{width}")

    @property
    def vector(self) -> ir.VectorType:
        """LLVM's."""
        return ir.VectorType(ir.DoubleType(), self.width)


class LanesType(_OfLanes):
    """Type of several floats; a plain number that meets it becomes the same number in each lane."""

    def can_convert_from(self, typingctx: Any, other: Any) -> Conversion | None:
        """Numbers convert."""
        return Conversion.promote if isinstance(other, types.Float | types.Integer) else None

    def unify(self, typingctx: Any, other: Any) -> "LanesType | None":
        """A variable that is now a number, now lanes, is lanes."""
        return self if isinstance(other, types.Float | types.Integer) else None


class MaskType(_OfLanes):
    """Type of the answer to a comparison of lanes: yes or no for each."""


class LaneArrayType(_OfLanes):
    """Type of an array of lanes: entry i is the numbers [i * width, (i + 1) * width) of a contiguous array of floats."""


class NumberArrayType(types.Type):
    """Type of a contiguous array of floats whose indices never count from its end; to ask for that costs a third of a law."""

    def __init__(self) -> None:
        """One type, by its name."""
        super().__init__("NumberArray")


NUMBER_ARRAY = NumberArrayType()
_WIDTHS = (WIDTH, QUAD)
_LANES = {width: LanesType(width) for width in _WIDTHS}
_MASKS = {width: MaskType(width) for width in _WIDTHS}
_LANE_ARRAYS = {width: LaneArrayType(width) for width in _WIDTHS}
_ENTRIES = {NUMBER_ARRAY: types.float64} | {_LANE_ARRAYS[width]: _LANES[width] for width in _WIDTHS}


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, kind.vector)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), kind.width))


@register_model(LaneArrayType)
@register_model(NumberArrayType)
class _PointerModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.DoubleType().as_pointer())


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
def _in_each_lane(context: Any, builder: Any, given: Any, lanes: Any, value: Any) -> Any:
    number = context.cast(builder, value, given, types.float64)
    nothing = ir.Constant(lanes.vector, ir.Undefined)
    order = ir.Constant(ir.VectorType(ir.IntType(32), lanes.width), [0] * lanes.width)
    return builder.shuffle_vector(builder.insert_element(nothing, number, _FIRST), nothing, order)


def _declare(
    operation: Any,
    kinds: tuple[Any, ...],
    result: Any,
    emit: Callable[..., Any],
    mixed: bool = False,
) -> None:
    """Teaches the compiler an operation on `kinds`; `mixed` lets plain numbers stand for some of the lanes."""

    def fits(given: tuple[Any, ...]) -> bool:
        if not mixed or kinds[0] not in given:
            return given == kinds
        return len(given) == len(kinds) and all(
            kind == kinds[0] or isinstance(kind, types.Number) for kind in given
        )

    @infer_global(operation)
    class _Template(AbstractTemplate):
        def generic(self, args: tuple[Any, ...], kws: Any) -> Any:
            return signature(result, *kinds) if not kws and fits(tuple(args)) else None

    @lower_builtin(operation, *kinds)
    def _emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, *args)


def _compare(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


def _declare_all(lanes: LanesType, mask: MaskType) -> None:
    """Teaches the compiler arithmetic of one kind of lanes."""
    both = (lanes, lanes)
    for operation, name in (
        (operator.add, "fadd"),
        (operator.sub, "fsub"),
        (operator.mul, "fmul"),
        (operator.truediv, "fdiv"),
    ):
        _declare(
            operation,
            both,
            lanes,
            lambda builder, a, b, name=name: getattr(builder, name)(a, b),
            mixed=True,
        )
    for operation, sign in (
        (operator.lt, "<"),
        (operator.le, "<="),
        (operator.gt, ">"),
        (operator.ge, ">="),
    ):
        _declare(operation, both, mask, _compare(sign), mixed=True)
    _declare(operator.and_, (mask, mask), mask, lambda builder, a, b: builder.and_(a, b))
    _declare(operator.or_, (mask, mask), mask, lambda builder, a, b: builder.or_(a, b))
    _declare(operator.neg, (lanes,), lanes, lambda builder, a: builder.fneg(a))
    _declare(abs, (lanes,), lanes, lambda builder, a: _llvm(builder, "fabs", a))
    _declare(
        int,
        (lanes,),
        types.int64,
        lambda builder, a: builder.fptosi(builder.extract_element(a, _FIRST), ir.IntType(64)),
    )


for _width in _WIDTHS:
    _declare_all(_LANES[_width], _MASKS[_width])


def _llvm(builder: Any, name: str, lanes: Any) -> Any:
    """One of LLVM's functions of a vector."""
    kind = ir.FunctionType(lanes.type, [lanes.type])
    return builder.call(
        cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{lanes.type.count}f64"),
        [lanes],
    )


@intrinsic
def lanes_sqrt(typing_context, x):
    """Square root in each lane."""
    return x(x), lambda context, builder, sig, args: _llvm(builder, "sqrt", args[0])


@intrinsic
def lanes_floor(typing_context, x):
    """Largest whole number not above, in each lane."""
    return x(x), lambda context, builder, sig, args: _llvm(builder, "floor", args[0])


@intrinsic
def lanes_select(typing_context, condition, a, b):
    """`a` where the condition holds, else `b`, in each lane."""
    lanes = _LANES[condition.width]
    return lanes(condition, lanes, lanes), lambda context, builder, sig, args: builder.select(*args)


def _mask_against(sign: str, bits: int) -> Callable[..., Any]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole = ir.IntType(sig.args[0].width)
        return builder.icmp_unsigned(
            sign, builder.bitcast(args[0], whole), ir.Constant(whole, bits)
        )

    return emit


@intrinsic
def lanes_any(typing_context, condition):
    """Whether the condition holds in any lane."""
    return types.boolean(condition), _mask_against("!=", 0)


@intrinsic
def lanes_all(typing_context, condition):
    """Whether the condition holds in all lanes."""
    return types.boolean(condition), _mask_against("==", 2**condition.width - 1)


@intrinsic
def lane_array(typing_context, array):
    """An array of lanes over a contiguous array of floats, which must outlive it; nothing checks its bounds."""
    return (_LANE_ARRAYS[WIDTH](array), _address_of) if _is_flat(array) else None


@intrinsic
def quad_array(typing_context, array):
    """The same of quads."""
    return (_LANE_ARRAYS[QUAD](array), _address_of) if _is_flat(array) else None


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
            slot = builder.alloca(_LANES[WIDTH].vector)
            slot.align = 64
        # an address that leaves for an (empty) piece of assembly cannot be optimised away
        kind = ir.FunctionType(ir.VoidType(), [slot.type])
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


def _place(builder: Any, lanes: LanesType, array: Any, index: Any) -> Any:
    begin = builder.gep(array, [builder.mul(index, ir.Constant(index.type, lanes.width))])
    return builder.bitcast(begin, lanes.vector.as_pointer())


@lower_builtin(operator.getitem, LaneArrayType, types.intp)
def _get_lanes(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(_place(builder, sig.return_type, *args), align=8)


@lower_builtin(operator.setitem, LaneArrayType, types.intp, LanesType)
def _set_lanes(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], _place(builder, sig.args[2], *args[:2]), align=8)
    return context.get_dummy_value()


@lower_builtin(operator.getitem, NumberArrayType, types.intp)
def _get_number(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(builder.gep(args[0], [args[1]]))


@lower_builtin(operator.setitem, NumberArrayType, types.intp, types.float64)
def _set_number(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], builder.gep(args[0], [args[1]]))
    return context.get_dummy_value()


@intrinsic
def quad_at(typing_context, array, index):
    """Four neighbours of an array of numbers as a quad; nothing checks its bounds."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_quad_place(builder, *args), align=8)

    return _LANES[QUAD](array, types.intp), emit


@intrinsic
def put_quad_at(typing_context, array, index, quad):
    """Writes a quad to four neighbours of an array of numbers."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[2], _quad_place(builder, *args[:2]), align=8)
        return context.get_dummy_value()

    return types.none(array, types.intp, quad), emit


def _quad_place(builder: Any, array: Any, index: Any) -> Any:
    return builder.bitcast(builder.gep(array, [index]), _LANES[QUAD].vector.as_pointer())


@intrinsic
def numbers_of_quad(typing_context, quad):
    """The lanes of a quad as a tuple of four numbers."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        parts = [
            builder.extract_element(args[0], ir.Constant(ir.IntType(32), k)) for k in range(QUAD)
        ]
        return context.make_tuple(builder, sig.return_type, parts)

    return UniTuple(types.float64, QUAD)(quad), emit


@intrinsic
def sum_of_quad(typing_context, quad):
    """Sum of the lanes of a quad."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        parts = [
            builder.extract_element(args[0], ir.Constant(ir.IntType(32), k)) for k in range(QUAD)
        ]
        return builder.fadd(builder.fadd(parts[0], parts[1]), builder.fadd(parts[2], parts[3]))

    return types.float64(quad), emit


class LawCompiler(Compiler):
    """numba's compiler; it omits the entry from Python where an argument is none of Python's.

    Only compiled code calls a law with lanes. Without that entry it compiles in two thirds of the
    time.
    """

    def define_pipelines(self) -> Any:
        """Return numba's passes."""
        if any(map(_is_internal, self.state.args)):
            self.state.flags.no_cpython_wrapper = True
        return super().define_pipelines()


def _is_internal(kind: Any) -> bool:
    """Return whether no value of Python has this type."""
    if isinstance(kind, types.BaseTuple):
        return any(map(_is_internal, kind.types))
    return isinstance(kind, _OfLanes | NumberArrayType)
