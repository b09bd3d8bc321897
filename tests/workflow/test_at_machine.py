"""What a person at a machine is told, without a machine."""

from __future__ import annotations

from dataclasses import replace

from miurafab.machine.known_controller import MachineState
from miurafab.workflow.at_machine import Operator
from miurafab.workflow.cut_options import CutOptions

HERE = MachineState("port", "Grbl 1.1h", "Idle", (0.0, 0.0), (30.0, 20.0), (30.0, 20.0), (), ())


class Held:
    """The process that holds the port, as far as an operator asks it."""

    state = HERE

    def order(self, action, **options):
        pass

    def poll(self):
        return None


def test_an_origin_that_a_reset_forgot_is_told_once():
    process = Held()
    operator = Operator(process, None, CutOptions())
    process.state = replace(HERE, shift=(30.0, 20.0, 0.0))
    operator.take()
    assert list(operator.said) == []
    process.state = replace(HERE, shift=(0.0, 0.0, 0.0))
    operator.take()
    operator.take()
    assert list(operator.said) == ["The origin that was set (G92) is forgotten; set it again."]


def test_an_origin_that_is_moved_is_not_forgotten():
    """At the machine's own zero it is no shift."""
    process = Held()
    operator = Operator(process, None, CutOptions())
    process.state = replace(HERE, shift=(30.0, 20.0, 0.0))
    operator.take()
    operator.busy = ""
    operator.do("set_origin")
    process.state = replace(HERE, shift=(0.0, 0.0, 0.0))
    operator.take()
    assert list(operator.said) == []
