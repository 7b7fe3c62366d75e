"""Questions asked of a machine: spin runs, modes, a resolved description."""
