"""Screen the factors of the gasket: design of experiments, analysis of variance, leading terms."""
