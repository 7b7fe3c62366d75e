"""Write the page of `rig`."""
