"""Frames and datagrams of a capture (pcapng), and the registers of distributed clocks in them."""
import collections
import struct


APWR, FPRD, FPWR, BWR, ARMW, FRMW = 2, 4, 5, 8, 13, 14
STATION, DL_CONTROL, DL_STATUS = 0x0010, 0x0100, 0x0110
LATCH, LATCH_END, SYSTEM_TIME, OFFSET, DELAY, FILTERS = 0x0900, 0x0920, 0x0910, 0x0920, 0x0928, 0x0930
LATCH_MODE = 0x0936
SENT, REDUNDANT_BIT = 2, 0x08
# SubDevices set this bit of the source address.
PASSED_BIT = 0x02
# Order in which a frame passes the ports; the processing unit is behind port 0.
ORDER = [0, 3, 1, 2]
# Distributed times are checked when the last reading is at most so old.
READING_NS = 1_000_000_000
# Writes that belong together are not further apart.
QUIET_NS = 5_000_000
# Runs of latches before a write, and measurements, that are kept.
RUNS, MEASURED = 8, 16
FINDINGS_PRINTED = 20
# How far delays may be off that come from several measurements of cables: what one hop may be off.
REMEMBERED_NS = 20.0
# Steps after which the search for cables that fit ends.
MOST_STEPS = 100_000

Frame = collections.namedtuple("Frame", "number time sent source datagrams")
Datagram = collections.namedtuple("Datagram", "command address register data counter")


def signed(value, bits):
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def frames_of(path):
    """Frames of EtherCAT in the order of the file, numbered as others number them."""
    with open(path, "rb") as file:
        data = file.read()
    at = number = 0
    resolutions = []
    while at + 12 <= len(data):
        kind, length = struct.unpack_from("<II", data, at)
        if length < 12:
            raise SystemExit(f"{path} is damaged at byte {at}")
        if kind == 1:
            resolutions.append(options(data, at + 16, at + length).get(9, b"\x06")[0])
        elif kind == 6:
            number += 1
            interface, high, low, captured, _ = struct.unpack_from("<IIIII", data, at + 8)
            begin = at + 28
            flags = options(data, begin + (captured + 3) // 4 * 4, at + length).get(2, b"\0")[0]
            time = (high << 32 | low) * 10 ** (9 - resolutions[interface])
            frame = data[begin:begin + captured]
            if frame[12:14] == b"\x88\xa4":
                source = bytes([frame[6] & ~PASSED_BIT, *frame[7:12]])
                yield Frame(number, time, flags & 3 == SENT, source, list(datagrams_of(frame)))
        at += length


def options(data, at, end):
    """Options of a block, by code."""
    found = {}
    while at + 4 <= end - 4:
        code, size = struct.unpack_from("<HH", data, at)
        if code == 0:
            break
        found[code] = data[at + 4:at + 4 + size]
        at += 4 + (size + 3) // 4 * 4
    return found


def datagrams_of(frame):
    at, more = 16, True
    while more and at + 12 <= len(frame):
        command, index, address, register, flags, _ = struct.unpack_from("<BBHHHH", frame, at)
        more, size = flags & 0x8000, flags & 0x07FF
        if at + 12 + size > len(frame):
            return
        data = frame[at + 10:at + 10 + size]
        yield index, Datagram(command, address, register, data, struct.unpack_from("<H", frame, at + 10 + size)[0])
        at += 12 + size
