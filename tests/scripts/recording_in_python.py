"""Opens a recording, unchanged, with the public Python packages that read MCAP and ROS 2, and prints what they found.

    python3 -m venv /tmp/mcap && /tmp/mcap/bin/pip install mcap mcap-ros2-support rosbags numpy
    /tmp/mcap/bin/python tests/scripts/recording_in_python.py runs/run-20261122-141500/recording.mcap [cycles.npz]

Prints one JSON object; ends with 3 when a package is missing, so that a test can say so.
"""

import json
import struct
import sys
from pathlib import Path

try:
    from mcap.reader import make_reader
    from mcap_ros2.reader import read_ros2_messages
    from rosbags.highlevel import AnyReader
except ImportError as missing:
    print(f"missing: {missing.name}", file=sys.stderr)
    sys.exit(3)


def bits(value):
    """A double as a number that JSON carries without loss."""
    return struct.unpack("<Q", struct.pack("<d", value))[0]


def with_mcap(path):
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        topics = {channel.topic: 0 for channel in summary.channels.values()}
        for _, channel, _ in reader.iter_messages():
            topics[channel.topic] += 1
        attachments = [attachment.name for attachment in reader.iter_attachments()]
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        return {
            "profile": reader.get_header().profile,
            "statistics": summary.statistics.message_count,
            "topics": topics,
            "attachments": attachments,
            "rig": metadata["magsteer"]["rig"],
        }


def with_ros2(path):
    topics, last = {}, None
    for message in read_ros2_messages(path):
        topics[message.channel.topic] = topics.get(message.channel.topic, 0) + 1
        if message.channel.topic.endswith("/cycle"):
            last = message.ros_msg
        elif message.channel.topic.endswith("/measured_js"):
            joints = message.ros_msg.name
    return {
        "topics": topics,
        "joints": list(joints),
        "last_number": last.number,
        "last_commanded_bits": [bits(value) for value in last.commanded_a],
        "last_orientation_bits": [bits(value) for value in last.orientation],
    }


def with_rosbags(path):
    topics, last = {}, None
    with AnyReader([Path(path)]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            topics[connection.topic] = topics.get(connection.topic, 0) + 1
            if connection.topic.endswith("/cycle"):
                last = message
    return {
        "topics": topics,
        "last_number": int(last.number),
        "last_commanded_bits": [bits(value) for value in last.commanded_a],
    }


def with_numpy(path):
    import numpy

    arrays = numpy.load(path)
    return {
        "cycles": int(arrays["number"].shape[0]),
        "commanded_shape": list(arrays["commanded_a"].shape),
        "orientation_shape": list(arrays["orientation"].shape),
        "coils": [str(name) for name in arrays["coil_names"]],
        "last_commanded_bits": [bits(value) for value in arrays["commanded_a"][-1]],
        "kinds": [str(arrays[name].dtype) for name in ("number", "state", "period_s")],
    }


def main():
    path = sys.argv[1]
    found = {"mcap": with_mcap(path), "mcap_ros2": with_ros2(path), "rosbags": with_rosbags(path)}
    if len(sys.argv) > 2:
        try:
            found["numpy"] = with_numpy(sys.argv[2])
        except ImportError:
            pass
    json.dump(found, sys.stdout)
    print()


main()
