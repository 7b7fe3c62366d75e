"""Report page of `wm-drake study gasket-effect`."""
