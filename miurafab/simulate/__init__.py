"""The device side of each protocol: simulated controllers, a simulated cable, injected faults.

Nothing here does I/O or knows a clock; time enters only by ``advance``.
"""
