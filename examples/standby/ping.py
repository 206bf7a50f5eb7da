"""Sends ICMP echo requests to an address, and waits a second for each answer: `ping.py ADDRESS [COUNT]`, as root.

The exit status is 0 if all were answered. Machines without `ping` have Python.
"""
import socket
import struct
import sys
import time

IDENTIFIER = 0x5243


def checksum(data):
    total = sum(struct.unpack(f"!{len(data) // 2}H", data))
    total = (total >> 16) + (total & 0xFFFF)
    return ~(total + (total >> 16)) & 0xFFFF


def answered(connection, number):
    """Whether the answer to this request comes within a second."""
    until = time.monotonic() + 1
    while (rest := until - time.monotonic()) > 0:
        connection.settimeout(rest)
        try:
            packet = connection.recv(2048)
        except TimeoutError:
            break
        kind, _, _, identifier, sequence = struct.unpack("!BBHHH", packet[20:28])
        if (kind, identifier, sequence) == (0, IDENTIFIER, number):
            return True
    return False


def main():
    address, count = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1
    connection = socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_ICMP)
    times = []
    for number in range(count):
        body = bytes(range(56))
        head = struct.pack("!BBHHH", 8, 0, 0, IDENTIFIER, number)
        begin = time.monotonic()
        connection.sendto(struct.pack("!BBHHH", 8, 0, checksum(head + body), IDENTIFIER, number) + body, (address, 0))
        if answered(connection, number):
            times.append((time.monotonic() - begin) * 1e3)
    middle = f", median {sorted(times)[len(times) // 2]:.1f} ms" if times else ""
    print(f"ping {address}: {len(times)} of {count} answered{middle}")
    return 0 if len(times) == count else 1


if __name__ == "__main__":
    sys.exit(main())
