"""The record of halts: a small file beside the store that still takes a STOP when the disk is full.

Every byte of it is written when it is opened, so that no later write needs free space. (A file
system that copies on write may refuse even then; that is reported, see ``halt_keeper``.) For each
vehicle it has the last word in each register, with the number of the event in the journal. A word
whose number the database does not know is newer than the database.

Each register has two cells, in different pages. A word goes into the cell that holds the older one,
so that a write which is cut short leaves the word before it. The cells of a register that a later
version has added stand behind all others; a file without them is made longer. Under the vehicle 0,
which no vehicle is, stands the next task id: whoever puts back an older database gives no id twice.
"""

import os
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from errno import ENOENT
from pathlib import Path
from zlib import crc32

from mav_tasks.errors import StoreError
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    QueuePaused,
    VehicleArmingSet,
    VehicleHalted,
)
from mav_tasks.tasks.lifecycle import TaskReason

HEADER = b"mav-tasks record of halts, version 1\n".ljust(64, b"\0")
VEHICLES = 256  # system ids, MAVLink
SLOTS = 2
CELL = 64  # bytes; a sector of a disk holds whole ones
IDS = 0  # the vehicle under which the next task id stands

#: number, UTC seconds, value, reason, actor; before them stands the CRC-32 of the rest
_BODY = struct.Struct("<QdIB39s")
_CRC = struct.Struct("<I")
_EMPTY = bytes(CELL)


class Register(IntEnum):
    """What the words of a vehicle are about; each has one that counts, the last."""

    QUEUE = 0  # why it is paused; NONE: it was continued
    HALTS = 1  # how often it was halted, as the value
    ARMING = 2  # whether it may be armed, as the value


FIRST_ONES = 2 * VEHICLES  # registers that the first version had
REGISTERS = len(Register) * VEHICLES
SIZE = len(HEADER) + SLOTS * REGISTERS * CELL
FIRST_SIZE = len(HEADER) + SLOTS * FIRST_ONES * CELL


@dataclass(frozen=True, slots=True)
class Word:
    """The last word in a register, made of an event.

    ``number`` is that of the event in the journal, ``utc`` in seconds since 1970.
    """

    vehicle: int
    number: int
    reason: TaskReason = TaskReason.NONE
    actor: str = ""
    utc: float = 0.0
    register: Register = Register.QUEUE
    value: int = 0

    @property
    def key(self) -> int:
        """Where it stands."""
        return self.register * VEHICLES + self.vehicle

    @property
    def is_halt(self) -> bool:
        """Whether the vehicle's queue stands by it."""
        return self.register is Register.QUEUE and self.reason is not TaskReason.NONE


def word_of(event: Event, number: int, *, offset: float) -> Word | None:
    """Return the word that an event is, or None; ``offset`` is UTC less monotonic seconds."""
    match event:
        case QueuePaused(vehicle=vehicle, reason=reason, actor=actor, at=at):
            return Word(vehicle, number, reason, actor, at + offset)
        case VehicleHalted(vehicle=vehicle, reason=reason, actor=actor, epoch=epoch, at=at):
            register = Register.HALTS
            return Word(vehicle, number, reason, actor, at + offset, register, epoch)
        case QueueContinued(vehicle=vehicle, actor=actor, at=at):
            return Word(vehicle, number, TaskReason.NONE, actor, at + offset)
        case VehicleArmingSet(vehicle=vehicle, may_arm=may_arm, at=at):
            register, value = Register.ARMING, int(may_arm)
            return Word(vehicle, number, utc=at + offset, register=register, value=value)
        case _:
            return None


def event_of(word: Word, *, offset: float) -> Event:
    """Return the event that a word was made of."""
    at = word.utc - offset
    if word.register is Register.HALTS:
        return VehicleHalted(word.vehicle, word.value, word.reason, word.actor, at)
    if word.register is Register.ARMING:
        return VehicleArmingSet(word.vehicle, bool(word.value), at)
    if word.is_halt:
        return QueuePaused(word.vehicle, word.reason, word.actor, at)
    return QueueContinued(word.vehicle, word.actor, at)


