"""Modes against closed forms, Drake's linearisation and a published rotor."""

import numpy as np
import pytest
from drake_spectrum import drake_spectrum
from simple_machines import DAMPING, MASS, STIFFNESS, isotropic_machine

import wm_drake as wm
from wm_drake.model.build import build_machine
from wm_drake.parameters import with_values
from wm_drake.parameters.machine import BodyOverride, InertiaMatrix
from wm_drake.studies.modes.amplitude import amplitude_modes
from wm_drake.studies.modes.campbell import campbell, critical_speeds, diagram_of, mac
from wm_drake.studies.modes.data import at_amplitude
from wm_drake.studies.modes.linearisation import (
    SLIDING,
    STUCK,
    Linearisation,
    Spectrum,
    spectrum_of,
)
from wm_drake.studies.modes.sensitivity import sensitivities
from wm_drake.studies.modes.shapes import ANGLE_ARM, modes_of, names_at_speed
from wm_drake.studies.modes.study import three_linearisations

BALL_INERTIA, BALLS = 0.3, 6
"""Inertia of each of the six bodies of the isotropic machine, and their number. [kg m^2]"""


@pytest.fixture(scope="module")
def isotropic():
    return build_machine(isotropic_machine())


def linearised(machine, **options):
    return Linearisation(machine.set_up(**options))


def test_frequency_and_damping_of_one_mass_are_those_of_the_closed_form(isotropic):
    found = linearised(isotropic).spectrum()
    hertz = np.sqrt(STIFFNESS / MASS) / (2.0 * np.pi)
    near = np.argsort(np.abs(found.frequency_hz - hertz))[:3]
    np.testing.assert_allclose(found.frequency_hz[near], hertz, rtol=1e-6)
    ratio = DAMPING / (2.0 * np.sqrt(STIFFNESS * MASS))
    np.testing.assert_allclose(found.damping_ratio[near], ratio, rtol=1e-6)


@pytest.mark.parametrize("options", [{}, {"friction": False}, {"dampers": False}])
@pytest.mark.parametrize("name", ["reference", "free_stroke"])
def test_compiled_linearisation_is_drakes(name, options, shipped):
    machine = shipped(name)
    ours = linearised(machine, **options).spectrum().first(6)
    drakes = drake_spectrum(machine.set_up(**options)).first(6)
    # the tables of gaskets bend at their points: differences see it to 1e-7
    np.testing.assert_allclose(ours.values, drakes.values, rtol=2e-6)


def test_gyroscopic_splitting_is_that_of_the_closed_form(isotropic):
    """Solve I a'' +- J Omega b' + k a = 0 across the axis: w = sqrt(k/I + g^2) +- g."""
    linear = linearised(isotropic)
    inertia, stiffness = BALLS * BALL_INERTIA, 4000.0
    for rpm in (0.0, 300.0, 1200.0):
        speed = rpm * np.pi / 30.0
        g = 0.5 * BALL_INERTIA * speed / inertia
        wanted = np.sqrt(stiffness / inertia + g * g) + np.array([-g, g])
        found = np.abs(linear.spectrum(speed).values)
        for frequency in wanted:
            assert np.min(np.abs(found / frequency - 1.0)) < 1e-6


def test_modes_are_joined_by_shape_where_frequencies_cross():
    """Plant two uncoupled oscillators whose frequencies cross."""

    def spectrum_at(speed):
        matrix = np.zeros((4, 4))
        for at, stiffness in ((0, (10.0 + speed) ** 2), (2, (15.0 - speed) ** 2)):
            matrix[at : at + 2, at : at + 2] = [[0.0, 1.0], [-stiffness, -0.1]]
        return spectrum_of(matrix)

    spectra, _ = campbell(spectrum_at, np.linspace(0.0, 5.0, 6), 2)
    found = [np.abs(spectrum.values) for spectrum in spectra]
    np.testing.assert_allclose(found, [[10.0 + s, 15.0 - s] for s in range(6)], rtol=1e-9)


def test_coupled_modes_veer_and_are_joined_all_the_same():
    """Couple them: the frequencies do not cross, and curves stay smooth and apart."""

    def spectrum_at(speed):
        a, b, c = (10.0 + speed) ** 2, (15.0 - speed) ** 2, 25.0
        stiffness = np.array([[a + c, -c], [-c, b + c]])
        matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -0.01 * np.eye(2)]])
        return spectrum_of(matrix)

    spectra, macs = campbell(spectrum_at, np.linspace(0.0, 5.0, 51), 2)
    assert all(np.abs(spectrum.values[0]) < np.abs(spectrum.values[1]) for spectrum in spectra)
    assert macs.min() > 0.9


