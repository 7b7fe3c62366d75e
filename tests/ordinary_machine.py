"""A machine that `machine check` has nothing to say about."""

ORDINARY = """
extends: reference
name: ordinary
spring_types: {suspension: {stiffness: 5 N/mm}}
damper_types: {friction: {end_bushing: {stiffness: 750 N*mm/rad}}}
bodies:
  upper_counterweight: {mass: 8 kg}
  front_counterweight_left: {mass: 2.5 kg}
  front_counterweight_right: {mass: 2.5 kg}
frames:
  gasket_tub: {position: "(0, -260, 0) mm"}
  gasket_housing: {position: "(0, -260, 0) mm"}
gasket: {rotational_stiffness_y: 120000 N*mm/rad}
loads:
  middle: {unbalances: [{mass: 1 kg, radius: 235 mm, y: 0 mm}]}
  counter: null
  back: null
  front: null
"""
