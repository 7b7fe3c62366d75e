"""Report page of `wm-drake study spin-identify`."""
