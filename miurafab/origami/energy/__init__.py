"""Folding energy: hinges, the bar-and-hinge model, equilibrium, the folding path."""
