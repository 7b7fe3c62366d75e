"""Report page of `wm-drake calibrate`."""
