"""Build the Drake model of a machine from its SDF and its parameters.

Enters: `MachineParameters`. Leaves: a `Machine` (diagram, plant and a handle to each system), which
in a default Context is at rest with its load. Its method `set_up` returns a `Setup`: a Context with
other numbers and load. `add_washing_machine` adds the systems to a diagram of the caller.
May import: `systems`, `elements` and the rooms before them.
"""
