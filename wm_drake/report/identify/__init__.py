"""Write the page of `identify`."""
