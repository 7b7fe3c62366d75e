"""Write the page of `spin_identify`."""
