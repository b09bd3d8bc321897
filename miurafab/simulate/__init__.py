"""The device side of each protocol: simulated controllers, a simulated cable, injected faults.

The simulators do no I/O and have no clock; time passes only in ``advance``.
"""
