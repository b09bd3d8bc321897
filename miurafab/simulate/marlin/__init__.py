"""A Marlin controller, simulated."""
