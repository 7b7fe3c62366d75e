"""The multistep integrator: its formulas, its stability, and when it is chosen."""

import numpy as np
import pytest
from simple_machines import constant_speed, isotropic_machine, unbalance

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.linear import CABINET, SMOOTH, is_followed
from wm_drake.engines.compiled.multistep import (
    PAST_INPUTS,
    PAST_RATES,
    STEPS_BEFORE,
    explicit_multistep,
    extrapolated,
)
from wm_drake.engines.compiled.packing import pack
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.compiled.stepping import choose_stepping
from wm_drake.engines.schedule import schedule_of
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import MachineParameters, SpinProfile, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate


def weights():
    """Return the weights of f_0, f_1, ... in the formula of a step."""
    step = generic(explicit_multistep)
    ring = np.eye(PAST_RATES)[-np.arange(PAST_RATES)]  # f_j is at index -j
    return np.array([step(0.0, rates, 0, 0, 1, 1.0) for rates in ring])


def roots(z):
    """Return the roots of the characteristic polynomial of the formula at h lambda = z."""
    polynomial = np.append([1.0, -1.0], np.zeros(PAST_RATES - 1)).astype(complex)
    polynomial[1:] -= z * weights()
    return np.roots(polynomial)


@pytest.mark.parametrize("degree", range(4))
def test_a_step_is_exact_for_rates_up_to_the_third_power(degree):
    at = -np.arange(PAST_RATES, dtype=float)
    assert weights() @ at**degree == pytest.approx(1.0 / (degree + 1), rel=1e-12)


def test_the_fourth_power_has_the_error_constant_of_the_documentation():
    at = -np.arange(PAST_RATES, dtype=float)
    defect = 1.0 / 5.0 - weights() @ at**4
    assert defect / 24.0 == pytest.approx(251.0 / 720.0 - 0.2, rel=1e-10)


def test_an_input_is_extrapolated_along_its_parabola():
    past = np.empty(PAST_INPUTS)
    for i in range(7, 10):  # the ring begins anywhere
        for j in range(PAST_INPUTS):
            past[(i - j) % PAST_INPUTS] = 2.0 + 3.0 * j + 0.5 * j**2
        middle, end = generic(extrapolated)(past, i, 0, 1)
        assert middle == pytest.approx(2.0 - 3.0 * 0.5 + 0.5 * 0.25)
        assert end == pytest.approx(2.0 - 3.0 + 0.5)


def test_numbers_that_are_not_finite_are_not_followed():
    for entry in (np.nan, -1e12, -1e300):
        jacobians = np.full((WIDTH, 1, 1), entry)
        assert not is_followed(jacobians, np.array([False]), 1.0)


@pytest.mark.parametrize(
    ("unit", "limit"), [(-1.0, 0.38), (1j, 0.34)], ids=["decay", "oscillation"]
)
def test_the_linear_machine_grows_where_the_roots_leave_the_unit_circle(unit, limit):
    for size, followed in ((0.97 * limit, True), (1.06 * limit, False)):
        assert (np.abs(roots(unit * size)).max() < 1.0 + 1e-4) == followed
        matrix = np.array([[-size]]) if unit == -1.0 else np.array([[0.0, size], [-size, 0.0]])
        jacobians = np.tile(matrix, (WIDTH, 1, 1))
        assert is_followed(jacobians, np.full(len(matrix), False), 1.0) == followed


def amplification(bodies, pull, drive, decay):
    """Return the matrix of a step of length 1 of b' = bodies b + pull z, z' = drive b - decay z.

    Written apart from the compiled code, with its state b, z, the last five rates, two last inputs.
    """
    n, m = len(bodies), len(decay)

    def step(columns):
        b, z = columns[:n], columns[n : n + m]
        past = [columns[n + m + j * n :][:n] for j in range(PAST_RATES - 1)]
        u_1, u_2 = columns[-2 * m : -m], columns[-m:]
        f, u = bodies @ b + pull @ z, drive @ b
        moved = b + sum(w * rate for w, rate in zip(weights(), [f, *past], strict=True))

        def rate(s, z):
            parabola = (
                u + s * (1.5 * u - 2.0 * u_1 + 0.5 * u_2) + s * s * (0.5 * u - u_1 + 0.5 * u_2)
            )
            return parabola - decay[:, None] * z

        k_1 = rate(0.0, z)
        k_2 = rate(0.5, z + 0.5 * k_1)
        k_3 = rate(0.5, z + 0.5 * k_2)
        k_4 = rate(1.0, z + k_3)
        after = z + (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4) / 6.0
        return np.vstack([moved, after, f, *past[:-1], u, u_1])

    return step(np.eye(n + m + (PAST_RATES - 1) * n + 2 * m))


