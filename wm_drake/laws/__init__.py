"""The only home of the papers' equations: scalar functions, compiled for floats, the same source for other scalars.

Equation -> function -> test (below tests/laws):

    [A] (2), (3)   HAVSIN, corrected                friction.havsin_friction             test_friction
    [A] (4)        MSTV with growing friction       friction.mstv_friction               test_friction
    [A] (2)-(6)    free-stroke damper               damper.free_stroke_damper            test_damper
    [A] (7), (8)   bushing and gasket, six forces   bushing.bushing_force                test_bushing
    [B] sec. 3     Hooke joints of the dampers      strut.bending_moment                 test_strut
    [B] Fig. 4, 6  gasket, tabulated stiffness      bushing.bushing_force, table         test_bushing, test_table
    [C] (2), (3)   damper with massless sponge      damper.mstv_damper, slider_rate      test_damper
    [C] (3), (6)   the same with STV, Coulomb       damper.stv_sponge_damper            test_damper
    [C] (4)        Coulomb friction, corrected      friction.coulomb_friction            test_friction
    [C] (6)        STV friction                     friction.stv_friction                test_friction
    [C] (7)        MSTV friction, corrected         friction.mstv_friction               test_friction

[A] Component-level framework of a front-loading washing machine with free-stroke damper, bushing and gasket.
[B] Sanchez-Tabuenca et al., Sensors 2020, 20, 6636.
[C] Modified stick transition velocity (MSTV) model of a lubricated friction damper.
"""
