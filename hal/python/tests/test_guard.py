"""The guard's rules, under a clock of the test's own."""

import math
import unittest

from magsteer.guard import Guard
from magsteer.messages import SCHEMA, CoilCommand, CoilFeedback, DriverState, Order
from magsteer.rig import Rig

COIL = {"current_max_a": 8.0, "slew_max_a_per_s": 200.0}
FRAME = {"angle_min_rad": -math.pi, "angle_max_rad": math.pi, "speed_max_rad_per_s": 0.8}
RIG = Rig("example", 7, [COIL, COIL], [FRAME], [])
MS = 1_000_000


class Bench:
    def __init__(self):
        self.now, self.sequence = 1_000 * MS, 0
        self.guard = Guard(RIG, [0.0])

    def send(self, kind, currents=(0.0, 0.0), epoch=5, token=1, valid_ms=100, **spoilt):
        self.sequence += 1
        command = CoilCommand()
        command.order, command.token, command.coil_count, command.pose_parameter_count = kind, token, 2, 1
        header = command.header
        header.schema, header.epoch, header.sequence = SCHEMA, epoch, self.sequence
        header.publish_stamp_ns, header.valid_until_ns = self.now, self.now + valid_ms * MS
        command.actuation.current_a[:2] = currents
        for name, value in spoilt.items():
            setattr(header if hasattr(header, name) else command, name, value)
        refused = self.guard.refused
        self.guard.offer(command, self.now)
        return self.guard.refused == refused

    def step(self, milliseconds=1):
        for _ in range(milliseconds):
            self.now += MS
            self.guard.step(self.now, 1e-3)

    def drive(self, currents, milliseconds):
        for _ in range(milliseconds):
            self.send(Order.DRIVE, currents)
            self.step()


class Rules(unittest.TestCase):
    def test_nothing_is_obeyed_without_a_claim(self):
        bench = Bench()
        self.assertFalse(bench.send(Order.DRIVE, (1.0, 0.0)))
        bench.step(50)
        self.assertEqual((bench.guard.state, bench.guard.currents_a), (DriverState.IDLE, [0.0, 0.0]))

    def test_garbage_is_refused_and_counted(self):
        bench = Bench()
        self.assertTrue(bench.send(Order.CLAIM))
        for spoilt in (
            {"schema": SCHEMA + 1},
            {"coil_count": 3},
            {"pose_parameter_count": 0},
            {"order": 9},
            {"valid_until_ns": bench.now},
            {"publish_stamp_ns": bench.now + 2 * MS},
            {"sequence": 1},
            {"token": 2},
            {"epoch": 6},
        ):
            self.assertFalse(bench.send(Order.DRIVE, **spoilt), spoilt)
        self.assertFalse(bench.send(Order.DRIVE, (math.nan, 0.0)))
        self.assertFalse(bench.send(Order.DRIVE, (math.inf, 0.0)))
        self.assertEqual(bench.guard.refused, 11)
        self.assertEqual(bench.guard.state, DriverState.DRIVEN)

    def test_lapse_ramps_down_within_slew_and_frees_the_rig(self):
        bench = Bench()
        bench.send(Order.CLAIM)
        bench.drive((2.0, -1.0), 20)
        self.assertEqual(bench.guard.currents_a, [2.0, -1.0])
        bench.step(98)
        self.assertEqual(bench.guard.state, DriverState.DRIVEN)
        before = 2.0
        for _ in range(10):
            bench.step()
            self.assertLessEqual(before - bench.guard.currents_a[0], 0.2 + 1e-12)
            before = bench.guard.currents_a[0]
        self.assertFalse(bench.send(Order.DRIVE, (2.0, 0.0)), "the former epoch")
        bench.step(5)
        self.assertEqual((bench.guard.state, bench.guard.currents_a), (DriverState.IDLE, [0.0, 0.0]))
        self.assertFalse(bench.send(Order.CLAIM), "an epoch that was there before")
        self.assertTrue(bench.send(Order.CLAIM, epoch=6))

    def test_jumps_are_slewed_and_counted_and_magnitudes_held(self):
        bench = Bench()
        bench.send(Order.CLAIM)
        bench.step()
        bench.send(Order.DRIVE, (12.0, 0.0))
        self.assertEqual(bench.guard.limit_breaks, 1)
        bench.step()
        self.assertLessEqual(bench.guard.currents_a[0], 0.2 + 1e-12)
        bench.drive((12.0, 0.0), 100)
        self.assertEqual(bench.guard.currents_a[0], 8.0)

    def test_disable_latches_until_a_claim_and_rivals_are_refused(self):
        bench = Bench()
        bench.send(Order.CLAIM)
        self.assertFalse(bench.send(Order.CLAIM, epoch=6, token=2))
        bench.drive((2.0, 0.0), 20)
        self.assertTrue(bench.send(Order.DISABLE))
        self.assertEqual((bench.guard.state, bench.guard.currents_a), (DriverState.DISABLED, [0.0, 0.0]))
        self.assertFalse(bench.send(Order.DRIVE, (2.0, 0.0)))
        self.assertTrue(bench.send(Order.CLAIM, epoch=6))

    def test_report_echoes_what_was_accepted(self):
        bench = Bench()
        bench.send(Order.CLAIM)
        bench.send(Order.DRIVE)
        feedback = CoilFeedback()
        bench.guard.report(feedback)
        self.assertEqual((feedback.accepted_epoch, feedback.accepted_sequence), (5, 2))
        self.assertEqual((feedback.description_fingerprint, feedback.coil_count), (7, 2))


if __name__ == "__main__":
    unittest.main()
