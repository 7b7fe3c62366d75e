"""Write the page of `gasket`."""
