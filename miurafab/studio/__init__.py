"""The local web page: from a surface to sheets without a terminal, and never a laser.

:func:`~miurafab.studio.server.serve` is all that others call. Inside, requests and responses are
values (:mod:`~miurafab.studio.messages`), :class:`~miurafab.studio.core.Studio` answers them
without knowing a socket, and whatever takes time is done by a process that can be ended
(:mod:`~miurafab.studio.worker`). No module of this room opens a port to a machine.
"""