class HaltRecord:
    """The open file. OSError where it cannot be written; each cell is written by one thread."""

    def __init__(self, store: Path) -> None:
        """Open the record of a store, or make it. StoreError says in a line what is wrong."""
        self._path = store.with_name(f"{store.name}.halts")
        try:
            if not os.path.lexists(self._path):
                _make(self._path)
            self._fd = os.open(self._path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
        except OSError as error:
            raise StoreError(f"store {store}: {self._path.name}: {error.strerror}") from error
        try:
            content = os.pread(self._fd, SIZE + 1, 0)
            if len(content) == FIRST_SIZE:
                content = content.ljust(SIZE, b"\0")
            self._newest = dict(_words_in(content))
            if os.pwrite(self._fd, content, 0) < SIZE:  # a copy of it may have had holes
                raise OSError(0, "there is no room for it")
            os.fsync(self._fd)
        except (OSError, ValueError) as error:
            os.close(self._fd)
            words = getattr(error, "strerror", None) or str(error)
            raise StoreError(f"store {store}: {self._path.name}: {words}") from error

    def __repr__(self) -> str:
        return f"HaltRecord({self._path.name}, {len(self._newest)} words)"

    def next_id_after(self, number: int) -> int | None:
        """Return the next task id, or None if it is no news to such a database."""
        word = self._newest[IDS][1] if IDS in self._newest else None
        return None if word is None or word.number <= number else word.value

    @property
    def last_number(self) -> int:
        """The number of the last event that the record knows of."""
        return max((word.number for _, word in self._newest.values()), default=0)

    def words_after(self, number: int) -> list[Word]:
        """Return the words that a database lacks whose last event has this number, in order."""
        words = [word for _, word in self._newest.values() if word.vehicle != IDS]
        return sorted((w for w in words if w.number > number), key=lambda word: word.number)

    def write(self, word: Word) -> None:
        """Make a word durable."""
        self._put(word)
        _sync(self._fd)
        found, ours = self._path.stat(), os.fstat(self._fd)
        if (found.st_dev, found.st_ino) != (ours.st_dev, ours.st_ino):
            raise OSError(ENOENT, "it was removed or replaced while it was in use")

    def note_next_id(self, next_id: int, *, number: int) -> None:
        """Keep the task id that is next after the event of this number.

        The disk gets it in the kernel's time, half a minute: an older database is older than that.
        """
        self._put(Word(IDS, number, value=next_id))

    def close(self) -> None:
        """Close the file."""
        os.close(self._fd)

    def _put(self, word: Word) -> None:
        slot = 1 - self._newest[word.key][0] if word.key in self._newest else 0
        body = _BODY.pack(word.number, word.utc, word.value, word.reason, word.actor.encode()[:39])
        cell = _CRC.pack(crc32(body)) + body
        if os.pwrite(self._fd, cell, _place(slot, word.key)) < len(cell):
            raise OSError(0, "it was not written as a whole")
        self._newest[word.key] = slot, word


def _place(slot: int, key: int) -> int:
    if key < FIRST_ONES:
        return len(HEADER) + (slot * FIRST_ONES + key) * CELL
    return FIRST_SIZE + (slot * (REGISTERS - FIRST_ONES) + key - FIRST_ONES) * CELL


def _words_in(content: bytes) -> Iterator[tuple[int, tuple[int, Word]]]:
    """Yield the newest word of each register with its slot. ValueError: it is no record of ours."""
    if len(content) != SIZE or not content.startswith(HEADER):
        raise ValueError("it is damaged: look whether the rovers stand, then remove it")
    for key in range(REGISTERS):
        found: list[tuple[int, Word]] = []
        is_cut_short = 0
        for slot in range(SLOTS):
            begin = _place(slot, key)
            cell = content[begin : begin + CELL]
            if cell != _EMPTY:
                word = _word_in(cell, key)
                found += [] if word is None else [(slot, word)]
                is_cut_short += word is None
        if is_cut_short == SLOTS:
            raise ValueError("it is damaged: look whether the rovers stand, then remove it")
        if found:
            yield key, max(found, key=lambda each: each[1].number)


def _word_in(cell: bytes, key: int) -> Word | None:
    body = cell[_CRC.size : _CRC.size + _BODY.size]
    if _CRC.unpack_from(cell)[0] != crc32(body):
        return None
    number, utc, value, reason, actor = _BODY.unpack(body)
    return Word(
        key % VEHICLES,
        number,
        TaskReason(reason),
        actor.rstrip(b"\0").decode(errors="ignore"),
        utc,
        Register(key // VEHICLES),
        value,
    )


def _make(path: Path) -> None:
    """Make an empty record, as a whole or not at all."""
    fresh = path.with_name(f"{path.name}.new")
    with suppress(FileNotFoundError):
        fresh.unlink()
    fd = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with os.fdopen(fd, "wb") as file:
        file.write(HEADER.ljust(SIZE, b"\0"))
        file.flush()
        os.fsync(fd)
    fresh.rename(path)
    folder = os.open(path.parent, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(folder)  # that the file is there is durable, too
    finally:
        os.close(folder)


def _sync(fd: int) -> None:
    getattr(os, "fdatasync", os.fsync)(fd)  # macOS has no fdatasync
