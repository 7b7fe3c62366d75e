"""Identify the numbers of a component from measured loops: the rig is the model."""
