"""Report page of `wm-drake spin`."""
