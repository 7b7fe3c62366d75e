"""LeafSystems: ports and geometry; each calls one law."""