def test_mac_of_a_spectrum_with_itself_is_the_unit_matrix(machine):
    found = linearised(machine).spectrum().first(6)
    np.testing.assert_allclose(mac(found, found), np.eye(6), atol=1e-9)


def overhung_disc(disc_effect):
    """Return a machine that is a thin disc at the end of a massless cantilever shaft.

    The shaft of length l and bending stiffness E I has at its end the stiffness (12, -6 l, 4 l^2) E
    I / l^3 of deflection and slope: that of one spring k = 12 E I / l^3 at half its length and one
    torsion spring E I / l. The disc effect is D = 3 I_d / (m l^2).
    """
    mass, transverse = MASS, 0.3
    length = np.sqrt(3.0 * transverse / (disc_effect * mass))
    bending = 5000.0
    parameters = isotropic_machine(
        12.0 * bending / length**3, 0.0, rotational_stiffness=bending / length
    )
    light = BodyOverride(
        mass=7.0, centre_of_mass=(0.0, 0.0, 0.0), inertia=InertiaMatrix(xx=1e-6, yy=1e-6, zz=1e-6)
    )
    drum = light.model_copy(
        update={"inertia": InertiaMatrix(xx=transverse, yy=2.0 * transverse, zz=transverse)}
    )
    bodies = {name: drum if name == "drum" else light for name in parameters.bodies}
    half = {"position": (0.0, 0.5 * length, 0.0)}
    frames = {"gasket_tub": half, "gasket_housing": half}
    tree = parameters.model_dump() | {
        "bodies": {name: body.model_dump() for name, body in bodies.items()},
        "frames": frames,
    }
    unit = np.sqrt(3.0 * bending / (mass * length**3))
    return build_machine(type(parameters).model_validate(tree)), unit


def test_overhung_disc_has_the_published_frequencies_and_critical_speed():
    """Take a gyroscopic disc on a cantilever shaft, disc effect D = 1.

    Source: J. P. Den Hartog, Mechanical Vibrations, 4th ed., section on gyroscopic effects: the
    forward critical speeds satisfy K^4 + K^2 (4/D - 4) - 4/D = 0, so K = sqrt(2) at D = 1. R.
    Tiwari, Rotor Dynamics (NPTEL), module 5, lecture 3, text below Fig. 5.31, gives 0.74 and 2.73
    for a disc that does not rotate; they are read from the figure, so that 0.01 is allowed. The
    exact roots are those of K^4 - 8 K^2 + 4 = 0. Frequencies in units of sqrt(3 E I / (m l^3)).
    """
    machine, unit = overhung_disc(1.0)
    linear = linearised(machine)
    still = np.abs(linear.spectrum().values) / unit
    for published, exact in (
        (0.74, np.sqrt(4.0 - np.sqrt(12.0))),
        (2.73, np.sqrt(4.0 + np.sqrt(12.0))),
    ):
        assert np.min(np.abs(still - published)) < 0.01
        assert np.min(np.abs(still - exact)) < 1e-4
    # backward and forward whirl, and motions along and about the axis, which do not change
    grid = np.linspace(0.0, 2.6 * unit, 81)
    diagram = diagram_of(grid, *campbell(linear.spectrum, grid, 6), [[""] * 6] * 81)
    speeds = critical_speeds({SLIDING: diagram}, (1.0,)).speed.values / unit
    for published in (np.sqrt(2.0), 0.5125, 2.2516):  # forward; backward, from 3 I_d for -I_d
        assert np.min(np.abs(speeds - published)) < 1e-3


def test_names_energies_and_participation_of_one_mass(isotropic):
    linear = linearised(isotropic)
    modes = modes_of(linear.spectrum().first(6), linear.wrench_slopes())
    assert sorted(mode.name for mode in modes) == sorted(
        ["sway", "fore-aft", "bounce", "roll", "pitch", "yaw"]
    )
    gasket = linear.names.index("gasket")
    for mode in modes:
        assert mode.strain_energy[gasket] == pytest.approx(1.0, abs=1e-6)
        assert mode.participation.sum() == pytest.approx(1.0)


def test_energy_is_shared_as_the_stiffness_is(isotropic):
    """Put two springs in parallel: along x, the part of each is its stiffness over the sum."""
    stiff = with_values(isotropic.parameters, {"spring_types.suspension.stiffness": 0.0})
    assert stiff.gasket is not None
    linear = linearised(isotropic)
    slopes = linear.wrench_slopes()
    both = np.concatenate([slopes, 3.0 * slopes[-1:]])  # a second gasket, three times as stiff
    for mode in modes_of(linear.spectrum().first(6), both):
        assert mode.strain_energy[-1] == pytest.approx(0.75, abs=1e-6)


