"""The halt record: a small file beside the store that can store a STOP even on a full disk.

Opening the file writes every byte of it, so that no later write needs free space. (A copy-on-write
file system may still refuse; ``halt_keeper`` reports that.) The file has the last word (entry) of
each register of each vehicle, with the number of its event in the journal. A word with a higher
number than the database's last event is newer than the database.

A STOP, or an emergency stop, also ends tasks. Its own register tells the next server that the
database may still have these, whatever halts or resumes the vehicle later.

Each register has two cells, in different pages. A word overwrites the older cell, so that a torn
write leaves the previous word. Cells of registers that a later version adds go to the end of the
file; opening extends a shorter file. Vehicle 0, which does not exist, has the next task id, so that
no id is used twice after an older database was restored.

One process has the file for itself. Its header names the store that it belongs to, as that store
and all of its copies do: another store's halts are not taken for this one's.
"""

import os
import struct
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from errno import EIO
from pathlib import Path
from zlib import crc32

from mav_tasks.basics.errors import StoreError
from mav_tasks.store.held_file import HeldFile, InUse
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    QueuePaused,
    VehicleArmingSet,
    VehicleHalted,
)
from mav_tasks.tasks.lifecycle import TaskReason

HEADER = b"mav-tasks record of halts, version 1\n".ljust(64, b"\0")
FLEET = 48  # where in the header the store's name is, 16 bytes; zeros: none yet
VEHICLES = 256  # system ids, MAVLink
SLOTS = 2
CELL = 64  # bytes; divides a disk sector
IDS = 0  # the vehicle number of the next task id

#: number, UTC seconds, value, reason, actor; the CRC-32 of them stands in front
_BODY = struct.Struct("<QdIB39s")
_CRC = struct.Struct("<I")
_EMPTY = bytes(CELL)


class Register(IntEnum):
    """A vehicle's registers; each keeps its last word."""

    QUEUE = 0  # reason of the pause; NONE: the queue was continued
    HALTS = 1  # value: the halt epoch
    ARMING = 2  # value: whether the server may arm the vehicle
    STOPS = 3  # of HALTS, the last STOP
    EMERGENCIES = 4  # the last emergency stop of a ground station


#: what has ended tasks: by its reason
ENDS = {TaskReason.STOPPED: Register.STOPS, TaskReason.STOP: Register.EMERGENCIES}

FIRST_ONES = 2 * VEHICLES  # number of registers in the first version
REGISTERS = len(Register) * VEHICLES
FIRST_SIZE = len(HEADER) + SLOTS * FIRST_ONES * CELL
ADDED = SLOTS * VEHICLES * CELL  # bytes, of a register of a later version
SIZE = FIRST_SIZE + (len(Register) - 2) * ADDED


@dataclass(frozen=True, slots=True)
class Word:
    """An entry of a register, made from an event.

    ``number`` is the event's number in the journal, ``utc`` its time in seconds since 1970.
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
        """Index of the word's register in the file."""
        return self.register * VEHICLES + self.vehicle

    @property
    def is_halt(self) -> bool:
        """Whether the word pauses the vehicle's queue."""
        return self.register is Register.QUEUE and self.reason is not TaskReason.NONE


def words_of(event: Event, number: int, *, offset: float) -> list[Word]:
    """Return the words for an event; ``offset`` is UTC minus monotonic seconds."""
    match event:
        case QueuePaused(vehicle=vehicle, reason=reason, actor=actor, at=at):
            return [Word(vehicle, number, reason, actor, at + offset)]
        case VehicleHalted(vehicle=vehicle, reason=reason, actor=actor, epoch=epoch, at=at):
            halt = Word(vehicle, number, reason, actor, at + offset, Register.HALTS, epoch)
            ends = [replace(halt, register=ENDS[reason])] if reason in ENDS else []
            return ends if reason is TaskReason.STOP else [halt, *ends]
        case QueueContinued(vehicle=vehicle, actor=actor, at=at):
            return [Word(vehicle, number, TaskReason.NONE, actor, at + offset)]
        case VehicleArmingSet(vehicle=vehicle, may_arm=may_arm, at=at):
            register, value = Register.ARMING, int(may_arm)
            return [Word(vehicle, number, utc=at + offset, register=register, value=value)]
        case _:
            return []


def event_of(word: Word, *, offset: float) -> Event:
    """Return the event for a word of a register that the database has, too."""
    at = word.utc - offset
    if word.register is Register.HALTS:
        return VehicleHalted(word.vehicle, word.value, word.reason, word.actor, at)
    if word.register is Register.ARMING:
        return VehicleArmingSet(word.vehicle, bool(word.value), at)
    if word.is_halt:
        return QueuePaused(word.vehicle, word.reason, word.actor, at)
    return QueueContinued(word.vehicle, word.actor, at)