def test_machines_with_sponges_are_followed_where_the_whole_step_is_stable():
    """Compare growth with eigenvalues of random masses on springs, dashpots and sponges."""
    rng = np.random.default_rng(3)
    wrong, sides = 0, {True: 0, False: 0}
    for _ in range(120):
        n, m = 2, 2
        a, c, e = rng.normal(size=(n, n)), rng.normal(size=(n, n)), rng.normal(size=(m, n))
        stiffness = a @ a.T * 10.0 ** rng.uniform(-4.0, -1.0)
        damping = c @ c.T * 10.0 ** rng.uniform(-4.0, -0.5)
        decay = 10.0 ** rng.uniform(-1.5, 0.3, m)
        bodies = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
        pull = np.vstack([np.zeros((n, m)), -e.T * 10.0 ** rng.uniform(-4.0, -0.5, m)])
        drive = np.hstack([np.zeros((m, n)), e])
        size = np.abs(np.linalg.eigvals(amplification(bodies, pull, drive, decay))).max()
        if abs(size - 1.0) < 5e-3:  # too slow to be seen in a thousand steps
            continue
        jacobian = np.block([[bodies, pull], [drive, -np.diag(decay)]])
        internal = np.array([False] * (2 * n) + [True] * m)
        followed = is_followed(np.tile(jacobian, (WIDTH, 1, 1)), internal, 1.0)
        sides[followed] += 1
        wrong += followed != (size < 1.0)
    assert min(sides.values()) >= 10
    assert wrong == 0


def amplification_of_block(jacobian, alone, first):
    """Return the matrix of a step of length 1 of x' = jacobian x with a cabinet as its last part.

    Args:
        jacobian: Of all states.
        alone: Of the last states, from `first` on, under a constant input.
        first: Number of states of the multistep formula.
    """
    n, m = len(jacobian), len(alone)

    def step(columns):
        x = columns[:n]
        past = [columns[n + j * first :][:first] for j in range(PAST_RATES - 1)]
        u_1, u_2 = columns[-2 * m : -m], columns[-m:]
        f = jacobian @ x
        b, c = x[:first], x[first:]
        u = f[first:] - alone @ c
        moved = b + sum(w * rate for w, rate in zip(weights(), [f[:first], *past], strict=True))
        middle, end = 1.875 * u - 1.25 * u_1 + 0.375 * u_2, 3.0 * (u - u_1) + u_2
        k_1 = u + alone @ c
        k_2 = middle + alone @ (c + 0.5 * k_1)
        k_3 = middle + alone @ (c + 0.5 * k_2)
        k_4 = end + alone @ (c + k_3)
        after = c + (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4) / 6.0
        return np.vstack([moved, after, f[:first], *past[:-1], u, u_1])

    return step(np.eye(n + (PAST_RATES - 1) * first + 2 * m))