def test_turning_modes_are_named_by_their_shape_where_curves_cross():
    """Let forward whirl rise from below the translations to above them: w = sqrt(k/I + g^2) + g."""
    stiffness, inertia = 250.0, BALLS * BALL_INERTIA
    linear = linearised(build_machine(isotropic_machine(rotational_stiffness=stiffness)))
    whirl, translation = np.sqrt(stiffness / inertia), np.sqrt(STIFFNESS / MASS)
    assert whirl < translation
    for speed in (30.0, 100.0, 180.0):
        spectrum = linear.spectrum(speed).first(6)
        found = dict(zip(names_at_speed(spectrum), np.abs(spectrum.values), strict=True))
        g = 0.5 * BALL_INERTIA * speed / inertia
        ends = np.sqrt(whirl**2 + g * g) + np.array([g, -g])
        wanted = {"forward whirl": ends[0], "backward whirl": ends[1]}
        wanted |= dict.fromkeys(("sway", "fore-aft", "bounce"), translation)
        assert {name: found[name] for name in wanted} == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("friction", [True, False])
def test_names_at_speed_are_those_of_the_kinetic_energy(machine, friction):
    """Compare with the kinetic energy in each coordinate, by the mass matrix of the diagram."""
    setup = machine.set_up(friction=friction)
    tub = machine.state_layout.tub
    masses = machine.plant.CalcMassMatrix(setup.plant_context)[np.ix_(tub, tub)]
    linear = Linearisation(setup)
    parts = {
        "bounce": [5],
        "pitch": [1],
        "sway": [3, 4],  # they share these two motions
        "fore-aft": [3, 4],
        "forward whirl": [0, 2],
        "backward whirl": [0, 2],
    }
    spectrum = linear.spectrum(1800.0 * np.pi / 30.0).first(6)
    names = names_at_speed(spectrum)
    assert sorted(names) == sorted(parts)
    for name, vector in zip(names, spectrum.right.T, strict=True):
        rates = vector[6:12]
        energy = np.real(np.conj(rates) * (masses @ rates))
        assert energy[parts[name]].sum() > 0.55 * energy.sum()
    hertz = dict(zip(names, spectrum.frequency_hz, strict=True))
    assert hertz["forward whirl"] > 1.3 * hertz["bounce"] > 1.3 * hertz["backward whirl"]


def test_sensitivities_of_one_mass_are_those_of_the_closed_form(isotropic):
    """Check that f is as the root of k, and zeta as c over the root of k."""
    linear = linearised(isotropic)
    spectrum = linear.spectrum()
    named = modes_of(spectrum.first(6), linear.wrench_slopes())
    sway = next(index for index, mode in enumerate(named) if mode.name == "sway")

    def matrix_of(parameters):
        return Linearisation(isotropic.set_up(parameters=parameters)).matrix()

    found = sensitivities(isotropic.parameters, spectrum.first(6), matrix_of, False)
    ratio = DAMPING / (2.0 * np.sqrt(STIFFNESS * MASS))
    keys = ["gasket.stiffness_x", "gasket.damping_x"]
    of_sway = found.sel(key=keys).isel(mode=sway)
    assert of_sway.relative_change_of_frequency.values == pytest.approx(
        [0.5, 0.0], rel=1e-3, abs=1e-6
    )
    assert of_sway.change_of_damping_ratio.values == pytest.approx([-0.5 * ratio, ratio], rel=1e-3)


def test_sensitivity_is_the_difference_of_modes(machine):
    """Predict the modes of a machine with stiffer springs by the derivative."""
    key = "spring_types.suspension.stiffness"
    parameters = machine.parameters
    before = linearised(machine).spectrum().first(6)

    def matrix_of(changed):
        return Linearisation(machine.set_up(parameters=changed)).matrix()

    slopes = sensitivities(parameters, before, matrix_of, False).sel(key=key)
    stiffness = parameters.spring_types["suspension"].stiffness
    stiffer = with_values(parameters, {key: 1.01 * stiffness})
    after = spectrum_of(matrix_of(stiffer)).first(6)
    np.testing.assert_allclose(
        after.frequency_hz / before.frequency_hz - 1.0,
        0.01 * slopes.relative_change_of_frequency,
        atol=3e-5,
    )


