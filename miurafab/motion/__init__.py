"""The motion planner of the firmware, for time estimates and the simulators."""