def test_machines_with_a_cabinet_are_followed_where_the_whole_step_is_stable():
    """Compare growth with eigenvalues of a body on a random cabinet on stiff feet."""
    rng = np.random.default_rng(4)
    wrong, sides = 0, {True: 0, False: 0}
    for _ in range(80):
        n, m = 2, 2  # coordinates of the body and of the cabinet
        a, c = rng.normal(size=(n + m, n + m)), rng.normal(size=(n + m, n + m))
        stiffness = a @ a.T * 10.0 ** rng.uniform(-4.0, -1.0)
        damping = c @ c.T * 10.0 ** rng.uniform(-4.0, -1.0)
        feet = np.diag(10.0 ** rng.uniform(-1.0, 1.2, m))
        rub = 0.3 * np.sqrt(feet)
        of_feet, of_rub = np.zeros_like(stiffness), np.zeros_like(stiffness)
        of_feet[n:, n:], of_rub[n:, n:] = feet, rub
        whole = np.block(
            [[np.zeros((n + m, n + m)), np.eye(n + m)], [-stiffness - of_feet, -damping - of_rub]]
        )
        order = [
            *range(n),
            *range(n + m, 2 * n + m),
            *range(n, n + m),
            *range(2 * n + m, 2 * n + 2 * m),
        ]
        whole = whole[np.ix_(order, order)]
        alone = np.block([[np.zeros((m, m)), np.eye(m)], [-feet, -rub]])
        size = np.abs(np.linalg.eigvals(amplification_of_block(whole, alone, 2 * n))).max()
        if abs(size - 1.0) < 5e-3:  # too slow to be seen in a thousand steps
            continue
        kinds = np.repeat([SMOOTH, CABINET], [2 * n, 2 * m])
        lanes = (np.tile(matrix, (WIDTH, 1, 1)) for matrix in (whole, alone))
        found = next(lanes)
        followed = is_followed(found, kinds, 1.0, next(lanes))
        sides[followed] += 1
        wrong += followed != (size < 1.0)
    assert min(sides.values()) >= 8
    assert wrong == 0


def test_a_cabinet_that_grows_by_itself_may_grow():
    growing = np.tile(np.array([[0.0, 1.0], [1e-4, 0.0]]), (WIDTH, 1, 1))
    assert is_followed(growing, np.full(2, CABINET), 1.0, growing)
    assert not is_followed(growing, np.full(2, SMOOTH), 1.0)
    assert is_followed(growing, np.full(2, SMOOTH), 1.0, may_grow=True)
    unstable = np.tile(np.array([[0.0, 1.0], [-4.0, 0.0]]), (WIDTH, 1, 1))
    assert not is_followed(unstable, np.full(2, SMOOTH), 1.0, may_grow=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["light_cabinet", "heavy_cabinet"])
def test_a_cabinet_takes_steps_of_one_derivative_with_the_peaks_of_small_steps(name):
    """Compare steps of 2.5 ms with a sixteenth of it by Runge-Kutta, with the motor."""
    drive = load_machine("motor").model_dump()["drive"]
    tree = load_machine(name).model_dump() | {"drive": drive}
    machine = build_machine(MachineParameters.model_validate(tree))
    profile = SpinProfile(time=(0.0, 0.5, 4.5), speed=(0.0, 5.0, 24.0))
    case = Case("front", machine.parameters.loads["front"], profile)
    usual = simulate(machine, case)
    fine = simulate(machine, case, step=2.5e-3 / 16, integrator="runge_kutta")
    assert (usual.attrs["integrator"], usual.attrs["step_s"]) == ("multistep", 2.5e-3)
    for variable in ("displacement", "cabinet_position", "cabinet_force", "floor_force"):
        largest = np.abs(fine[variable].values).max()
        assert np.abs(usual[variable].values).max() == pytest.approx(largest, rel=1e-3)
    slid = float(np.abs(fine.foot_slip).max())
    assert float(np.abs(usual.foot_slip).max()) == pytest.approx(slid, rel=1e-2, abs=1e-9)


def test_a_corner_is_followed_by_steps_of_four_derivatives():
    profile = SpinProfile(time=(0.0, 0.1, 0.2013, 0.4, 0.5), speed=(0.0, 1.0, 2.0, 4.0, 6.0))
    schedule = schedule_of(profile, 2.5e-3, 5e-3)
    begins = np.cumsum(schedule.step) - schedule.step
    changes = [0.0, 0.1, 0.2, 0.2013, 0.205, 0.4, 0.5]  # 0.2013 is between two samples
    for begin, alike in zip(begins, schedule.alike, strict=True):
        last = max(change for change in changes if change < begin + 1e-9)
        inside = (begins >= last - 1e-9) & (begins < begin - 1e-9)
        assert alike == np.count_nonzero(inside)


