"""A client of a mailbox gateway (ETG.8200, protocol 10.1), written from the protocol alone: it shares nothing with the
gateway.

Usage: gateway_client.py good|bad ADDRESS STATION, where the SubDevice STATION has the objects of `all-protocols`.
good: whole dictionaries, large objects, files and many clients, over UDP and TCP. bad: what is no message.
"""
import socket, struct, sys, threading, time

WHAT, HOST, STATION = sys.argv[1], sys.argv[2], int(sys.argv[3], 0)
PORT = 34980
COE, FOE = 3, 4


def message(station, counter, kind, payload):
    mail = struct.pack("<HHBB", len(payload), station, 0, kind | counter << 4) + payload
    return struct.pack("<H", len(mail) | 5 << 12) + mail


class Client:
    def __init__(self, over):
        self.udp, self.counter, self.left = over == "udp", 0, b""
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM if self.udp else socket.SOCK_STREAM)
        self.socket.settimeout(10)
        self.socket.connect((HOST, PORT))

    def receive(self):
        if self.udp:
            whole = self.socket.recv(4096)
        else:
            while len(self.left) < 2 or len(self.left) < 2 + (struct.unpack("<H", self.left[:2])[0] & 0x7FF):
                more = self.socket.recv(4096)
                if not more:
                    raise ConnectionError("closed")
                self.left += more
            length = 2 + (struct.unpack("<H", self.left[:2])[0] & 0x7FF)
            whole, self.left = self.left[:length], self.left[length:]
        head, length, station, _, kind = struct.unpack("<HHHBB", whole[:8])
        assert head == (len(whole) - 2) | 5 << 12 and length == len(whole) - 8, whole.hex()
        return station, kind & 15, kind >> 4, whole[8:]

    def ask(self, station, kind, payload):
        self.counter = self.counter % 7 + 1
        self.socket.sendall(message(station, self.counter, kind, payload))
        return self.answer(station, kind)

    def answer(self, station, kind):
        got = self.receive()
        assert got[:3] == (station, kind, self.counter), got
        return got[3]

    def upload(self, station, index, sub, complete=False):
        command = 0x50 if complete else 0x40
        data = self.ask(station, COE, struct.pack("<HBHBL", 2 << 12, command, index, sub, 0))
        scs, at, at_sub, size = struct.unpack("<xxBHBL", data[:10])
        assert (at, at_sub) == (index, sub)
        if scs >> 5 == 4:
            raise LookupError("abort %08x" % size)
        if scs & 2:
            return data[6 : 10 - (scs >> 2 & 3)]
        value, toggle = data[10:], 0
        while len(value) < size:
            data = self.ask(station, COE, struct.pack("<HB7x", 2 << 12, 0x60 | toggle))
            assert data[2] & 0xF0 == toggle, data[:3].hex()
            value += data[3:] if len(data) > 10 else data[3 : 10 - (data[2] >> 1 & 7)]
            toggle ^= 0x10
            assert data[2] & 1 == (len(value) == size)
        assert len(value) == size
        return value

    def download(self, station, index, sub, value):
        command = 0x23 | (4 - len(value)) << 2
        data = self.ask(station, COE, struct.pack("<HBHB4s", 2 << 12, command, index, sub, value))
        assert data[2:6] == struct.pack("<BHB", 0x60, index, sub), data.hex()

    def information(self, station, opcode, body):
        data = self.ask(station, COE, struct.pack("<HBBH", 8 << 12, opcode, 0, 0) + body)
        whole = b""
        while True:
            service, op, _, left = struct.unpack("<HBBH", data[:6])
            assert service >> 12 == 8
            if op & 0x7F == 7:
                raise LookupError("abort %08x" % struct.unpack("<L", data[6:10]))
            assert op & 0x7F == opcode + 1 and bool(op & 0x80) == (left > 0)
            whole += data[6:]
            if left == 0:
                return whole
            data = self.answer(station, COE)

    def file(self, station, name):
        data, content, packet = self.ask(station, FOE, struct.pack("<BxL", 1, 0) + name), b"", 1
        while True:
            assert data[0] == 3 and struct.unpack("<L", data[2:6])[0] == packet, data[:6].hex()
            content += data[6:]
            ended = len(data) - 6 < 1024 - 12
            acknowledge = struct.pack("<BxL", 4, packet)
            if ended:
                self.counter = self.counter % 7 + 1
                self.socket.sendall(message(station, self.counter, FOE, acknowledge))
                return content
            data, packet = self.ask(station, FOE, acknowledge), packet + 1


