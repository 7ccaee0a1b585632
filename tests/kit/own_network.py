"""Runs a Python program in a network of its own, which has nothing but its loopback.

For what listens on every interface and cannot be told not to. Linux only, and not everywhere
allowed: ``is_possible`` asks. ``python -m tests.kit.own_network ARGUMENT...`` becomes
``python ARGUMENT...`` there.
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
    """Whether this machine lets us, asked of a process of its own."""
    command = [sys.executable, "-m", "tests.kit.own_network", "-c", ""]
    root = Path(__file__).resolve().parents[2]
    return subprocess.run(command, cwd=root, capture_output=True, check=False).returncode == 0


def enter() -> None:
    """Leave the machine's network for an empty one, and take its loopback up; OSError if not."""
    user, group = os.getuid(), os.getgid()
    try:
        _unshare(CLONE_NEWNET)
    except PermissionError:  # not the superuser: in a name space of users one may
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
