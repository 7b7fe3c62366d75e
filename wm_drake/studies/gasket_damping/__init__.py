"""Find the damping of the gasket from measured envelopes."""
