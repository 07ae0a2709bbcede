"""Drivers and operator clients of magsteer in Python, over PyPI `iceoryx2` 0.10.

| module | what |
|---|---|
| `messages` | the messages as ctypes structures; generated from the Rust sources |
| `endpoint` | where a rig's channels meet: root directory, roles, services |
| `rig` | a rig's numbers, from `magsteer hal describe FILE` |
| `guard` | which commands a driver obeys, and what its amplifiers do when they cease |
| `driver` | the loop of a driver: subclass `driver.Hardware`, call `driver.run` |
| `operator` | status and requests: `operator.Client` |

Units are the last word of a name; SI, radians, world frame; quaternions x, y, z, w. Stamps are CLOCK_MONOTONIC, ns.
"""
