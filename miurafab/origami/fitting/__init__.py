"""Fitting: seed, constraints, solver, polish, and the strategies that combine them."""
