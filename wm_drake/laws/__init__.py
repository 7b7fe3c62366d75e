"""State the equations of the papers, each in one scalar function; nothing else.

Enters: numbers named as in the machine file. Leaves: forces and rates, compiled for floats and SIMD
lanes, interpreted for AutoDiffXd. May import: `compiler`.

Equation -> function -> test (below tests/laws):

    [A] (2), (3)   HAVSIN, corrected           friction.havsin_friction          test_friction
    [A] (4)        MSTV, growing friction      friction.mstv_friction            test_friction
    [A] (2)-(6)    free-stroke damper          damper.free_stroke_damper         test_damper
    [A] (7), (8)   bushing, gasket: 6 forces   bushing.bushing_force             test_bushing
    [B] sec. 3     Hooke joints of dampers     strut.bending_moment              test_strut
    [B] Fig. 4, 6  gasket, table stiffness     bushing.bushing_force,            test_bushing,
                                               table.stiffness_force             test_table
    [C] (2), (3)   massless sponge             damper.mstv_damper, slider_rate   test_damper
    [C] (3), (7)   sponge with mass            damper.mstv_sponge_with_mass      test_damper
    [A] (6)        sponge with mass            damper.free_stroke_sponge_with_mass  test_loops
    [C] (3), (6)   sponge, STV or Coulomb      damper.stv_sponge_damper          test_damper
    [C] (4)        Coulomb, corrected          friction.coulomb_friction         test_friction
    [C] (6)        STV friction                friction.stv_friction             test_friction
    [C] (7)        MSTV, corrected             friction.mstv_friction            test_friction

Rubber beyond [A] and [B] (Dahl 1968; own closed forms): rubber.dahl_rate, dahl_after_path,
maxwell_rate, test in test_rubber. Own derivations: normal loads of four feet, margins of sliding,
turning and tilting in `feet`, test in test_feet; a foot that slides and lifts in `foot_contact`,
test in test_foot_contact; a shaft with play in its bearing in `clearance`, test in test_clearance.
Contact with a rubber buffer (Hunt and Crossley 1975) in `stop`, test in tests/elements/test_stop.
Water that leaves laundry in `water`, test in tests/elements/test_water.
Rolling resistance of balls that may park (Dahl 1968, Coulomb) in `rolling`, test in test_rolling.
Torque limit, speed controller and bearing friction of a drive in `motor`, test in test_motor.

Dampers without a sponge (damper.coulomb_damper, stv_damper, havsin_damper) add a dashpot to a
friction law. The registry of damper laws is `wm_drake.parameters.damper_laws`.

[A] Component-level framework of a front-loading washing machine with free-stroke damper, bushing
and gasket.
[B] Sanchez-Tabuenca et al., Sensors 2020, 20, 6636.
[C] Modified stick transition velocity (MSTV) model of a lubricated friction damper.
"""
