"""Report page of `wm-drake rig`."""