class HaltRecord:
    """The open file. Methods raise OSError if a write fails; one thread writes each cell."""

    def __init__(self, store: Path, *, name: str) -> None:
        """Open or create the record beside ``store``; raise StoreError if that fails.

        ``name`` is what people call the store.
        """
        self._path = store.with_name(f"{store.name}.halts")
        self._name = name
        try:
            if not os.path.lexists(self._path):
                _make(self._path)
            self._file = HeldFile(self._path)
        except OSError as error:
            raise self._error(error.strerror or str(error)) from error
        except InUse as error:
            raise self._error(str(error)) from None
        try:
            content = os.pread(self._file.fd, SIZE + 1, 0)
            if (len(content) - FIRST_SIZE) in range(0, SIZE - FIRST_SIZE, ADDED):
                content = content.ljust(SIZE, b"\0")
            self._newest = dict(_words_in(content))
            self._rewrite(content)
        except (OSError, ValueError) as error:
            self._file.close()
            raise self._error(getattr(error, "strerror", None) or str(error)) from error

    def _rewrite(self, content: bytes) -> None:
        if os.pwrite(self._file.fd, content, 0) < SIZE:  # a copied file may be sparse
            raise OSError(0, "the disk is full")
        os.fsync(self._file.fd)
        self._header = content[: len(HEADER)]

    @property
    def fleet(self) -> str:
        """The name of the store that the record belongs to; "": of none yet."""
        name = self._header[FLEET:]
        return name.hex() if any(name) else ""

    def belong_to(self, fleet: str) -> None:
        """Belong to a store from now on; raise StoreError if the record is another store's."""
        fleet = fleet.replace("-", "")
        if self.fleet and self.fleet != fleet:
            raise self._error(
                "it is the record of another store's halts: put this store's own record there, or"
                " check that the rovers stand still, and move it away"
            )
        self._header = self._header[:FLEET] + bytes.fromhex(fleet)
        try:
            os.pwrite(self._file.fd, self._header, 0)
            os.fsync(self._file.fd)
        except OSError as error:
            raise self._error(error.strerror or str(error)) from error

    def _error(self, words: str) -> StoreError:
        return StoreError(f"store {self._name}: {self._path.name}: {words}")

    def __repr__(self) -> str:
        return f"HaltRecord({self._path.name}, {len(self._newest)} words)"

    def next_id_after(self, number: int) -> int | None:
        """Return the next task id; None if a database whose last event is ``number`` knows it."""
        word = self._newest[IDS][1] if IDS in self._newest else None
        return None if word is None or word.number <= number else word.value

    @property
    def last_number(self) -> int:
        """The highest event number in the record."""
        return max((word.number for _, word in self._newest.values()), default=0)

    def words_after(self, number: int) -> list[Word]:
        """Return, in order, the words that a database whose last event is ``number`` lacks."""
        words = [word for _, word in self._newest.values() if word.vehicle != IDS]
        return sorted((w for w in words if w.number > number), key=lambda word: word.number)

    def write(self, *words: Word) -> None:
        """Make words durable; raise OSError if that fails, or if the file was replaced."""
        for word in words:
            self._put(word)
        os.fdatasync(self._file.fd)
        self._file.check()
        if os.pread(self._file.fd, len(HEADER), 0) != self._header:
            raise OSError(EIO, "another file was copied over it while it was in use")

    def outlast(self, words: Sequence[Word], number: int) -> None:
        """Renumber words: they count until the database has the event of that number.

        Raise StoreError if that fails.
        """
        try:
            self.write(*(replace(word, number=number) for word in words))
        except OSError as error:
            raise self._error(error.strerror or str(error)) from error

    def note_next_id(self, next_id: int, *, number: int) -> None:
        """Write the next task id as of event ``number``, without a sync.

        The kernel writes it to the disk within half a minute; a restored database is older.
        """
        self._put(Word(IDS, number, value=next_id))

    def close(self) -> None:
        self._file.close()

    def _put(self, word: Word) -> None:
        slot = 1 - self._newest[word.key][0] if word.key in self._newest else 0
        body = _BODY.pack(word.number, word.utc, word.value, word.reason, word.actor.encode()[:39])
        cell = _CRC.pack(crc32(body)) + body
        if os.pwrite(self._file.fd, cell, _place(slot, word.key)) < len(cell):
            raise OSError(0, "it was written only in part")
        self._newest[word.key] = slot, word


def _place(slot: int, key: int) -> int:
    if key < FIRST_ONES:
        return len(HEADER) + (slot * FIRST_ONES + key) * CELL
    added, vehicle = divmod(key - FIRST_ONES, VEHICLES)
    return FIRST_SIZE + added * ADDED + (slot * VEHICLES + vehicle) * CELL


def _words_in(content: bytes) -> Iterator[tuple[int, tuple[int, Word]]]:
    """Yield each register's newest word with its slot; raise ValueError if the file is damaged."""
    if len(content) != SIZE or not content.startswith(HEADER[:FLEET]):
        raise ValueError("it is damaged: check that the rovers stand still, then remove it")
    for key in range(REGISTERS):
        places = [_place(slot, key) for slot in range(SLOTS)]
        cells = [content[place : place + CELL] for place in places]
        words = [(slot, _word_in(cell, key)) for slot, cell in enumerate(cells) if cell != _EMPTY]
        found = [(slot, word) for slot, word in words if word is not None]
        if len(words) == SLOTS and not found:  # a torn write leaves one of them
            raise ValueError("it is damaged: check that the rovers stand still, then remove it")
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
    """Create an empty record atomically."""
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
        os.fsync(folder)
    finally:
        os.close(folder)
