"""Whether a folder is on another machine: then two servers could write one store. Pure.

SQLite keeps the index of its write-ahead log in memory that all processes share, which those of two
machines do not (sqlite.org/wal.html), and a lock of one machine may not count on the other.
"""

import re
from pathlib import Path, PurePath

#: types of file systems in the kernel's list of mounts, also behind "fuse."
NETWORK = re.compile(
    "nfs4?|cifs|smb3|smbfs|afs|ceph|lustre|9p|gfs2|ocfs2|glusterfs|sshfs|davfs|s3fs|rclone|orangefs"
)
MOUNTS = Path("/proc/self/mountinfo")


def network_type(folder: PurePath, mounts: str) -> str:
    """Return the type of a network file system that has an absolute folder; "": it is local.

    ``mounts`` is as in /proc/self/mountinfo (proc_pid_mountinfo(5)); a later mount hides an
    earlier one.
    """
    best, kind = -1, ""
    for line in mounts.splitlines():
        left, _, right = line.partition(" - ")
        if not right:
            continue
        point = PurePath(re.sub(r"\\(\d{3})", lambda code: chr(int(code[1], 8)), left.split()[4]))
        if folder.is_relative_to(point) and len(point.parts) >= best:
            best, kind = len(point.parts), right.split()[0]
    plain = kind.removeprefix("fuse.")
    return plain if NETWORK.fullmatch(plain) else ""
