"""Write the page of `spin`."""
