"""Report page of `wm-drake identify`."""
