"""What shared libraries of Windows and macOS export and need, read from their own tables."""

from __future__ import annotations

import struct
from dataclasses import dataclass


@dataclass(frozen=True)
class Library:
    """A shared library: its format and machine, the names that it exports, and the libraries that it needs."""

    kind: str
    machine: str
    exports: frozenset[str]
    needs: tuple[str, ...]
    signed: bool = False


def _text(data: bytes, at: int) -> str:
    return data[at : data.index(b"\0", at)].decode()


def pe(data: bytes) -> Library:
    """PE32+ (Microsoft's PE format)."""
    (head,) = struct.unpack_from("<I", data, 60)
    assert data[:2] == b"MZ"
    assert data[head : head + 4] == b"PE\0\0"
    machine, count = struct.unpack_from("<HH", data, head + 4)
    (optional,) = struct.unpack_from("<H", data, head + 20)
    (traits,) = struct.unpack_from("<H", data, head + 22)
    assert traits & 0x2000  # a DLL
    assert struct.unpack_from("<H", data, head + 24)[0] == 0x20B
    (exported, _), (imported, _) = struct.iter_unpack("<II", data[head + 136 : head + 152])
    sections = [struct.unpack_from("<II", data, head + 24 + optional + 40 * k + 12) for k in range(count)]
    raw = [struct.unpack_from("<II", data, head + 24 + optional + 40 * k + 16) for k in range(count)]

    def at(address: int) -> int:
        (virtual, _), (size, begin) = next(
            (s, r) for s, r in zip(sections, raw, strict=True) if s[0] <= address < s[0] + r[0]
        )
        assert size
        return begin + address - virtual

    (names,) = struct.unpack_from("<I", data, at(exported) + 24)
    (names_at,) = struct.unpack_from("<I", data, at(exported) + 32)
    pointers = struct.unpack_from(f"<{names}I", data, at(names_at))
    needs = []
    while imported:
        (name,) = struct.unpack_from("<I", data, at(imported) + 12)
        if not name:
            break
        needs.append(_text(data, at(name)))
        imported += 20
    exports = frozenset(_text(data, at(pointer)) for pointer in pointers)
    return Library("PE", {0x8664: "x86-64"}[machine], exports, tuple(needs))


def mach_o(data: bytes) -> list[Library]:
    """A universal file of 64-bit libraries (mach-o/fat.h, loader.h, nlist.h)."""
    magic, count = struct.unpack_from(">II", data)
    assert magic == 0xCAFEBABE
    parts = [struct.unpack_from(">IIIII", data, 8 + 20 * k) for k in range(count)]
    assert all(begin % (1 << align) == 0 for _, _, begin, _, align in parts)
    return [_mach_o(data[begin : begin + size], machine) for machine, _, begin, size, _ in parts]


def _mach_o(data: bytes, machine: int) -> Library:
    magic, own, _, kind, count, _, _, _ = struct.unpack_from("<8I", data)
    assert (magic, own, kind) == (0xFEEDFACF, machine, 6)  # 64 bits, the machine that was said, MH_DYLIB
    exports, needs, signed, at = set(), [], False, 32
    for _ in range(count):
        command, size = struct.unpack_from("<II", data, at)
        if command == 2:  # LC_SYMTAB
            symbols, number, strings, _ = struct.unpack_from("<4I", data, at + 8)
            for k in range(number):
                name, sort, section, _, _ = struct.unpack_from("<IBBHQ", data, symbols + 16 * k)
                if sort & 1 and section:  # N_EXT, and defined
                    exports.add(_text(data, strings + name).removeprefix("_"))
        if command == 0xC:  # LC_LOAD_DYLIB
            needs.append(_text(data, at + struct.unpack_from("<I", data, at + 8)[0]))
        signed |= command == 0x1D  # LC_CODE_SIGNATURE
        at += size
    return Library(
        "Mach-O", {0x01000007: "x86-64", 0x0100000C: "arm64"}[machine], frozenset(exports), tuple(needs), signed
    )
