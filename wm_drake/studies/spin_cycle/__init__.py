"""Run the spin cycle with many unbalances: RMS displacement per region, sensor and axis."""
