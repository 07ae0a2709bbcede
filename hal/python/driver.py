#!/usr/bin/env python3
"""A driver of ideal hardware: amplifiers and motors of first order, a rod that does not move.

Replace the class by your hardware, one method after the other, and keep `magsteer hal conformance` passing.
"""

import math
import os

from magsteer.driver import Hardware, main
from magsteer.endpoint import monotonic_ns

# Of the amplifiers' current control.
TIME_CONSTANT_S = 0.002
POSE_PERIOD_S = 0.005


class IdealHardware(Hardware):
    """Follows set points with a lag; its sensor sees the straight rod."""

    def __init__(self, rig):
        self._currents = [0.0] * len(rig.coils)
        self._angles = [min(max(0.0, f["angle_min_rad"]), f["angle_max_rad"]) for f in rig.frames]
        self._rod = [(magnet["position_m"], magnet["orientation_xyzw"]) for magnet in rig.magnets]
        self._seen_ns = 0

    def follow(self, currents_a, angles_rad, period_s):
        # HARDWARE: send the set points to your amplifiers (A) and motors (rad) here.
        share = 1.0 - math.exp(-period_s / TIME_CONSTANT_S)
        self._currents = [held + share * (set_ - held) for held, set_ in zip(self._currents, currents_a)]
        self._angles = list(angles_rad)

    def cut(self):
        # HARDWARE: take the enable line of your amplifiers away here.
        self._currents = [0.0] * len(self._currents)

    def measured(self):
        # HARDWARE: read your current sensors (A), encoders (rad) and fault lines here.
        return self._currents, self._angles, 0

    def poses(self):
        # HARDWARE: hand over the newest poses of your tracker here, with the stamp of their exposure.
        now = monotonic_ns()
        if now - self._seen_ns < POSE_PERIOD_S * 1e9:
            return None
        self._seen_ns = now
        return now, self._rod


if __name__ == "__main__":
    main(IdealHardware, os.path.join(os.path.dirname(os.path.abspath(__file__)), "rig.json"))
