"""The check: what a capture shows of the set-up of clocks, compared with what follows from the latched times."""
import collections

from capture import (
    APWR, ARMW, BWR, DELAY, DL_CONTROL, DL_STATUS, FILTERS, FPRD, FPWR, FRMW, LATCH, LATCH_END, LATCH_MODE, MEASURED,
    OFFSET, QUIET_NS, READING_NS, REDUNDANT_BIT, RUNS, STATION, SYSTEM_TIME, signed,
)
from parts import Part, Ring, SubDevice, Units


class Checker:
    """Takes frames in the order of the capture."""

    def __init__(self, within, times):
        self.within, self.times = within, times
        self.subdevices = collections.defaultdict(SubDevice)
        self.findings = []
        self.checked = collections.Counter()
        self.errors = {"delay": 0.0, "offset": 0.0, "prediction": 0.0}
        self.out = {}
        # Latches since something was written or loops were set, each by station: offset from 0x0900 to byte.
        self.latches, self.written, self.written_at = [], {}, 0
        # Latches between two settings of loops, with open ports by station and stations by part in their order.
        self.runs, self.group = [], []
        # All that was measured; local times at the last latch.
        self.units, self.local = [], {}
        # Cables that were seen last, by end; what was measured of them; where frames come in.
        self.cables, self.links, self.entry = {}, {}, None
        self.reading = {}

    def find(self, frame, station, text):
        self.findings.append(f"frame {frame}, SubDevice {station:#06x}: {text}")

    def frame(self, frame):
        if self.written and frame.time - self.written_at > QUIET_NS:
            self.conclude(frame.number)
        key = (frame.source, frame.datagrams[0][0] if frame.datagrams else 0)
        datagrams = [datagram for _, datagram in frame.datagrams]
        if frame.sent:
            self.out[key] = (frame.time, datagrams)
            for datagram in datagrams:
                self.goes(frame, datagram)
            return
        sent_at, all_sent = self.out.get(key, (0, []))
        for sent, datagram in zip(all_sent, datagrams):
            if datagram.counter and sent.command == datagram.command:
                self.came(frame, sent_at, sent, datagram)

    def goes(self, frame, datagram):
        if datagram.command == BWR and datagram.register == LATCH:
            if frame.source[0] & REDUNDANT_BIT == 0:
                self.conclude(frame.number)
                self.latches.append({})
        elif datagram.command in (FRMW, ARMW) and datagram.register == SYSTEM_TIME and not self.written:
            self.hands_out(frame, datagram)

    def came(self, frame, sent_at, sent, datagram):
        part = frame.source[0] & REDUNDANT_BIT
        command, register, data = sent.command, sent.register, datagram.data
        if command == APWR and register == STATION:
            subdevice = self.subdevices[int.from_bytes(data[:2], "little")]
            subdevice.__init__()
            subdevice.part, subdevice.position = part, -sent.address & 0xFFFF
        if command in (FRMW, ARMW) and register == SYSTEM_TIME:
            self.reading[sent.address] = (sent_at, int.from_bytes(data[:4], "little"))
        if command not in (FPRD, FPWR) or sent.address not in self.subdevices:
            return
        subdevice = self.subdevices[sent.address]
        subdevice.part = part
        inside = lambda address, size: register <= address and address + size <= register + len(data)
        word = lambda address, size: int.from_bytes(data[address - register:][:size], "little")
        if command == FPRD:
            if inside(DL_STATUS, 2):
                subdevice.dl_status = word(DL_STATUS, 2)
            if LATCH <= register and register + len(data) <= LATCH_END and self.latches:
                self.latches[-1].setdefault(sent.address, {}).update({register + at: b for at, b in enumerate(data)})
            return
        if inside(LATCH_MODE, 1):
            # What was latched before showed where frames come in; it was latched otherwise.
            self.latches = []
        if inside(DL_CONTROL + 1, 1):
            self.end_run()
            loops = word(DL_CONTROL + 1, 1)
            subdevice.closed = {port: loops >> (2 * port) & 3 == 3 for port in range(4)}
        if inside(OFFSET, 8):
            self.begin_writing(frame)
            subdevice.written_in = part
            subdevice.offset, subdevice.filters_due = word(OFFSET, 8), frame.number
            self.written.setdefault(sent.address, set()).add("offset")
        if inside(DELAY, 4):
            self.begin_writing(frame)
            subdevice.written_in = part
            subdevice.delay = signed(word(DELAY, 4), 32)
            self.written.setdefault(sent.address, set()).add("delay")
        if inside(FILTERS, 2):
            subdevice.filters_due = None

    def begin_writing(self, frame):
        """The first write after latches: these are what it was computed from."""
        self.written_at = frame.time
        self.end_run()
        if self.runs:
            self.group, self.runs = self.runs, []

    def end_run(self):
        """What was latched so far was latched with these ports."""
        if self.latches:
            parts = {part: [s for s in self.order() if self.subdevices[s].part == part] for part in (0, REDUNDANT_BIT)}
            known = {s: self.subdevices[s].ports() for s in self.order() if self.subdevices[s].dl_status is not None}
            self.runs = [*self.runs[1 - RUNS:], (self.latches, known, parts)]
            self.latches = []

    def hands_out(self, frame, datagram):
        """The time that a frame leaves with, and whose it is."""
        if datagram.command == FRMW and self.subdevices[datagram.address].delay not in (0, None):
            delay = self.subdevices[datagram.address].delay
            self.find(frame.number, datagram.address, f"its time is handed out, though its delay is {delay} ns")
        known = self.reading.get(datagram.address)
        if known and frame.time - known[0] < READING_NS:
            expected = known[1] + frame.time - known[0]
            error = signed(int.from_bytes(datagram.data[:4], "little") - expected, 32)
            self.checked["times"] += 1
            self.errors["prediction"] = max(self.errors["prediction"], abs(error))
            if abs(error) > self.times:
                self.find(frame.number, datagram.address, f"a time is sent that is {error} ns from what is known of it")

    def conclude(self, number):
        """Checks what was written together."""
        if not self.written:
            return
        written, self.written = self.written, {}
        candidates = self.compute(any("offset" in kinds for kinds in written.values()))
        parts = {self.subdevices[station].written_in for station in written}
        for part in sorted(parts):
            here = [station for station in written if self.subdevices[station].written_in == part]
            self.delays(number, [s for s in here if "delay" in written[s]], candidates)
            self.offsets(number, part, [s for s in here if "offset" in written[s]])
        self.group = []

    def compute(self, offsets):
        """Processing units' delays by station, from all latches of a run: without the last one where `offsets` were
        written, which serves these alone, and with and without the first one, which belongs to a scan of the cabling
        that may have been repeated. Earlier measurements count too: the delay of a cable does not change."""
        results = []
        for number, (latches, ports, parts) in enumerate(self.group):
            whole = [latch for latch in (self.complete(latch) for latch in latches) if latch]
            if whole:
                self.local = {station: times[4] for station, times in whole[-1].items()}
            chosen = whole[:-1] if offsets and number == len(self.group) - 1 else whole
            for chosen in (chosen[1:], chosen):
                # One latch of a SubDevice that came back measures nothing.
                if len(chosen) > 1 or (chosen and not self.units):
                    results.append(self.measure(chosen, ports, parts))
        results = [known for known in results if known.units]
        self.units = [*self.units, *results][-MEASURED:]
        return self.units or [Units()]

    def complete(self, latch):
        """Times of ports 0 to 3 and of the processing unit, of those that were read as a whole."""
        times = {}
        for station, read in latch.items():
            word = lambda at, size: int.from_bytes(bytes(read[LATCH + at + byte] for byte in range(size)), "little")
            if all(LATCH + at in read for at in [*range(16), *range(24, 32)]):
                times[station] = [word(4 * port, 4) for port in range(4)] + [word(24, 8)]
        return times

    def measure(self, latches, ports, parts):
        stations = set.intersection(*(set(latch) for latch in latches))
        passed = {s: (latches[-1][s][4] - latches[0][s][4]) & 0xFFFF_FFFF for s in stations}
        reference = next((s for s in self.order() if s in stations and self.subdevices[s].delay == 0), None)
        times = {}
        for station in stations:
            scale = passed[reference] / passed[station] if reference and passed[station] and passed[reference] else 1
            # Differences survive wraps; those to a port that is closed do not.
            first = (ports.get(station) or [0])[0]
            since = [
                [signed(latch[station][port] - latch[station][first], 32) for port in range(4)] for latch in latches
            ]
            times[station] = [scale * sum(one[port] for one in since) / len(since) for port in range(4)]
        entries = {station: self.first_port(latches[0][station], ports.get(station, [])) for station in stations}
        result = Units()
        for part, members in parts.items():
            if not members or any(station not in ports for station in members):
                continue
            tree = Part(members, ports, part != 0, entries, times)
            known = None
            if tree.is_even:
                known = tree.units()
                self.cables.update(tree.cables)
                self.entry = tree.entry if part == 0 else self.entry
            elif part == 0 and self.entry:
                ring = Ring(members, ports, self.entry, self.cables)
                known = ring.units(times, self.links) if ring.is_even else None
            if known:
                self.links.update(known.links)
                result.units.update(known.units)
                result.shares += known.shares
                result.within = known.within or result.within
        return result

    def first_port(self, times, ports):
        """Where the frame came in first."""
        is_first = lambda port: all(signed(times[other] - times[port], 32) >= 0 for other in ports)
        return [port for port in ports if is_first(port)][:1]

    def finish(self, number):
        self.conclude(number)
        for station in self.order():
            if self.subdevices[station].filters_due:
                text = "an offset was written, and its filters were not restarted"
                self.find(self.subdevices[station].filters_due, station, text)

    def order(self):
        known = [s for s, subdevice in self.subdevices.items() if subdevice.position is not None]
        return sorted(known, key=lambda s: (self.subdevices[s].part, self.subdevices[s].position))

    def delays(self, number, stations, candidates):
        parts = {self.subdevices[s].written_in for s in stations}
        there = [s for s in self.order() if self.subdevices[s].written_in in parts]
        zero = next((s for s in there if self.subdevices[s].delay == 0), None)
        checked = {zero, *stations} - {None}
        candidates = [known for known in candidates if checked <= set(known.units)] or candidates[-1:]
        stations = [s for s in stations if s in candidates[-1].units]
        if not stations:
            return
        zero = zero if zero in candidates[-1].units else None
        if zero is None and len(stations) > 1:
            self.find(number, stations[0], "no SubDevice of its part has delay 0")
        if zero is None and len(stations) == 1:
            return
        # The nearest of all measurements counts.
        results = [(self.compare(known, [zero or stations[0], *there], stations), known.within) for known in candidates]
        errors, within = min(results, key=lambda result: sum(abs(error) for _, error, _ in result[0]))
        self.checked["delays"] += len(stations)
        for station, error, text in errors:
            self.errors["delay"] = max(self.errors["delay"], abs(error))
            if abs(error) > max(self.within, within or 0):
                self.find(number, station, text)

    def compare(self, known, there, stations):
        """How far these stations' delays are off, each with what to say of it. Delays of a group count from the first
        of it that is `there`; its zero is where frames come in to it."""
        written = lambda station: self.subdevices[station].delay
        zeros = {}
        for station in there:
            if station in known.units and written(station) is not None:
                group, unit = known.units[station]
                zeros.setdefault(group, written(station) - unit)
        errors = []
        for station in stations:
            if station in known.units:
                group, unit = known.units[station]
                expected = zeros[group] + unit
                text = f"delay {written(station)} ns, {expected - written(there[0]):.1f} ns is what was measured"
                errors.append((station, written(station) - expected, text))
        for group, begin, inside, end in known.shares:
            at = zeros[group] + begin if group in zeros else None
            for other, span in (share for share in inside if share[0] in zeros):
                if at is not None and zeros[other] < at:
                    text = f"it begins {at - zeros[other]:.1f} ns before the branch processed earlier has ended"
                    errors.append((other, at - zeros[other], text))
                at = zeros[other] + span
            if group in zeros and at > zeros[group] + end:
                over = at - zeros[group] - end
                errors.append((inside[-1][0], over, f"it ends {over:.1f} ns after the frame was back"))
        return errors

    def offsets(self, number, part, stations):
        system = lambda s: self.local[s] + self.subdevices[s].offset - self.subdevices[s].delay
        known = [s for s in self.order() if self.subdevices[s].written_in == part and s in self.local]
        known = [s for s in known if None not in (self.subdevices[s].offset, self.subdevices[s].delay)]
        base = next((s for s in known if self.subdevices[s].delay == 0), None)
        for station in (s for s in stations if base is not None and s in known):
            error = signed(system(station) - system(base), 64)
            self.checked["offsets"] += 1
            self.errors["offset"] = max(self.errors["offset"], abs(error))
            if abs(error) > self.within:
                what = f"its offset makes it show {error} ns more than {base:#06x}, after its delay"
                self.find(number, station, what)
