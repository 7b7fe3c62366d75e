"""One source, two ways: compiled for floats, interpreted for AutoDiffXd; and the folder of compiled code."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

import wm_drake
from wm_drake.compiler import compilation, vectors
from wm_drake.compiler.compilation import generic
from wm_drake.elements import damper_law
from wm_drake.elements.bushing import read_bushing_law
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.motion import TubMotion
from wm_drake.elements.strut import strut_line, wrench_at_origin
from wm_drake.laws import bushing, damper, friction, spring, strut, table
from wm_drake.parameters.elements import ForceTable

# m, N
CURVE = packed_stiffness(
    ForceTable(displacement=(-0.02, -0.008, 0.008, 0.02), force=(-90.0, 0.0, 0.0, 120.0))
)
BUSHING = np.concatenate(
    [
        [
            50.0, 10.0, 50.0, 3.0, 5.0, 7.0, 3.7, 2.0, 1.0, 1.5, 1.0, 0.5,
        ],  # N s/m, N m s/rad, N m, rad/s
        *map(packed_stiffness, (8e3, 3e3, 8e3, 73.0, 890.0, 250.0)),  # N/m, N m/rad
    ]
)  # fmt: skip
STV = np.array([1.0, 60.0, 0.4, 25.0])  # number of the law, f_max, v_st, damping
MSTV = (60.0, 30.0, 1e-6, 176e3, 90.0, 400.0)  # f_max, c_m, epsilon, k1, c1, c2
FREE_STROKE = (35.0, 60.0, 1e-6, 10.5, 0.09)  # f_max, c_m, epsilon, p_b, v_b


def three(x, begin):
    return (x[begin], x[begin + 1], x[begin + 2])


def unit(a):
    """Return the unit vector of three scalars of any type."""
    length = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return (a[0] / length, a[1] / length, a[2] / length)


# Each law as a function of one flat list of numbers, all of order 1: name -> (count, law, call).
LAWS = {
    "coulomb": (1, friction.coulomb_friction, lambda f, x: f(x[0], 60.0)),
    "stv": (1, friction.stv_friction, lambda f, x: f(x[0], 0.6, 60.0)),
    "havsin": (1, friction.havsin_friction, lambda f, x: f(x[0], 0.6, 10.5)),
    "mstv": (2, friction.mstv_friction, lambda f, x: f(x[0], x[1], 35.0, 60.0, 1e-6)),
    "slider_rate": (2, damper.slider_rate, lambda f, x: f(100.0 * x[0], x[1], 490.0, 60.0, 0.0, 1e-6)),
    "root_as_quotient": (1, damper.root_as_quotient, lambda f, x: f(2.0, x[0], 3.0)),
    "mstv_damper": (2, damper.mstv_damper, lambda f, x: f(0.3 * x[0], 1e-3 * x[1], *MSTV)),
    "free_stroke_damper": (2, damper.free_stroke_damper, lambda f, x: f(0.2 * x[0], 0.015 * x[1], *FREE_STROKE, (CURVE, 0))),
    "damper_response": (2, damper_law.damper_response, lambda f, x: f(x[0], 0.01 * x[1], STV, 0)),
    "spring_tension": (1, spring.spring_tension, lambda f, x: f(0.2 + 0.02 * x[0], 0.2, 110.0, 40.0, (CURVE, 0))),
    "stiffness_force": (1, table.stiffness_force, lambda f, x: f(0.015 * x[0], CURVE, 0)),
    "bushing_force": (
        12,
        bushing.bushing_force,
        lambda f, x: f(
            three(x, 0),
            three(x, 3),
            three(x, 6),
            three(x, 9),
            _same_way(f, read_bushing_law)(BUSHING, 0),
        ),
    ),
    "strut_line": (12, strut_line, lambda f, x: f(TubMotion((), three(x, 3), three(x, 6), three(x, 9)), three(x, 0), (0.3, -0.2, 3.0))),
    "bending_moment": (9, strut.bending_moment, lambda f, x: f(unit(three(x, 0)), three(x, 3), unit(three(x, 6)), 12.0, 0.3, 0.9, 0.5)),
    "transverse_couple": (7, strut.transverse_couple, lambda f, x: f(three(x, 0), three(x, 3), 2.0 + x[6])),
    "wrench_at_origin": (9, wrench_at_origin, lambda f, x: f(three(x, 0), three(x, 3), three(x, 6))),
    "rotation_from_rpy": (3, vectors.rotation_from_rpy, lambda f, x: f(x[0], x[1], x[2])),
    "rotation_vector": (3, vectors.rotation_vector, lambda f, x: f(_same_way(f, vectors.rotation_from_rpy)(x[0], x[1], x[2]))),
    "rotation_vector_near_zero": (
        3,
        vectors.rotation_vector,
        lambda f, x: f(
            _same_way(f, vectors.rotation_from_rpy)(4e-3 * x[0], 4e-3 * x[1], 4e-3 * x[2])
        ),
    ),
    "rotation_vector_rate": (6, vectors.rotation_vector_rate, lambda f, x: f(three(x, 0), three(x, 3), 0.08)),
    "moment_from_rotation_vector": (6, vectors.moment_from_rotation_vector, lambda f, x: f(three(x, 0), three(x, 3), 0.08)),
}  # fmt: skip


def _same_way(f, other):
    """Return the other law compiled or interpreted, as f is."""
    return other if hasattr(f, "py_func") else generic(other)


def flat(answer):
    """Return a law's answer, a scalar or nested tuples, as one list."""
    return [x for part in answer for x in flat(part)] if isinstance(answer, tuple) else [answer]


