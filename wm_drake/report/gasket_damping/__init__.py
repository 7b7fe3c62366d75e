"""Write the page of `gasket_damping`."""
