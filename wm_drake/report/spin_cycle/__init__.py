"""Write the page of `spin_cycle`."""
