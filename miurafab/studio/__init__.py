"""The local web page: from a surface to sheets, and at the machine, without a terminal.

:func:`~miurafab.studio.server.serve` is all that others call. Inside, requests and responses are
values (:mod:`~miurafab.studio.messages`), :class:`~miurafab.studio.core.Studio` answers them
without knowing a socket, and whatever takes time is done by a process that can be ended
(:mod:`~miurafab.studio.worker`). A machine is held by a session in a process of its own
(:mod:`~miurafab.studio.held_session`), which no page can end by dying.
"""