def random_inputs(count, seed, cases):
    """Draw numbers with sizes between 0.15 and 0.9 and any sign: away from the kinks at zero."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.15, 0.9, (cases, count)) * rng.choice([-1.0, 1.0], (cases, count))


@pytest.mark.parametrize("name", LAWS)
def test_interpreted_law_equals_the_compiled_one(name):
    count, law, call = LAWS[name]
    for x in random_inputs(count, seed=11, cases=20):
        values = [float(value) for value in x]
        np.testing.assert_allclose(
            flat(call(generic(law), values)), flat(call(law, values)), rtol=1e-13, atol=1e-13
        )


@pytest.mark.parametrize("name", LAWS)
def test_autodiff_agrees_with_finite_differences(name):
    count, law, call = LAWS[name]
    h = 1e-5
    for x in random_inputs(count, seed=12, cases=10):
        answer = np.array(flat(call(generic(law), list(InitializeAutoDiff(x).ravel())))).reshape(
            -1, 1
        )
        values = ExtractValue(answer)
        np.testing.assert_allclose(
            values.ravel(), flat(call(law, list(map(float, x)))), rtol=1e-13, atol=1e-13
        )
        columns = []
        for step in h * np.eye(count):
            after, before = (
                np.array(flat(call(law, list(map(float, x + turn * step))))) for turn in (1.0, -1.0)
            )
            columns.append((after - before) / (2.0 * h))
        expected = np.column_stack(columns)
        scale = np.max(np.abs(expected), axis=1, keepdims=True) + np.abs(values)
        gradient = ExtractGradient(answer)
        assert np.max(np.abs(gradient - expected) / (scale + 1e-12)) < 1e-6


AT_REST = {  # what linearisation about the rest pose meets: name -> (count, law, call)
    "havsin": (1, friction.havsin_friction, lambda f, x: f(x[0], 0.6, 10.5)),
    "mstv_damper": (2, damper.mstv_damper, lambda f, x: f(x[0], x[1], *MSTV)),
    "free_stroke_damper": (2, damper.free_stroke_damper, lambda f, x: f(x[0], x[1], *FREE_STROKE, (CURVE, 0))),
    "rotation_vector": (3, vectors.rotation_vector, lambda f, x: f(_same_way(f, vectors.rotation_from_rpy)(x[0], x[1], x[2]))),
    "bushing_force": LAWS["bushing_force"],
    "bending_moment": (
        6,
        strut.bending_moment,
        lambda f, x: f(
            unit((x[0], x[1], 1.0 + x[2])), three(x, 3), (0.0, 0.0, 1.0), 12.0, 0.3, 0.9, 3.0
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", AT_REST)
def test_autodiff_agrees_with_finite_differences_at_rest_too(name):
    count, law, call = AT_REST[name]
    h = 1e-9
    answer = np.array(
        flat(call(generic(law), list(InitializeAutoDiff(np.zeros(count)).ravel())))
    ).reshape(-1, 1)
    assert not np.any(ExtractValue(answer))
    columns = []
    for step in h * np.eye(count):
        after, before = (
            np.array(flat(call(law, [float(s) for s in turn * step]))) for turn in (1.0, -1.0)
        )
        columns.append((after - before) / (2.0 * h))
    expected = np.column_stack(columns)
    np.testing.assert_allclose(
        ExtractGradient(answer), expected, rtol=1e-5, atol=1e-5 * np.max(np.abs(expected))
    )


def test_interpreted_laws_call_interpreted_laws_all_the_way_down():
    names = generic(damper_law.damper_response).__globals__
    (mstv,) = (law for law in names.values() if getattr(law, "__name__", "") == "mstv_damper")
    inner = mstv.__globals__["slider_rate"]
    assert inner is generic(damper.slider_rate)
    assert not hasattr(inner.__globals__["root_as_quotient"], "py_func")


def test_compiled_code_lies_in_a_folder_named_by_the_sources(tmp_path, monkeypatch):
    copy = tmp_path / "wm_drake"
    shutil.copytree(
        Path(wm_drake.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__")
    )
    monkeypatch.setattr(compilation, "_PACKAGE", copy)
    before = compilation._cache_folders()
    assert compilation._cache_folders() == before
    # laws that others call, the registry, and types whose fields are a packed order
    names = ("laws/friction.py", "compiler/vectors.py", "elements/friction_damper.py")
    for name in (*names, "parameters/damper_laws.py", "parameters/elements.py"):
        source = copy / name
        source.write_text(source.read_text() + "# changed\n")
        after = compilation._cache_folders()
        assert after != before
        before = after


def test_compiled_code_lies_where_the_user_says(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert Path(compilation._cache_folders()[0]).parent == tmp_path


def double(x):
    """Return two times x."""
    return 2.0 * x


def test_a_law_is_compiled_anew_if_nothing_can_be_stored(monkeypatch):
    def no_folder(function, _read_only):
        raise RuntimeError(f"cannot cache {function}: no locator available")

    monkeypatch.setattr(compilation, "LawCache", no_folder)
    assert compilation.law(double)(1.0) == 2.0
