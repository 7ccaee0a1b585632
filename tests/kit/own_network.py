"""Runs a Python program in its own network namespace, which has only a loopback.

For programs that always listen on every interface. Linux only, and not permitted everywhere:
``is_possible`` tells. ``python -m tests.kit.own_network ARGUMENT...`` becomes ``python
ARGUMENT...`` there.
"""

import ctypes
import os
import socket
import struct
import subprocess
import sys
from fcntl import ioctl
from pathlib import Path

CLONE_NEWUSER, CLONE_NEWNET = 0x10000000, 0x40000000  # linux/sched.h
SIOCSIFFLAGS = 0x8914  # linux/sockios.h
IFF_UP = 1  # linux/if.h


def is_possible() -> bool:
    """Return whether this machine permits it, tried in a child process."""
    command = [sys.executable, "-m", "tests.kit.own_network", "-c", ""]
    root = Path(__file__).resolve().parents[2]
    return subprocess.run(command, cwd=root, capture_output=True, check=False).returncode == 0


def enter() -> None:
    """Enter a new network namespace and bring its loopback up. Raise OSError if forbidden."""
    user, group = os.getuid(), os.getgid()
    try:
        _unshare(CLONE_NEWNET)
    except PermissionError:  # not root: a user namespace may permit it
        _unshare(CLONE_NEWUSER | CLONE_NEWNET)
        Path("/proc/self/setgroups").write_text("deny", encoding="ascii")
        Path("/proc/self/uid_map").write_text(f"{user} {user} 1", encoding="ascii")
        Path("/proc/self/gid_map").write_text(f"{group} {group} 1", encoding="ascii")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        ioctl(sock, SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", IFF_UP))


def _unshare(flags: int) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(flags):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


if __name__ == "__main__":
    enter()
    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