def test_small_amplitude_mode_is_the_natural_mode(isotropic):
    linear = linearised(isotropic)
    spectrum = linear.spectrum().first(6)
    modes = modes_of(spectrum, linear.wrench_slopes())
    names = [mode.name for mode in modes]
    found = amplitude_modes(isotropic.set_up(), spectrum, names, np.array([1e-5, 1e-3]))
    for natural in modes:
        mode = found.isel(row=(found.mode == natural.name).values)
        assert mode.frequency[0] == pytest.approx(natural.frequency_hz, rel=1e-5)
        assert mode.damping_ratio[0] == pytest.approx(natural.damping_ratio, abs=1e-6)


def vertical_friction_damper(force, transition):
    """Return an isotropic machine with one friction damper far below the tub, along z."""
    parameters = isotropic_machine(damping=0.0)
    tree = parameters.model_dump() | {
        "damper_types": {
            "friction": {"law": "stv", "friction_force": force, "transition_velocity": transition}
        },
        "dampers": {
            "below": {
                "type": "friction",
                "tub_frame": "damper_left_tub",
                "housing_frame": "damper_left_housing",
            }
        },
    }
    tree["frames"] = tree["frames"] | {
        "damper_left_tub": {"position": (0.0, 0.0, 0.0)},
        "damper_left_housing": {"position": (0.0, 0.0, -50.0)},
    }
    return build_machine(type(parameters).model_validate(tree))


def test_friction_damps_a_mode_as_the_energy_of_a_cycle_says():
    """Dissipate 4 F A in a cycle of Coulomb friction F: zeta = 2 F / (pi k A).

    The formula neglects higher harmonics, which change it by about (F / (k A))^2, 0.1 % here.
    """
    force = 4.0
    machine = vertical_friction_damper(force, 2e-3)
    linear = linearised(machine, dampers=False)
    spectrum = linear.spectrum().first(6)
    modes = modes_of(spectrum, linear.wrench_slopes())
    bounce = next(index for index, mode in enumerate(modes) if mode.name == "bounce")
    one = Spectrum(spectrum.values[[bounce]], spectrum.right[:, [bounce]], spectrum.left[[bounce]])
    amplitude = 0.02
    over = amplitude_modes(machine.set_up(), one, ["bounce"], np.array([amplitude]))
    found = at_amplitude(over, ["bounce"], amplitude)
    hertz, ratio = found.frequency.item(), found.damping_ratio.item()
    assert hertz == pytest.approx(np.sqrt(STIFFNESS / MASS) / (2.0 * np.pi), rel=1e-3)
    assert ratio == pytest.approx(2.0 * force / (np.pi * STIFFNESS * amplitude), rel=5e-3)


def test_modes_of_the_reference_machine(machine):
    result = wm.modes(machine, "middle", amplitude=1e-4)
    sliding = result.to_dataframe().query("linearisation == 'sliding'")
    assert sliding["mode"].tolist() == [mode.name for mode in result.modes["sliding"]]
    assert repr(result).startswith("<Modes of 'reference', sliding friction: fore-aft 1.")
    assert len(result.modes[STUCK]) == len(result.modes[SLIDING]) == 6
    stuck = {mode.name: mode for mode in result.modes[STUCK]}
    values = result.at_amplitude
    for name in values.mode.values:  # a tenth of a millimetre: nearly the slopes at rest
        value = values.sel(mode=name)
        # a damped mode has another frequency where its damping is cancelled (bounce: 0.65)
        within = 0.03 if value.damping_ratio < 0.3 else 0.15
        assert value.frequency.item() == pytest.approx(stuck[name].frequency_hz, rel=within)
    assert np.all(np.diff(result.critical_speeds) > 0.0)
    assert ANGLE_ARM == 0.25
    # the short list of the spin page has the same values
    short = three_linearisations(machine, "middle", amplitude=1e-4)
    for name in (STUCK, SLIDING):
        assert [mode.frequency_hz for mode in short.modes[name]] == pytest.approx(
            [mode.frequency_hz for mode in result.modes[name]]
        )
    np.testing.assert_allclose(short.at_amplitude.frequency, values.frequency, rtol=1e-6)


def test_load_lowers_the_frequencies(machine):
    empty = linearised(machine, friction=False).spectrum().first(6)
    setup = machine.set_up("middle", friction=False)
    loaded = Linearisation(setup, loaded=True)
    assert np.all(loaded.spectrum().first(6).frequency_hz < empty.frequency_hz)
    # the equilibrium is one: no mean force over a revolution
    rates = loaded.derivative(loaded._revolution(0.0)).mean(axis=0)
    assert np.max(np.abs(rates)) < 1e-8
