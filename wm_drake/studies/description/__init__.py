"""Describe a machine: its numbers in SI, equilibrium, natural modes."""