def test_halving_the_step_of_a_smooth_machine_reduces_the_error_sixteenfold():
    machine = build_machine(isotropic_machine())
    profile = SpinProfile(time=(0.0, 0.5, 2.0), speed=(8.0, 14.0, 20.0))

    def motion(step, integrator="multistep"):
        setup = machine.set_up(unbalance(1.0))
        run = run_compiled(setup, profile, step, lambda done: None, integrator=integrator)
        return run.state[:, 3:6]

    fine = motion(5e-3 / 32, "runge_kutta")
    coarse, half = (np.abs(motion(5e-3 / pieces) - fine).max() for pieces in (1, 2))
    assert np.abs(fine).max() > 1e-3
    assert 11.0 < coarse / half < 24.0


def variant(law, **numbers):
    """Return the reference machine with dampers of another law."""
    tree = load_machine("reference").model_dump()
    kind = {"law": law, "end_bushing": tree["damper_types"]["friction"]["end_bushing"]} | numbers
    return MachineParameters.model_validate(tree | {"damper_types": {"friction": kind}})


def havsin(velocity):
    return variant("havsin", friction_force=25.0, full_friction_velocity=velocity)


MSTV = load_machine("reference")
CHOICES = {
    "reference": (MSTV, 42.0, 2.5e-3, "multistep", 2.5e-3),
    "1400 rpm": (MSTV, 146.6, 2.5e-3, "multistep", 1.25e-3),
    "1400 rpm at 1 ms": (MSTV, 146.6, 1e-3, "multistep", 0.625e-3),
    "2000 rpm": (MSTV, 209.4, 2.5e-3, "multistep", 0.625e-3),
    "longer step": (MSTV, 42.0, 5e-3, "multistep", 2.5e-3),
    "Coulomb friction": (variant("coulomb", friction_force=25.0), 42.0, 2.5e-3, "runge_kutta", 2.5e-3),
    "smooth friction": (havsin(0.1), 42.0, 2.5e-3, "multistep", 2.5e-3),
    "sharp friction": (havsin(0.006), 42.0, 2.5e-3, "runge_kutta", 2.5e-3),
}  # fmt: skip


@pytest.mark.parametrize(("parameters", "speed", "step", "integrator", "chosen"), CHOICES.values(),
                         ids=CHOICES)  # fmt: skip
def test_the_integrator_suits_laws_and_speed(parameters, speed, step, integrator, chosen):
    setup = build_machine(parameters).set_up()
    stepping = choose_stepping(setup, *pack(setup), constant_speed(speed, 1.0), step)
    assert (stepping.integrator, stepping.step) == (integrator, pytest.approx(chosen))


def test_both_integrators_can_be_named(machine, reference):
    case = Case(
        "middle", reference.loads["middle"], SpinProfile(time=(0.0, 4.0), speed=(0.0, 20.0))
    )
    records = {
        name: simulate(machine, case, integrator=name)
        for name in ("auto", "multistep", "runge_kutta")
    }
    assert records["auto"].identical(records["multistep"])
    assert records["auto"].attrs["integrator"] == "multistep"
    assert records["runge_kutta"].attrs["integrator"] == "runge_kutta"
    by_rk, by_multistep = (records[name].displacement for name in ("runge_kutta", "multistep"))
    np.testing.assert_allclose(by_multistep, by_rk, atol=2e-3 * float(np.abs(by_rk).max()))
    assert np.abs(by_multistep - by_rk).max() > 0.0
    with pytest.raises(InputError, match=r"^integrator: no integrator 'rk4'"):
        simulate(machine, case, integrator="rk4")


def test_a_multistep_that_would_blow_up_is_refused():
    machine = build_machine(havsin(0.006))
    case = Case("middle", machine.parameters.loads["middle"], constant_speed(20.0, 1.0))
    with pytest.raises(InputError, match=r"^integrator: 'multistep' does not follow .* allowed"):
        simulate(machine, case, integrator="multistep")
    assert simulate(machine, case).attrs["integrator"] == "runge_kutta"


def test_a_machine_file_names_its_integrator(reference):
    parameters = reference.model_copy(update={"integrator": "runge_kutta"})
    case = Case("middle", reference.loads["middle"], constant_speed(20.0, 0.1))
    record = simulate(build_machine(parameters), case)
    assert record.attrs["integrator"] == "runge_kutta"


def test_steps_before_are_those_whose_rates_are_used():
    assert STEPS_BEFORE == PAST_RATES - 1
    assert STEPS_BEFORE >= PAST_INPUTS - 1
