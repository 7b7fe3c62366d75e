"""A machine that `machine check` has nothing to say about."""

ORDINARY = """
extends: reference
name: ordinary
spring_types: {suspension: {stiffness: 5 N/mm}}
damper_types: {friction: {end_bushing: {stiffness: 750 N*mm/rad}}}
bodies:
  tub: {mass: 10 kg, centre_of_mass: "(0, 10, -10) mm"}
  drum: {mass: 9 kg, centre_of_mass: "(0, 55, 0) mm"}
  motor: {mass: 5 kg, centre_of_mass: "(0, 100, -300) mm"}
  upper_counterweight: {mass: 8 kg, centre_of_mass: "(0, 0, 270) mm"}
  front_counterweight_left: {mass: 2.5 kg, centre_of_mass: "(-120, -220, -60) mm"}
  front_counterweight_right: {mass: 2.5 kg, centre_of_mass: "(120, -220, -60) mm"}
frames:
  spring_left_tub: {position: "(-210, -60, 210) mm"}
  spring_left_housing: {position: "(-220, -60, 360) mm"}
  spring_right_tub: {position: "(210, -60, 210) mm"}
  spring_right_housing: {position: "(220, -60, 360) mm"}
  spring_rear_tub: {position: "(0, 120, 210) mm"}
  spring_rear_housing: {position: "(0, 120, 360) mm"}
  gasket_tub: {position: "(0, -260, 0) mm"}
  gasket_housing: {position: "(0, -260, 0) mm"}
gasket: {rotational_stiffness_y: 120000 N*mm/rad}
loads:
  middle: {unbalances: [{mass: 1 kg, radius: 235 mm, y: 0 mm}]}
  counter: null
  back: null
  front: null
"""
