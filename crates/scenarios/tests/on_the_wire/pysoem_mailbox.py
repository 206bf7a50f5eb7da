"""The mailbox of a simulated SubDevice as another project's MainDevice (SOEM, through pysoem) sees it.

pysoem_mailbox.py INTERFACE: expects one device `all-protocols`. Reads and writes objects (expedited, normal, in
segments, complete access), reads the object list with descriptions, transfers files, writes firmware in BOOT. Prints
one line per step; ends with an error where something is not as it should be.
"""

import struct
import sys
import time

import pysoem

from pysoem_bus import find

LARGE, SETTINGS, ARRAY = 0x2002, 0x2003, 0x2001
PACKET = 1012


def check(what, got, expected):
    if got != expected:
        sys.exit(f"{what}: expected {expected!r:.80}, got {got!r:.80}")


def step(text):
    print(text, flush=True)


def objects(device):
    check("identity", struct.unpack("<I", device.sdo_read(0x1018, 1))[0], device.man)
    check("device name", device.sdo_read(0x1008, 0), b"all-protocols")
    device.sdo_write(SETTINGS, 1, struct.pack("<h", -42))
    check("expedited", device.sdo_read(SETTINGS, 1), struct.pack("<h", -42))
    large = bytes(place % 251 for place in range(100_000))
    check("100 kB in segments", device.sdo_read(LARGE, 0, 100_000), large)
    for length in (5, 1008, 1009, 5000, 60_000):
        data = bytes(place * 7 % 253 for place in range(length))
        device.sdo_write(LARGE, 0, data)
        check(f"{length} bytes written in segments", device.sdo_read(LARGE, 0, 100_000), data)
    complete = device.sdo_read(ARRAY, 0, 1000, True)
    entries = b"".join(struct.pack("<H", n) for n in range(1, 201))
    check("complete access", complete, struct.pack("<BB", 200, 0) + entries)
    for index, sub, data, code in (
        (0x5000, 0, None, 0x0602_0000),
        (0x1018, 9, None, 0x0609_0011),
        (0x1018, 1, bytes(4), 0x0601_0002),
        (SETTINGS, 1, struct.pack("<h", 500), 0x0609_0031),
        (SETTINGS, 3, None, 0x0601_0001),
    ):
        try:
            device.sdo_read(index, sub) if data is None else device.sdo_write(index, sub, data)
            sys.exit(f"{index:#06x}:{sub} gave no abort")
        except pysoem.SdoError as error:
            check(f"abort of {index:#06x}:{sub}", error.abort_code, code)
    step("objects ok")


def dictionary(device):
    found = {entry.index: entry for entry in device.od}
    for index in (0x1000, 0x1018, 0x10F3, 0x1600, ARRAY, LARGE, 0x7000):
        if index not in found:
            sys.exit(f"object {index:#06x} is not listed")
    check("name", found[SETTINGS].name, b"Settings")
    check("object code", found[LARGE].object_code, 2)
    ramp = found[SETTINGS].entries[2]
    check("entry", (ramp.name, ramp.data_type, ramp.bit_length), (b"Ramp", 7, 32))
    step(f"dictionary ok: {len(found)} objects")


def files(device):
    for length in (1, PACKET - 1, PACKET, PACKET + 1, 40_000):
        data = bytes(place * 5 % 241 for place in range(length))
        check("written", device.foe_write("file", 0, data), 1)
        check(f"file of {length} bytes", bytes(device.foe_read("file", 0, 100_000)), data)
    step("files ok")


def to_state(main_device, device, state):
    device.state = state
    device.write_state()
    got = device.state_check(state, 3_000_000)
    check("state", got, state)


def firmware(main_device, device):
    version, program = b"9.9.9", bytes(3000)
    image = b"RCFW" + bytes([len(version)]) + version + program
    image += struct.pack("<I", sum(image) & 0xFFFF_FFFF)
    to_state(main_device, device, pysoem.INIT_STATE)
    device.amend_mbx("out", 0x1000, 512)
    device.amend_mbx("in", 0x1400, 512)
    to_state(main_device, device, pysoem.BOOT_STATE)
    check("firmware", device.foe_write("firmware.bin", 0, image, 5_000_000), 1)
    to_state(main_device, device, pysoem.INIT_STATE)
    device.amend_mbx("out", 0x1000, 1024)
    device.amend_mbx("in", 0x1400, 1024)
    to_state(main_device, device, pysoem.PREOP_STATE)
    check("new version", device.sdo_read(0x100A, 0), version)
    step("firmware ok")


def main():
    main_device = find(sys.argv[1], 1)
    device = main_device.slaves[0]
    objects(device)
    dictionary(device)
    files(device)
    firmware(main_device, device)
    main_device.close()


main()
