"""Targets: analytic surfaces, revolutions, functions, height fields, meshes."""
