"""Identify numbers of a machine from RMS displacements of spin cycles."""