def dictionary(client, station):
    """Every entry that is described is read; what is described has the length of what is read."""
    indices = client.information(station, 1, struct.pack("<H", 1))[2:]
    entries = 0
    for (index,) in struct.iter_unpack("<H", indices):
        description = client.information(station, 3, struct.pack("<H", index))
        top, code = struct.unpack("<xxxxBB", description[:6])
        is_array = code == 8
        # Of long arrays the first ones stand for all.
        for sub in range(0, (min(top, 3) if is_array else top) + 1):
            try:
                entry = client.information(station, 5, struct.pack("<HBB", index, sub, 1))
            except LookupError:
                continue
            kind, bits, access = struct.unpack("<HHH", entry[4:10])
            if not access & 7:
                continue
            try:
                value = client.upload(station, index, sub)
            except LookupError:
                assert is_array, hex(index)
                continue
            if kind not in (0x9, 0xA, 0xB, 0xF):
                assert len(value) * 8 - bits in range(8), (hex(index), sub, bits, value)
            entries += 1
    return len(indices) // 2, entries


def good():
    for over, station in (("udp", 0), ("tcp", STATION)):
        client = Client(over)
        assert client.upload(0, 0x1008, 0) == b"RingCAT"
        begin = time.monotonic()
        objects, entries = dictionary(client, station)
        took = time.monotonic() - begin
        print(f"{over} station {station:#06x}: {objects} objects, {entries} entries in {took:.2f} s", flush=True)
        complete = client.upload(0, 0x8001, 0, complete=True)
        assert complete[2:4] == struct.pack("<H", STATION) and complete[68:].startswith(b"all-protocols")
        large = client.upload(STATION, 0x2002, 0)
        assert large == bytes(place % 251 for place in range(len(large))) and len(large) == 100_000
        assert client.file(STATION, b"log.txt") == b"nothing happened\n" * 100
        print(over, "large object and file ok", flush=True)
    failed = []

    def busy(over, sub):
        try:
            client = Client(over)
            for number in range(25):
                client.download(STATION, 0x2001, sub, struct.pack("<H", number * 256 + sub))
                assert client.upload(STATION, 0x2001, sub) == struct.pack("<H", number * 256 + sub)
                assert client.upload(0, 0x1008, 0) == b"RingCAT"
        except BaseException as error:
            failed.append((over, sub, error))

    threads = [threading.Thread(target=busy, args=(("udp", "tcp")[sub % 2], sub)) for sub in range(1, 9)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed, failed
    print("many clients ok", flush=True)


def bad():
    name = struct.pack("<HBHBL", 2 << 12, 0x40, 0x1008, 0, 0)
    right = message(0, 1, COE, name)
    client = Client("tcp")
    client.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    for byte in right:
        client.socket.sendall(bytes([byte]))
        time.sleep(0.002)
    assert client.receive()[3].endswith(b"RingCAT")
    client.socket.sendall(b"".join(message(0, counter, COE, name) for counter in (1, 2, 3)) + right[:7])
    assert [client.receive()[2] for _ in range(3)] == [1, 2, 3]
    client.socket.sendall(right[7:])
    assert client.receive()[3].endswith(b"RingCAT")
    print("split and joined ok", flush=True)

    # Not messages: over TCP what is not framed costs the connection, over UDP all is dropped.
    wrong_type = struct.pack("<H", 16 | 4 << 12) + right[2:]
    short_mail = struct.pack("<H", 3 | 5 << 12) + right[2:5]
    for what in (wrong_type, b"\xff" * 40, b"\x00" * 40, b"GET / HTTP/1.0\r\n\r\n"):
        victim = Client("tcp")
        victim.socket.sendall(what)
        try:
            assert victim.socket.recv(10) == b"", what
        except ConnectionError:
            pass
    # One that is framed and holds nothing is dropped: what follows is where it should be.
    client.socket.sendall(short_mail + right)
    assert client.receive()[3].endswith(b"RingCAT")
    silent = Client("udp")
    silent.socket.settimeout(0.2)
    for what in (b"", b"\x10", wrong_type, short_mail, right[:-1], b"\xff" * 1400, b"\x00" * 40):
        silent.socket.send(what)
    try:
        raise AssertionError(silent.socket.recv(100).hex())
    except TimeoutError:
        pass
    for cut in (1, 2, 5, len(right) - 1):
        Client("tcp").socket.sendall(right[:cut])
    # A wrong inner length and an unknown address are answered with an error reply.
    asker = Client("udp")
    odd = bytearray(right)
    odd[2] += 1
    for station, kind, whole in ((0, COE, bytes(odd)), (0x7777, COE, message(0x7777, 1, COE, name)),
                                 (0, FOE, message(0, 1, FOE, name)), (STATION, 9, message(STATION, 1, 9, name))):
        asker.socket.send(whole)
        asker.socket.settimeout(0.3)
        try:
            got = asker.receive()
            assert got[:3] == (station, 0, 1) and got[3][:2] == b"\x01\x00", got
            print("error reply", hex(station), kind, got[3][2:].hex(), flush=True)
        except TimeoutError:
            print("dropped", hex(station), kind, flush=True)
    assert client.upload(0, 0x1008, 0) == b"RingCAT" and Client("udp").upload(STATION, 0x1008, 0)
    print("bad clients ok", flush=True)


{"good": good, "bad": bad}[WHAT]()
