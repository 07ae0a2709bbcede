"""An operator's end: watches the daemon's status and sends requests.

Without an answer a request must be taken as not done.
"""

import argparse
import json
import math
import sys
import time

import iceoryx2 as iox2

from . import messages
from .endpoint import ChannelError, Endpoint, Subscriber, attributes, monotonic_ns, retried
from .messages import OperatorAnswer, OperatorRequest, StatusMessage, Verb
from .rig import Rig

# None of these ports belong to a control loop: they may wait for a connection to form.
CONNECTION_WAIT_MS = 100


class Refused(Exception):
    """The daemon refused a request, or did not answer."""


class Client:
    """Speaks with the daemon of a rig. Use it from one thread."""

    def __init__(self, rig: Rig, root=None):
        endpoint = Endpoint(rig.name, root)
        self._rig = rig
        self._node = endpoint.join(CONNECTION_WAIT_MS)
        try:
            topic = endpoint.topic(self._node, "status", StatusMessage, create=False)
        except ChannelError as error:
            where = f"on rig {rig.name} (channel root {endpoint.root})"
            raise ChannelError(f"no daemon {where}: start it, with the same root ({error})") from error
        self._status = Subscriber(topic, messages.SERVICES["status"]["buffer"], StatusMessage)
        self._newest = None
        self._services = {name: self._service(endpoint, name) for name in (messages.REQUEST, messages.TARGET_SET)}

    def _service(self, endpoint, name):
        def attempt():
            builder = self._node.service_builder(endpoint.name(name))
            return builder.request_response(OperatorRequest, OperatorAnswer).open_with_attributes(attributes())

        return retried(attempt)

    def status(self, wait_s: float = 1.0):
        """The newest StatusMessage; waits for the first one.

        Raises ChannelError when none arrives.
        """
        deadline = time.monotonic() + wait_s
        while True:
            self._newest = self._status.newest() or self._newest
            if self._newest is not None:
                return self._newest
            if time.monotonic() > deadline:
                raise ChannelError("no daemon publishes its status on this rig")
            time.sleep(0.005)

    def request(self, verb: int, timeout_s: float = 0.4):
        """Sends arm, go, hold, retreat, stop, reset, estop or save and returns the OperatorAnswer.

        Raises Refused when the daemon refuses or does not answer.
        """
        message = OperatorRequest()
        message.verb = verb
        return self._send(messages.REQUEST, message, timeout_s)

    def set_targets_deg(self, angles_deg, azimuths_deg=None, timeout_s: float = 0.4):
        """Targets as angles from global z, towards +x, or towards an azimuth about z for each magnet."""
        azimuths_deg = azimuths_deg or [0.0] * len(angles_deg)
        directions = []
        for angle, azimuth in zip(map(math.radians, angles_deg), map(math.radians, azimuths_deg)):
            across = math.sin(angle)
            directions.append((across * math.cos(azimuth), across * math.sin(azimuth), math.cos(angle)))
        return self.set_targets(directions, timeout_s)

    def set_targets(self, directions, timeout_s: float = 0.4):
        """Targets as unit tangents in the world frame, one for each magnet."""
        message = OperatorRequest()
        message.verb = Verb.SET_TARGET
        message.magnet_count = len(directions)
        for entry, direction in zip(message.direction, directions):
            entry[:] = direction
        return self._send(messages.TARGET_SET, message, timeout_s)

    def _send(self, name, message, timeout_s):
        # A client of its own for each request: an answer that comes late has nowhere to go.
        client = retried(lambda: self._services[name].client_builder().create())
        try:
            deadline = time.monotonic() + timeout_s
            pending = client.send_copy(message)
            while pending.number_of_server_connections == 0:
                if time.monotonic() > deadline:
                    raise Refused("no daemon answers requests on this rig")
                time.sleep(0.005)
                pending = client.send_copy(message)
            while True:
                # Asked before receiving: an answer sent just before the server let go must not be missed.
                connected = pending.is_connected
                response = pending.receive()
                if response is not None:
                    answer = OperatorAnswer.from_buffer_copy(response.payload().contents)
                    response.delete()
                    if not answer.accepted:
                        raise Refused(messages.CAUSES.get(answer.cause, f"cause {answer.cause}"))
                    return answer
                if not connected or time.monotonic() > deadline:
                    raise Refused(f"no answer within {timeout_s * 1000:.0f} ms: take it as not done")
                time.sleep(0.0005)
        finally:
            client.delete()


def summary(rig: Rig, status) -> dict:
    """What people look at first, with the keys of `magsteer status --json`."""

    def angles(directions):
        return [round(math.degrees(math.acos(max(-1.0, min(1.0, d[2])))), 3) for d in directions[: status.magnet_count]]

    return {
        "state": messages.STATE_NAMES[status.state] if status.state < len(messages.STATE_NAMES) else "unknown",
        "cause": messages.CAUSES.get(status.cause),
        "cycle": status.cycle,
        "rate_hz": status.rate_hz,
        "targets_deg": angles(status.target_direction),
        "measured_deg": angles(status.measured_direction),
        "currents_a": [round(value, 4) for value in status.measured.current_a[: len(rig.coils)]],
        "angles_deg": [round(math.degrees(value), 3) for value in status.measured.angle_rad[: len(rig.frames)]],
        "status_age_ms": (monotonic_ns() - status.header.publish_stamp_ns) / 1e6,
    }


VERBS = {
    "arm": Verb.ARM,
    "go": Verb.GO,
    "hold": Verb.HOLD,
    "retreat": Verb.RETREAT,
    "stop": Verb.STOP,
    "reset": Verb.RESET,
    "estop": Verb.ESTOP,
    "save": Verb.SAVE,
}


def state(answer):
    """The daemon's state after a request, in words."""
    return messages.STATE_NAMES[answer.state]


def main():
    """python -m magsteer.operator --rig rig.json status | arm | go | target 70 110 | stop"""
    parser = argparse.ArgumentParser(description="Watch and steer a rig.")
    parser.add_argument("--rig", required=True, help="what `magsteer hal describe FILE` printed")
    parser.add_argument("--root", help="directory under which the rig's processes meet")
    parser.add_argument("verb", choices=["status", "target", *VERBS])
    parser.add_argument("angles_deg", nargs="*", type=float, help="for target: one angle from global z a magnet")
    arguments = parser.parse_args()
    rig = Rig.load(arguments.rig)
    try:
        client = Client(rig, arguments.root)
        if arguments.verb == "status":
            print(json.dumps(summary(rig, client.status())))
        elif arguments.verb == "target":
            print(state(client.set_targets_deg(arguments.angles_deg)))
        else:
            print(state(client.request(VERBS[arguments.verb])))
    except ChannelError as error:
        print(f"error: {error}", file=sys.stderr)
        return 69
    except Refused as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
