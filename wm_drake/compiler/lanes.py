"""Lanes: a scalar type of the compiler that holds several numbers for the processor's vector units.

A law that is compiled for floats can be compiled for lanes as well: every number in it is then
`WIDTH` numbers, one for each run, and every operation acts on each of them separately. Operations
are those of IEEE arithmetic, none reordered, products and sums fused where the processor can. So
each lane has the result of the law for floats, whatever its neighbours contain. A law qualifies if
it chooses with `elementary.where` instead of `if`. What is equal in all lanes (the number of a law,
the points of a table) can be read with `int`, which takes the first lane.

The vectors are LLVM's: on a processor with narrower units the same code takes several instructions
for one.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

from wm_drake.compiler.inlined import InlinedLibrary, has_indices
from wm_drake.compiler.numba_internals import (
    AbstractTemplate,
    Compiler,
    Conversion,
    cgutils,
    infer_global,
    signature,
)

WIDTH = 8
"""Runs side by side: one register of 512 bits, two of 256."""

_FIRST = ir.Constant(ir.IntType(32), 0)
_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)


class _InternalType(types.Type):
    """A type of compiled code that no Python value has. There is one of each, with this name."""

    def __init__(self) -> None:
        """Name the type after its class."""
        super().__init__(type(self).__name__.removesuffix("Type"))


class LanesType(_InternalType):
    """Type of `WIDTH` floats; a number that meets it becomes the same number in each lane."""

    def can_convert_from(self, typingctx: Any, other: Any) -> Conversion | None:
        """Return how a number converts; None for other types."""
        return Conversion.promote if isinstance(other, types.Float | types.Integer) else None

    def unify(self, typingctx: Any, other: Any) -> "LanesType | None":
        """Return the type of a variable that is a number in one branch and lanes in another."""
        return self if isinstance(other, types.Float | types.Integer) else None


class MaskType(_InternalType):
    """Type of the result of a comparison of lanes: one truth value for each lane."""


class LaneArrayType(_InternalType):
    """Type of an array of lanes over a contiguous array of floats.

    Entry i is the numbers from index i * WIDTH to (i + 1) * WIDTH.
    """


class NumberArrayType(_InternalType):
    """Type of a contiguous array of floats whose indices never count from its end.

    The check for a negative index takes a third of the time of a law.
    """


LANES, MASK, LANE_ARRAY, NUMBER_ARRAY = LanesType(), MaskType(), LaneArrayType(), NumberArrayType()
_ENTRIES = {NUMBER_ARRAY: types.float64, LANE_ARRAY: LANES}


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
def _in_each_lane(context: Any, builder: Any, given: Any, lanes: Any, value: Any) -> Any:
    number = context.cast(builder, value, given, types.float64)
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    order = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(
        builder.insert_element(undefined, number, _FIRST), undefined, order
    )


def _declare(
    operation: Any,
    kinds: tuple[Any, ...],
    result: Any,
    emit: Callable[..., Any],
    mixed: bool = False,
) -> None:
    """Add an operation on `kinds` to the compiler.

    With `mixed`, some of the arguments may be numbers, which become lanes.
    """

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


def _calculate(name: str) -> Callable[..., Any]:
    return lambda builder, a, b: getattr(builder, name)(a, b)


def _compare(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


def _llvm(builder: Any, name: str, lanes: Any) -> Any:
    """Call one of LLVM's functions of a vector."""
    kind = ir.FunctionType(_VECTOR, [_VECTOR])
    function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64")
    return builder.call(function, [lanes])


def _first_as_integer(builder: Any, lanes: Any) -> Any:
    return builder.fptosi(builder.extract_element(lanes, _FIRST), ir.IntType(64))


for _operation, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _declare(_operation, (LANES, LANES), LANES, _calculate(_name), mixed=True)
for _operation, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
):
    _declare(_operation, (LANES, LANES), MASK, _compare(_sign), mixed=True)
_declare(operator.and_, (MASK, MASK), MASK, _calculate("and_"))
_declare(operator.or_, (MASK, MASK), MASK, _calculate("or_"))
_declare(operator.neg, (LANES,), LANES, lambda builder, a: builder.fneg(a))
_declare(abs, (LANES,), LANES, lambda builder, a: _llvm(builder, "fabs", a))
_declare(int, (LANES,), types.int64, _first_as_integer)


@intrinsic
def lanes_sqrt(typing_context, x):
    """Return the square root in each lane."""
    return x(x), lambda context, builder, sig, args: _llvm(builder, "sqrt", args[0])


