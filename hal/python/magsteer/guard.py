"""Which commands a driver obeys, and what its amplifiers do when they cease.

A driver obeys only the epoch and token that it granted by a claim, only a rising sequence, and only until
`valid_until_ns`; else it ramps to zero alone, within the slew limits. This is the rule set of the Rust crate's `guard`,
line by line where a line decides; both are held against the same conformance suite.
"""

import math

from .messages import (
    FUTURE_TOLERANCE_NS,
    SCHEMA,
    SLEW_JITTER_S,
    VALIDITY_MAX_NS,
    DriverState,
    Order,
)

# Rounding of the sender's own sums, relative to the greatest current.
ROUNDING = 1e-9


class Refusal(Exception):
    """A command is not obeyed; nothing changed but the count."""


def between(value, least, most):
    """`value` held within its bounds."""
    return min(max(value, least), most)


class Guard:
    """The latch of authority and the set point that follows from it."""

    def __init__(self, rig, angles_rad):
        self._rig = rig
        self._state = DriverState.IDLE
        self.currents_a = [0.0] * len(rig.coils)
        self.angles_rad = [self._in_range(frame, angle) for frame, angle in zip(rig.frames, angles_rad)]
        # (epoch, token) of who holds authority, or held it last, and the sequence of its last command.
        self._holder = None
        self._sequence = 0
        self._deadline_ns = 0
        self._is_ramping = False
        self._target = (list(self.currents_a), list(self.angles_rad))
        self._ceiling = [0.0] * len(rig.coils)
        self._floor = [0.0] * len(rig.coils)
        self._envelope_ns = 0
        self._accepted = (0, 0)
        self._answered = (0, 0)
        self.refused = 0
        self.limit_breaks = 0

    @property
    def state(self) -> int:
        """One of DriverState."""
        return self._state

    def offer(self, command, now_ns: int):
        """Judges a received command, and takes it over when it may be obeyed; counts it when not."""
        try:
            self._check(command, now_ns)
            if command.order == Order.CLAIM:
                self._claim(command, now_ns)
            elif command.order == Order.DRIVE:
                self._follow(command, now_ns, ramping=False)
            elif command.order == Order.RAMP_DOWN:
                self._follow(command, now_ns, ramping=True)
            elif command.order == Order.RELEASE:
                self._release(command)
            else:
                self._disable(command, now_ns)
        except Refusal:
            self.refused += 1
            return
        header = command.header
        self._accepted = (header.epoch, header.sequence)
        if self._answered[0] < header.source_stamp_ns <= now_ns:
            self._answered = (header.source_stamp_ns, now_ns)

    def step(self, now_ns: int, period_s: float):
        """Moves the set point on to `now_ns`, `period_s` after the former call; read it from `currents_a`,
        `angles_rad` and `state`."""
        self._lapse(now_ns)
        period = max(period_s, 0.0) if math.isfinite(period_s) else 0.0
        if self._state == DriverState.DRIVEN:
            self._approach(self._target, period)
        elif self._state == DriverState.RAMPING_DOWN:
            self._approach(([0.0] * len(self.currents_a), self.angles_rad), period)
            if self._is_at_zero():
                self._state = DriverState.IDLE

    def trip(self):
        """Cuts the amplifiers on the driver's own account, until the next claim."""
        self.currents_a = [0.0] * len(self.currents_a)
        self._state = DriverState.DISABLED

    def report(self, feedback):
        """Fills in what feedback says about commands; header, fault and measured values are the driver's."""
        feedback.accepted_epoch, feedback.accepted_sequence = self._accepted
        feedback.answered_pose_stamp_ns, feedback.answer_received_stamp_ns = self._answered
        feedback.description_fingerprint = self._rig.fingerprint
        feedback.commands_refused = self.refused
        feedback.limit_breaks = self.limit_breaks
        feedback.state = self._state
        feedback.coil_count = len(self._rig.coils)
        feedback.pose_parameter_count = len(self._rig.frames)

    def _check(self, command, now_ns):
        header = command.header
        coils, frames = len(self._rig.coils), len(self._rig.frames)
        refused = (
            header.schema != SCHEMA
            or command.coil_count != coils
            or command.pose_parameter_count != frames
            or command.order > Order.DISABLE
            or not all(map(math.isfinite, command.actuation.current_a[:coils]))
            or not all(map(math.isfinite, command.actuation.angle_rad[:frames]))
            or header.publish_stamp_ns > now_ns + FUTURE_TOLERANCE_NS
            # Cutting the amplifiers is never too late.
            or (command.order != Order.DISABLE and now_ns >= header.valid_until_ns)
            or (self._is_last(command) and header.sequence <= self._sequence)
        )
        if refused:
            raise Refusal

    def _claim(self, command, now_ns):
        if any(command.actuation.current_a[: len(self._rig.coils)]):
            raise Refusal
        if self._state == DriverState.DRIVEN and self._is_last(command):
            self._follow(command, now_ns, ramping=False)
            return
        self._lapse(now_ns)
        if self._state in (DriverState.DRIVEN, DriverState.RAMPING_DOWN):
            raise Refusal
        header = command.header
        if header.epoch <= (self._holder[0] if self._holder else 0):
            raise Refusal
        self._holder = (header.epoch, command.token)
        self._sequence = header.sequence
        self._deadline_ns = min(header.valid_until_ns, now_ns + VALIDITY_MAX_NS)
        self._is_ramping = False
        self._target = (list(self.currents_a), list(self.angles_rad))
        self._ceiling = [0.0] * len(self._rig.coils)
        self._floor = [0.0] * len(self._rig.coils)
        self._envelope_ns = header.publish_stamp_ns
        self._state = DriverState.DRIVEN

    def _follow(self, command, now_ns, ramping):
        # The holder's own command is judged before the lapse of its former one: a driver that was stopped for a while
        # and finds a valid command on waking goes on.
        if not (self._state == DriverState.DRIVEN and self._is_last(command)):
            self._lapse(now_ns)
        if self._state != DriverState.DRIVEN or not self._is_last(command):
            raise Refusal
        self._sequence = command.header.sequence
        self._deadline_ns = min(command.header.valid_until_ns, now_ns + VALIDITY_MAX_NS)
        self._is_ramping = ramping
        currents, broken = self._within_slew(command)
        if ramping:
            # Where to is fixed by the order itself; its content cannot break a limit.
            self._target = ([0.0] * len(currents), list(self.angles_rad))
            return
        wanted = list(command.actuation.angle_rad[: len(self._rig.frames)])
        angles = [self._in_range(frame, angle) for frame, angle in zip(self._rig.frames, wanted)]
        self.limit_breaks += int(broken or angles != wanted)
        is_claim = command.order == Order.CLAIM
        self._target = (currents, list(self.angles_rad) if is_claim else angles)

    def _within_slew(self, command):
        """Commanded currents held within magnitude and, over all commands of the holder, slew; and whether they
        had to be."""
        published = command.header.publish_stamp_ns
        elapsed = max(published - self._envelope_ns, 0) / 1e9
        self._envelope_ns = max(self._envelope_ns, published)
        currents, broken = [], False
        for index, coil in enumerate(self._rig.coils):
            slew, limit = coil["slew_max_a_per_s"], coil["current_max_a"]
            tolerance = slew * SLEW_JITTER_S + limit * ROUNDING
            ceiling = self._ceiling[index] + slew * elapsed
            floor = self._floor[index] - slew * elapsed
            commanded = command.actuation.current_a[index]
            broken |= abs(commanded) > limit * (1.0 + ROUNDING)
            broken |= commanded > ceiling + tolerance or commanded < floor - tolerance
            held = between(between(commanded, -limit, limit), floor - tolerance, ceiling + tolerance)
            self._ceiling[index] = min(ceiling, held)
            self._floor[index] = max(floor, held)
            currents.append(held)
        return currents, broken

    def _release(self, command):
        if not self._is_last(command):
            raise Refusal
        self._sequence = command.header.sequence
        if self._state == DriverState.DRIVEN:
            self._leave()

    def _disable(self, command, now_ns):
        """Obeyed from the holder; while nobody holds authority also from any later epoch."""
        if not self._is_last(command):
            self._lapse(now_ns)
            if self._state == DriverState.DRIVEN:
                raise Refusal
            if self._holder and command.header.epoch <= self._holder[0]:
                raise Refusal
        else:
            self._sequence = command.header.sequence
        self.trip()

    def _is_last(self, command):
        return self._holder == (command.header.epoch, command.token)

    def _lapse(self, now_ns):
        if self._state == DriverState.DRIVEN and now_ns >= self._deadline_ns:
            self._leave()

    def _leave(self):
        self._state = DriverState.IDLE if self._is_at_zero() else DriverState.RAMPING_DOWN

    def _is_at_zero(self):
        return not any(self.currents_a)

    def _approach(self, target, period):
        currents, angles = target
        for index, coil in enumerate(self._rig.coils):
            step = coil["slew_max_a_per_s"] * period
            held = self.currents_a[index]
            self.currents_a[index] = between(currents[index], held - step, held + step)
        for index, frame in enumerate(self._rig.frames):
            step = frame["speed_max_rad_per_s"] * period
            held = self.angles_rad[index]
            self.angles_rad[index] = between(angles[index], held - step, held + step)

    @staticmethod
    def _in_range(frame, angle):
        return between(angle, frame["angle_min_rad"], frame["angle_max_rad"])
