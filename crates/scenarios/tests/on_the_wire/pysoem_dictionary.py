"""The objects of simulated SubDevices as another project's MainDevice (SOEM, through pysoem) lists them.

pysoem_dictionary.py INTERFACE COUNT: reads from all SubDevices, which offer SDO information, the object list, the
description of each object and of each of its entries, and every value that may be read, as `slaveinfo -sdo -map` of
SOEM does; then the assignment and mapping of PDOs, against which the sizes of the process data are held. Prints one
line per SubDevice; ends with an error where a description and a value do not fit each other.
"""

import struct
import sys

import pysoem

from pysoem_bus import end, find

READ_PREOP = 0x0001


def describe(device):
    """Objects, entries and values read from one SubDevice."""
    objects, entries, values = 0, 0, 0
    for described in device.od:
        objects += 1
        place = f"{device.name} {described.index:#06x}"
        if not described.name:
            sys.exit(f"{place} has no name")
        # A variable is described by itself.
        listed = described.entries or [described]
        for sub, entry in enumerate(listed):
            entries += 1
            # A gap of a record has no type and no rights.
            if not entry.obj_access & READ_PREOP:
                continue
            got = device.sdo_read(described.index, sub, 200_000)
            values += 1
            if entry.bit_length and len(got) != (entry.bit_length + 7) // 8:
                sys.exit(f"{place}:{sub} has {entry.bit_length} bits and {len(got)} bytes")
    return objects, entries, values


def mapped_bits(device, assignment):
    """Bits of the PDOs that are assigned to a SyncManager; 0 where there is no such object."""
    try:
        count = device.sdo_read(assignment, 0)[0]
    except pysoem.SdoError:
        return 0
    bits = 0
    for place in range(1, count + 1):
        pdo = struct.unpack("<H", device.sdo_read(assignment, place))[0]
        for sub in range(1, device.sdo_read(pdo, 0)[0] + 1):
            bits += struct.unpack("<I", device.sdo_read(pdo, sub))[0] & 0xFF
    return bits


def main():
    main_device = find(sys.argv[1], int(sys.argv[2]))
    devices = main_device.slaves
    for device in devices:
        objects, entries, values = describe(device)
        out, back = mapped_bits(device, 0x1C12), mapped_bits(device, 0x1C13)
        print(f"{device.name}: {objects} objects, {entries} entries, {values} values, {out}/{back} bits", flush=True)
    main_device.config_map()
    for device in devices:
        sizes = [len(device.output), len(device.input)]
        said = [(mapped_bits(device, assignment) + 7) // 8 for assignment in (0x1C12, 0x1C13)]
        if sizes != said:
            sys.exit(f"{device.name}: {sizes} bytes are mapped, its objects say {said}")
    end(main_device)
    print(f"{len(devices)} described", flush=True)


main()
