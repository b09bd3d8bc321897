"""The simulated GRBL 1.1 controller and its dialects, a model of the firmware itself."""
