"""The firmware's motion planner, for time estimates and for the simulators."""
