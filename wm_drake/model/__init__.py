"""Build the Drake model of a machine from its SDF and its parameters.

Enters: `MachineParameters`. Leaves: a `Machine` (diagram, plant and a handle to each system) and, from `set_up`, a
`Setup`: a Context at rest with preloads solved. May import: `systems`, `elements` and the rooms above them.
"""
