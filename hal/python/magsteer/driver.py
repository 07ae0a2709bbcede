"""The loop of a driver: takes commands, guards, hands set points to the hardware, publishes what it measured.

Subclass `Hardware`, then call `run`. What must not be forgotten is in here: authority, watchdog, slew, stamps, the ramp to
zero when told to end.
"""

import argparse
import math
import signal
import time

from .endpoint import Endpoint, Publisher, Subscriber, monotonic_ns
from .guard import Guard
from .messages import CoilCommand, CoilFeedback, DriverState, PoseMessage
from .rig import Rig

# After a signal: a ramp that takes longer than this is cut.
END_MAX_S = 2.0


class Hardware:
    """Amplifiers, motors and sensors of a rig. Override every method; none may wait."""

    def follow(self, currents_a, angles_rad, period_s: float):
        """Currents and angles that amplifiers and motors must follow from now on; already within every limit."""
        raise NotImplementedError

    def cut(self):
        """Switches the amplifiers off."""
        raise NotImplementedError

    def measured(self):
        """Measured currents, A, measured angles, rad, and a fault code, 0 for none. A fault cuts the amplifiers."""
        raise NotImplementedError

    def poses(self):
        """None, or new poses: (CLOCK_MONOTONIC stamp of the exposure in ns, a list with (position_m, orientation_xyzw)
        for each magnet, None for one that was not seen)."""
        return None


class Driver:
    """A driver's end of the channels around its hardware."""

    def __init__(self, rig: Rig, hardware: Hardware, root=None):
        endpoint = Endpoint(rig.name, root)
        self._lock = endpoint.take_role("driver")
        self._node = endpoint.join()
        epoch = monotonic_ns()
        self._pose = Publisher(endpoint.topic(self._node, "pose", PoseMessage, create=True), epoch)
        self._feedback = Publisher(endpoint.topic(self._node, "coil/feedback", CoilFeedback, create=True), epoch)
        command = endpoint.topic(self._node, "coil/command", CoilCommand, create=True)
        self._command = Subscriber(command, 1, CoilCommand)
        _, angles, _ = hardware.measured()
        self.guard = Guard(rig, angles)
        self._hardware = hardware
        self._before_ns = monotonic_ns()

    def step(self, takes_commands: bool = True):
        """One cycle."""
        now = monotonic_ns()
        command = self._command.newest()
        if command is not None and takes_commands:
            self.guard.offer(command, now)
        period = (now - self._before_ns) / 1e9
        self._before_ns = now
        self.guard.step(now, period)
        if self.guard.state == DriverState.DISABLED:
            self._hardware.cut()
        self._hardware.follow(self.guard.currents_a, self.guard.angles_rad, period)
        stamp = monotonic_ns()
        currents, angles, fault = self._hardware.measured()
        if fault and self.guard.state != DriverState.DISABLED:
            self.guard.trip()
            self._hardware.cut()
        self._publish_feedback(stamp, currents, angles, fault)
        seen = self._hardware.poses()
        if seen is not None:
            self._publish_poses(*seen)

    def is_currentless(self) -> bool:
        """True when nothing is commanded any more."""
        return not any(self.guard.currents_a) and self.guard.state != DriverState.DRIVEN

    def _publish_feedback(self, stamp, currents, angles, fault):
        feedback = CoilFeedback()
        feedback.header.source_stamp_ns = stamp
        feedback.fault = fault
        self.guard.report(feedback)
        feedback.measured.current_a[: len(currents)] = currents
        feedback.measured.angle_rad[: len(angles)] = angles
        self._feedback.send(feedback)

    def _publish_poses(self, stamp, magnets):
        message = PoseMessage()
        message.header.source_stamp_ns = stamp
        message.magnet_count = len(magnets)
        for entry, magnet in zip(message.magnets, magnets):
            if magnet is not None:
                position, orientation = magnet
                entry.position_m[:] = position
                entry.orientation_xyzw[:] = orientation
                entry.valid = 1
        self._pose.send(message)


def run(rig: Rig, hardware: Hardware, root=None, period_s: float = 0.002):
    """Runs until SIGINT or SIGTERM, then ramps to zero; returns the guard with its counts."""
    driver = Driver(rig, hardware, root)
    stopped = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.append(time.monotonic()))
    print(f"driver of {rig.name} is running", flush=True)
    deadline = time.monotonic()
    try:
        while not (stopped and (driver.is_currentless() or time.monotonic() - stopped[0] > END_MAX_S)):
            # Whole periods are skipped after a hold-up: never a burst.
            behind = max(math.ceil((time.monotonic() - deadline) / period_s), 1)
            deadline += behind * period_s
            time.sleep(max(deadline - time.monotonic(), 0.0))
            driver.step(takes_commands=not stopped)
    finally:
        hardware.cut()
    return driver.guard


def main(make_hardware, sheet):
    """A driver's command line: `--root DIR`, `--rig FILE` in place of `sheet`."""
    parser = argparse.ArgumentParser(description="A magsteer driver.")
    parser.add_argument("--rig", default=sheet, help="what `magsteer hal describe FILE` printed")
    parser.add_argument("--root", help="directory under which the rig's processes meet")
    arguments = parser.parse_args()
    rig = Rig.load(arguments.rig)
    guard = run(rig, make_hardware(rig), arguments.root)
    print(f"ended; {guard.refused} commands refused, {guard.limit_breaks} beyond a limit", flush=True)
