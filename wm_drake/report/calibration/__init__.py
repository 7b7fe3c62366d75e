"""Write the page of `calibration`."""