@intrinsic
def lanes_floor(typing_context, x):
    """Return the largest whole number not above, in each lane."""
    return x(x), lambda context, builder, sig, args: _llvm(builder, "floor", args[0])


@intrinsic
def lanes_select(typing_context, condition, a, b):
    """Return `a` where the condition holds, else `b`, in each lane."""
    return LANES(MASK, LANES, LANES), lambda context, builder, sig, args: builder.select(*args)


def _compare_mask(sign: str, bits: int) -> Callable[..., Any]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole = ir.IntType(WIDTH)
        return builder.icmp_unsigned(
            sign, builder.bitcast(args[0], whole), ir.Constant(whole, bits)
        )

    return emit


@intrinsic
def lanes_any(typing_context, condition):
    """Return whether the condition holds in any lane."""
    return types.boolean(condition), _compare_mask("!=", 0)


@intrinsic
def lanes_all(typing_context, condition):
    """Return whether the condition holds in all lanes."""
    return types.boolean(condition), _compare_mask("==", 2**WIDTH - 1)


@intrinsic
def lane_array(typing_context, array):
    """Return a contiguous array of floats as an array of lanes; its bounds are not checked.

    The array of floats must outlive it: see `keep`.
    """
    return (LANE_ARRAY(array), _address_of) if _is_flat(array) else None


@intrinsic
def number_array(typing_context, array):
    """Return a contiguous array of floats as a `NumberArrayType`; its bounds are not checked.

    The array of floats must outlive it: see `keep`.
    """
    return (NUMBER_ARRAY(array), _address_of) if _is_flat(array) else None


@intrinsic
def stack_array(typing_context, shape):
    """Return an array of floats on the stack of the calling function, of one or two dimensions."""
    is_tuple = isinstance(shape, types.BaseTuple)
    array = types.Array(types.float64, len(shape) if is_tuple else 1, "C")

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        sizes = cgutils.unpack_tuple(builder, args[0]) if is_tuple else [args[0]]
        word = context.get_value_type(types.intp)
        sizes = [builder.sext(n, word) if n.type.width < word.width else n for n in sizes]
        strides: list[Any] = []
        stride = word(8)
        for n in reversed(sizes):
            strides.insert(0, stride)
            stride = builder.mul(stride, n)
        made = context.make_array(array)(context, builder)
        count = builder.udiv(stride, word(8))
        context.populate_array(
            made,
            data=builder.alloca(ir.DoubleType(), count),
            shape=sizes,
            strides=strides,
            itemsize=8,
            meminfo=None,
        )
        return made._getvalue()

    return array(shape), emit


@intrinsic
def keep(typing_context, array):
    """Do nothing but use an array, so that its memory is not freed before.

    numba frees an array of a function after its last use, whatever points to it. A function that
    makes an array and then only uses its `lane_array` or `number_array` must end with this.
    """

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.get_dummy_value()

    return types.none(array), emit


def _is_flat(array: Any) -> bool:
    return isinstance(array, types.Array) and array.dtype == types.float64 and array.layout == "C"


def _address_of(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return context.make_array(sig.args[0])(context, builder, args[0]).data


@intrinsic
def align_stack(typing_context):
    """Align the vectors on the stack of the calling function, so that one load reads each."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        with builder.goto_entry_block():
            slot = builder.alloca(_VECTOR)
            slot.align = 64
        # an address that is passed to an (empty) piece of assembly cannot be optimised away
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


class LawCompiler(Compiler):
    """numba's compiler, without machine code where no Python value can be an argument.

    Only compiled code calls a law with lanes, and contains it. The entry from Python would take a
    quarter of the time to compile, the machine code a sixth.
    """

    def define_pipelines(self) -> Any:
        """Return numba's passes."""
        if any(_is_internal(kind) or has_indices(kind) for kind in self.state.args):
            _leave_out_machine_code(self.state)
        return super().define_pipelines()


class TextCompiler(Compiler):
    """numba's compiler for functions that other programs run: only their text of LLVM is needed."""

    def define_pipelines(self) -> Any:
        """Return numba's passes."""
        _leave_out_machine_code(self.state)
        return super().define_pipelines()


def _leave_out_machine_code(state: Any) -> None:
    """Compile a function without machine code and entry from Python."""
    state.flags.no_cpython_wrapper = True
    state.library = InlinedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
    state.library.enable_object_caching()


def _is_internal(kind: Any) -> bool:
    """Return whether no Python value has this type."""
    if isinstance(kind, types.BaseTuple):
        return any(map(_is_internal, kind.types))
    return isinstance(kind, _InternalType)
