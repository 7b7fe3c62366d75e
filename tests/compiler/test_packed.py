"""Named packed layouts: packing, readers compiled and interpreted, offsets, structure, wrong values."""

import numpy as np
import pytest
from pydrake.autodiffutils import InitializeAutoDiff

from wm_drake.compiler.compilation import generic, law
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, numbers, rows_to_lanes
from wm_drake.compiler.elementary import whole_number as whole
from wm_drake.compiler.lanes import WIDTH, lane_array
from wm_drake.compiler.packed import ARRAY, LAYOUT, SCALAR, VECTOR, PackedLayout, PackedPart


@law
def list_size(p, at):
    return 1 + whole(p[at])


LIST = PackedPart(list_size, lambda p, at: [whole(p[at])])
INNER = PackedLayout("InnerNumbers", mass=SCALAR, points=LIST, name_behind=SCALAR)
OUTER = PackedLayout(
    "OuterNumbers", place=VECTOR, gain=SCALAR, inner=LAYOUT(INNER), pair=ARRAY(2), last=LIST
)
read_inner, read_outer = INNER.read, OUTER.read


def packed_list(*values):
    return np.array([len(values), *values], dtype=float)


PACKED = OUTER.pack(
    place=(1.0, 2.0, 3.0),
    gain=4.0,
    inner=INNER.pack(mass=5.0, points=packed_list(6.0, 7.0), name_behind=8.0),
    pair=(9.0, 10.0),
    last=packed_list(),
)


@law
def all_numbers(p, at):
    outer = read_outer(p, at)
    inner = read_inner(*outer.inner)
    points, first = inner.points
    x, y, z = outer.place
    total = x + 10.0 * y + 100.0 * z
    return total, outer.gain * inner.mass, points[first + 2], inner.name_behind, outer.pair[1]


EXPECTED = (321.0, 20.0, 7.0, 8.0, 10.0)


@law
def all_numbers_of_floats(p):
    return all_numbers(numbers(p), 2)


@law
def all_numbers_of_lanes(rows, answers):
    own, out = np.empty(rows.shape[1] * WIDTH), np.empty(answers.shape[1] * WIDTH)
    rows_to_lanes(rows, 0, own)
    p, answer = lane_array(own), lane_array(out)
    found = all_numbers(p, 2)
    answer[0], answer[1], answer[2], answer[3], answer[4] = found
    lanes_to_rows(out, 0, answers)


def test_numbers_are_packed_in_the_order_of_the_declaration():
    assert PACKED.tolist() == [1, 2, 3, 4, 5, 2, 6, 7, 8, 9, 10, 0]


def test_the_reader_finds_what_was_packed_compiled_and_interpreted():
    shifted = np.concatenate([[0.5, 0.5], PACKED])
    assert all_numbers(shifted, 2) == EXPECTED
    assert all_numbers_of_floats(shifted) == EXPECTED
    assert generic(all_numbers)(shifted, 2) == EXPECTED


def test_the_reader_works_for_lanes_of_different_numbers():
    rows = np.concatenate([[0.5, 0.5], PACKED]) * np.ones((WIDTH, 1))
    rows[:, 6] = np.arange(WIDTH)  # the mass
    answers = np.empty((WIDTH, 5))
    all_numbers_of_lanes(rows, answers)
    expected = np.tile(EXPECTED, (WIDTH, 1))
    expected[:, 1] = 4.0 * np.arange(WIDTH)
    np.testing.assert_array_equal(answers, expected)
    assert in_each_lane(rows[0]).shape == (WIDTH * rows.shape[1],)


def test_derivatives_pass_through_the_interpreted_reader():
    p = InitializeAutoDiff(PACKED).ravel()
    _, product, point, _, _ = generic(all_numbers)(p, 0)
    expected = np.zeros(len(PACKED))
    expected[3], expected[4] = 5.0, 4.0
    np.testing.assert_array_equal(product.derivatives(), expected)
    np.testing.assert_array_equal(point.derivatives(), np.eye(len(PACKED))[7])


def test_structure_is_what_must_be_equal_in_a_batch():
    assert OUTER.structure(PACKED) == [2, 0]
    assert OUTER.structure(np.concatenate([[0.5], PACKED]), 1) == [2, 0]
    other = INNER.pack(mass=1.0, points=packed_list(1.0), name_behind=0.0)
    assert INNER.structure(other) == [1]


def test_fields_of_fixed_place_have_an_offset_and_can_be_replaced():
    assert OUTER.offsets == {"place": 0, "gain": 3, "inner": 4}
    changed = OUTER.replaced(PACKED, place=(7.0, 8.0, 9.0), gain=0.0)
    assert changed.tolist() == [7, 8, 9, 0, *PACKED[4:]]
    assert PACKED[0] == 1.0
    with pytest.raises(KeyError, match="pair"):
        OUTER.replaced(PACKED, pair=(0.0, 0.0))


STATE = PackedLayout("StateNumbers", place=VECTOR, angle=SCALAR)
write_state = STATE.write


@law
def written(p, place):
    write_state(p, 1, place, angle=4.0)
    return p


def test_the_writer_is_the_inverse_of_the_reader():
    for function in (written, generic(written)):
        p = function(np.zeros(6), (1.0, 2.0, 3.0))
        assert p.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 0.0]
        assert STATE.unpack(p, 1) == ((1.0, 2.0, 3.0), 4.0)
    assert OUTER.write is None


def test_a_part_of_fixed_size_moves_no_offset():
    layout = PackedLayout("Nested", first=LAYOUT(STATE), gain=SCALAR, last=LIST)
    assert layout.offsets == {"first": 0, "gain": 4, "last": 5}
    packed = layout.pack(first=range(4), gain=7.0, last=packed_list(8.0))
    assert STATE.unpack(*layout.unpack(packed).first) == ((0.0, 1.0, 2.0), 3.0)
    assert layout.unpack(packed).gain == 7.0
    assert PackedLayout("Twice", a=LAYOUT(STATE), b=LAYOUT(STATE)).fixed_size == 8


def test_only_a_layout_without_variable_parts_has_a_fixed_size():
    assert PackedLayout("Fixed", place=VECTOR, pair=ARRAY(2)).fixed_size == 5
    with pytest.raises(ValueError, match="OuterNumbers has no fixed size"):
        _ = OUTER.fixed_size
    assert OUTER.size(PACKED, 0) == len(PACKED)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"mass": 1.0, "points": packed_list()}, "InnerNumbers: values and fields differ in name"),
        ({"mass": 1.0, "points": packed_list(), "name_behind": 0.0, "weight": 1.0}, "InnerNumbers: values and fields differ in weight"),
        ({"mass": (1.0, 2.0), "points": packed_list(), "name_behind": 0.0}, "InnerNumbers: mass has 2 numbers; allowed are 1"),
    ],
)  # fmt: skip
def test_wrong_values_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        INNER.pack(**values)


def test_a_part_without_a_size_must_be_last():
    open_ended = PackedPart(None, lambda p, at: [])
    with pytest.raises(ValueError, match="Odd: the part before 'behind' has no size"):
        PackedLayout("Odd", law=open_ended, behind=SCALAR)
    assert PackedLayout("Even", before=SCALAR, law=open_ended).size is None
