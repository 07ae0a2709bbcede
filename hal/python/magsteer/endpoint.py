"""Where a rig's channels meet: a root directory that all its processes share, and the services below it.

Everything here must be as the Rust side has it, or the two do not meet: the prefix of all file names follows from the
root's path, services carry a hash over all message layouts, and each role is one process's, kept by a lock.
"""

import fcntl
import hashlib
import os
import re
import stat
import time

import iceoryx2 as iox2

from . import messages

ROOT_VARIABLE = "MAGSTEER_ROOT"
SEGMENTS = "/dev/shm"
# Another process may be half-way through making or clearing up the same thing.
RETRY_S = 3.0


class ChannelError(Exception):
    """The channels cannot be used; the text says why and what to do."""


def monotonic_ns() -> int:
    """Now, as every stamp counts it."""
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


class Endpoint:
    """The channels of `rig` under `root`; without one under $MAGSTEER_ROOT, else /dev/shm/magsteer-UID."""

    def __init__(self, rig: str, root=None):
        if not re.fullmatch(r"[a-z0-9-]{1,40}", rig):
            raise ChannelError(f"rig name {rig!r}: must be 1 to 40 lower-case letters, digits and hyphens")
        named = root or os.environ.get(ROOT_VARIABLE) or f"{SEGMENTS}/magsteer-{os.getuid()}"
        os.makedirs(named, mode=0o700, exist_ok=True)
        self.rig = rig
        self.root = os.path.realpath(named)
        if len(os.fsencode(self.root)) > messages.ROOT_LENGTH_MAX:
            raise ChannelError(f"channel root {self.root}: must be at most {messages.ROOT_LENGTH_MAX} bytes long")
        found = os.stat(self.root)
        if found.st_uid != os.getuid():
            raise ChannelError(f"channel root {self.root}: belongs to user {found.st_uid}")
        if stat.S_IMODE(found.st_mode) & 0o077:
            raise ChannelError(f"channel root {self.root}: is open to other users: chmod 700 it")
        digest = hashlib.sha256(os.fsencode(self.root)).hexdigest()[:8]
        self.prefix = f"magsteer{messages.TRANSPORT_VERSION}_{digest}_"

    def take_role(self, role: str):
        """Becomes the rig's only `role` ("driver"); keep the returned file open as long as it is so."""
        path = os.path.join(self.root, f"{self.rig}.{role}.lock")
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600), "r+", encoding="ascii")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = file.read().strip() or "unknown"
            raise ChannelError(f"rig {self.rig} already has a {role}: process {holder} (lock {path})") from None
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        return file

    def join(self, connection_wait_ms: int = 0):
        """A node below this root. `connection_wait_ms`: how long a port may wait for another process; none in a loop."""
        # What the transport makes is for this user alone.
        os.umask(0o077)
        iox2.set_log_level(iox2.LogLevel.Fatal)
        config = iox2.config.default()
        config.global_cfg.prefix = iox2.FileName.new(self.prefix)
        config.global_cfg.root_path = iox2.Path.new(self.root)
        config.global_cfg.creation_timeout = iox2.Duration.from_millis(connection_wait_ms)
        self._seal()
        builder = iox2.NodeBuilder.new().config(config).signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        node = retried(lambda: builder.create(iox2.ServiceType.Ipc))
        self._seal()
        return node

    def _seal(self):
        """Closes what the transport opens to everybody: the count of nodes."""
        for entry in os.scandir(SEGMENTS):
            if not entry.name.startswith(self.prefix):
                continue
            try:
                found = entry.stat(follow_symlinks=False)
                if found.st_uid != os.getuid():
                    raise ChannelError(f"{entry.path} belongs to user {found.st_uid}: remove it")
                if found.st_mode & 0o077:
                    os.chmod(entry.path, stat.S_IMODE(found.st_mode) & 0o700)
            except FileNotFoundError:
                pass  # Its maker took it away meanwhile.

    def name(self, channel: str):
        """Full name of one of the rig's services."""
        return iox2.ServiceName.new(f"magsteer/{self.rig}/{channel}")

    def topic(self, node, channel: str, payload, create: bool):
        """A publish-subscribe service; a driver creates its own, everybody else opens it."""
        settings = messages.SERVICES[channel]

        def attempt():
            builder = node.service_builder(self.name(channel)).publish_subscribe(payload)
            if not create:
                return builder.open_with_attributes(attributes())
            return (
                builder.enable_safe_overflow(True)
                .history_size(settings["history"])
                .subscriber_max_buffer_size(settings["buffer"])
                .subscriber_max_borrowed_samples(1)
                .max_publishers(settings["publishers"])
                .max_subscribers(settings["subscribers"])
                .max_nodes(settings["nodes"])
                .open_or_create_with_attributes(attributes())
            )

        topic = retried(attempt)
        found = topic.static_config
        pairs = {
            "history": found.history_size,
            "buffer": found.subscriber_max_buffer_size,
            "publishers": found.max_publishers,
            "subscribers": found.max_subscribers,
        }
        for setting, actual in pairs.items():
            if actual != settings[setting]:
                raise ChannelError(f"service {channel}: {setting} is {actual}, must be {settings[setting]}")
        return topic


def attributes():
    """What every service states: a hash over all message layouts."""
    key = iox2.AttributeKey.new(messages.SCHEMA_ATTRIBUTE)
    return iox2.AttributeVerifier.new().require(key, iox2.AttributeValue.new(messages.SCHEMA_HASH))


def retried(attempt):
    """Tries again for a bounded time."""
    deadline = time.monotonic() + RETRY_S
    while True:
        try:
            return attempt()
        except Exception as error:  # The binding has an exception type of its own for each step.
            if time.monotonic() >= deadline:
                raise ChannelError(f"{type(error).__name__}: {error}") from error
            time.sleep(0.01)


class Publisher:
    """Sends messages into a topic, and numbers and stamps them."""

    def __init__(self, topic, epoch: int):
        self._port = retried(
            lambda: topic.publisher_builder()
            .max_loaned_samples(1)
            .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
            .create()
        )
        self._epoch = epoch
        self._sequence = 0

    def send(self, message):
        """Fills in sequence, epoch, schema and publish stamp; source stamp and validity are the caller's."""
        self._sequence += 1
        header = message.header
        header.sequence = self._sequence
        header.epoch = self._epoch
        header.schema = messages.SCHEMA
        header.publish_stamp_ns = monotonic_ns()
        self._port.send_copy(message)


class Subscriber:
    """Takes messages from a topic."""

    def __init__(self, topic, buffer: int, payload):
        self._port = retried(lambda: topic.subscriber_builder().buffer_size(buffer).history_request(0).create())
        self._payload = payload

    def newest(self):
        """A copy of the message published last among those that arrived since the former call, or None."""
        newest = None
        while True:
            sample = self._port.receive()
            if sample is None:
                return newest
            copy = self._payload.from_buffer_copy(sample.payload().contents)
            sample.delete()
            if newest is None or copy.header.publish_stamp_ns >= newest.header.publish_stamp_ns:
                newest = copy
