"""Merges the copies of process data in a capture anew, by the rules of the ring alone, and compares that with what a
MainDevice made of them.

remerge.py CAPTURE.pcapng IMAGES.json: the capture has interface 0 for MAIN and 1 for REDUNDANT, both directions. The
images are what the MainDevice printed: {"first": the first cycle that counts, "cycles": [{"complete": whether every
logical read had the working counter that is usual for it, "inputs": hexadecimal text}, ...]}. Prints how many cycles
were compared and how many of them were incomplete, or the first difference, and ends with status 1 then.

Nothing here comes from the MainDevice: frames are told apart by their source address and Idx, copies by the bit of the
redundant link, a copy counts if it came back before the next cycle was sent. Working counters of both copies are added,
data of logical reads, which leave as zeros, is ORed. Where the sum is not the usual one, the inputs stay as they were.
"""

import collections
import json
import struct
import sys

LRD = 10
# Logical addresses from here on show AL status, and are no inputs.
PRESENCE = 0xE0000000
CLASS_BIT = 0x80
REDUNDANT_BIT = 0x08
OUTBOUND = 2


def packets(data):
    """Interface, direction (1 in, 2 out), time, bytes."""
    at = 0
    while at + 12 <= len(data):
        kind, length = struct.unpack_from("<II", data, at)
        if kind == 6:
            interface, high, low, captured, _ = struct.unpack_from("<IIIII", data, at + 8)
            begin = at + 28
            direction, option = 0, begin + (captured + 3) // 4 * 4
            while option + 4 <= at + length - 4:
                code, size = struct.unpack_from("<HH", data, option)
                if code == 2:
                    direction = struct.unpack_from("<I", data, option + 4)[0] & 3
                if code == 0:
                    break
                option += 4 + (size + 3) // 4 * 4
            yield interface, direction, high << 32 | low, data[begin : begin + captured]
        at += length


def datagrams(frame):
    """Command, Idx, address, data, working counter."""
    if frame[12:14] != b"\x88\xa4" or frame[15] >> 4 != 1:
        return
    at = 16
    more = True
    while more and at + 12 <= len(frame):
        command, index, address, length, _ = struct.unpack_from("<BBIHH", frame, at)
        more = length & 0x8000
        size = length & 0x07FF
        data = frame[at + 10 : at + 10 + size]
        counter = struct.unpack_from("<H", frame, at + 10 + size)[0]
        yield command, index, address, data, counter
        at += 12 + size


def is_input(command, address):
    return command == LRD and address < PRESENCE


class Flight:
    """A frame that is out: the reads of its copies, by the link they were sent on."""

    def __init__(self):
        self.copies = {}

    def merged(self):
        reads = {}
        for copy in self.copies.values():
            for address, (data, counter) in copy.items():
                before, total = reads.get(address, (bytes(len(data)), 0))
                reads[address] = (bytes(a | b for a, b in zip(before, data)), total + counter)
        return reads


def cycles(path):
    """The reads of each cycle: address to data and summed working counter."""
    with open(path, "rb") as file:
        data = file.read()
    out, sent_at, collected = {}, None, []
    for _, direction, time, frame in packets(data):
        found = list(datagrams(frame))
        if not found or found[0][1] & CLASS_BIT:
            continue
        key, redundant = (frame[7], found[0][1]), bool(frame[6] & REDUNDANT_BIT)
        if direction == OUTBOUND:
            if time != sent_at:
                collected.append(out)
                out, sent_at = {}, time
            if not redundant:
                out[key] = Flight()
                inputs = (each for each in found if is_input(each[0], each[2]))
                out[key].asked = {address: len(data) for _, _, address, data, _ in inputs}
        elif key in out and redundant not in out[key].copies:
            out[key].copies[redundant] = {
                address: (data, counter) for command, _, address, data, counter in found if is_input(command, address)
            }
    # The last sent frames are not evaluated.
    return collected


def main():
    runs = cycles(sys.argv[1])
    sums = collections.defaultdict(collections.Counter)
    merged = []
    for run in runs:
        asked, reads = {}, {}
        for flight in run.values():
            asked.update(flight.asked)
            reads.update(flight.merged())
        merged.append((asked, reads))
        for address, (_, counter) in reads.items():
            sums[address][counter] += 1
    usual = {address: counted.most_common(1)[0][0] for address, counted in sums.items()}
    inputs, result = {}, []
    for asked, reads in merged:
        complete = bool(asked)
        for address, length in asked.items():
            data, counter = reads.get(address, (b"", 0))
            inputs.setdefault(address, bytes(length))
            if counter == usual.get(address):
                inputs[address] = data
            else:
                complete = False
        text = b"".join(inputs[address] for address in sorted(inputs)).hex()
        result.append({"complete": complete, "inputs": text})
    with open(sys.argv[2]) as file:
        printed = json.load(file)
    compare(printed["cycles"], result, printed["first"])


def compare(printed, merged, first):
    """Ends with status 1 at the first difference. In an incomplete cycle only inputs of responding SubDevices count."""
    if len(merged) < len(printed):
        sys.exit(f"{len(merged)} cycles in the capture, {len(printed)} printed")
    incomplete = 0
    for number, (theirs, ours) in enumerate(zip(printed, merged)):
        if number < first:
            continue
        same = theirs["complete"] == ours["complete"]
        if not same or (ours["complete"] and theirs["inputs"] != ours["inputs"]):
            sys.exit(f"cycle {number}: printed {theirs}, merged {ours}")
        incomplete += not ours["complete"]
    print(len(printed) - first, incomplete)


main()
