"""SubDevices of a part of a segment, their cables from DL status and latched times, and the delays that follow."""
import collections

from capture import MOST_STEPS, ORDER, REMEMBERED_NS


class SubDevice:
    """What is known of one station address."""

    def __init__(self):
        self.position = self.dl_status = self.delay = self.offset = None
        self.part = 0
        # Its part when its delay or offset was written.
        self.written_in = 0
        self.closed = {}
        self.filters_due = None

    def ports(self):
        """Open ports, as DL status and DL control have it."""
        loop_closed = [self.dl_status >> (8 + 2 * port) & 1 for port in range(4)]
        return [port for port in range(4) if not loop_closed[port] and not self.closed.get(port)]


class Part:
    """SubDevices that frames of one link meet, as a tree: way of a frame through their ports."""

    def __init__(self, stations, ports, redundant, entries, times):
        """`entries`: the port at which the frame comes in first, of those whose receive times say it. `times` by
        station and port."""
        self.ports, self.stations, self.entries, self.times = ports, stations, entries, times
        self.cables, self.entry = {}, (stations[0], 0)
        if redundant:
            self.is_even = self.from_behind()
        else:
            # Each cable has two ends; one more leads to the interface. Frames that leave elsewhere do not come back.
            self.is_even = sum(len(ports[station]) for station in stations) == 2 * len(stations) - 1
            self.is_even = self.is_even and (self.plug((0,)) or self.plug((0, 3, 1, 2)))

    def from_behind(self):
        """What is left of a ring on the other link: port 0 of each SubDevice is towards lower positions."""
        first, *others = self.stations
        free = [(first, port) for port in ORDER[:0:-1] if port in self.ports[first]]
        for station in others:
            if not free or 0 not in self.ports[station]:
                return False
            end = free.pop()
            self.cables[end], self.cables[(station, 0)] = (station, 0), end
            free += [(station, port) for port in ORDER[:0:-1] if port in self.ports[station]]
        # What is left over leads to the link.
        self.entry = free[-1] if free else self.entry
        return len(free) == 1 and 0 not in self.ports[first]

    def plug(self, guesses):
        """Finds cables with which SubDevices process the frame in the order of their positions, and on which it takes a
        time. Where the port of entry is not known, it is one of `guesses`."""
        self.steps = 0
        for root, end, cables in self.branch(0, len(self.stations), guesses):
            if end == len(self.stations):
                self.entry, self.cables = root, {}
                for near, far in cables:
                    self.cables[near], self.cables[far] = far, near
                if all(link >= 0 for link in self.units().links.values()):
                    return True
        return False

    def branch(self, begin, limit, guesses):
        """Each way in which the SubDevices from the place `begin` on, at most up to `limit`, make a branch: where it is
        entered, the place behind it, its cables."""
        for place in range(begin, limit):
            station = self.stations[place]
            for entry in self.entries.get(station, guesses):
                self.steps += 1
                if self.steps > MOST_STEPS or entry not in self.ports[station]:
                    continue
                # A SubDevice that is entered from behind sends the frame on before it processes it.
                before, after = self.around(station, entry)
                if place != begin and not before:
                    continue
                for middle, cables in self.children(station, before, begin, place, guesses):
                    if middle == place:
                        for end, more in self.children(station, after, place + 1, limit, guesses):
                            yield (station, entry), end, cables + more

    def children(self, station, ports, begin, limit, guesses):
        """Branches on these ports, one behind the other."""
        if not ports:
            yield begin, []
            return
        for root, middle, cables in self.branch(begin, limit, guesses):
            for end, more in self.children(station, ports[1:], middle, limit, guesses):
                yield end, [((station, ports[0]), root), *cables, *more]

    def around(self, station, entry):
        """Ports that the frame passes before the processing unit, and after it."""
        visits = self.visits(station, entry)
        if entry == 0:
            return [], visits
        is_before = lambda port: port == 0 or ORDER.index(port) > ORDER.index(entry)
        return [port for port in visits if is_before(port)], [port for port in visits if not is_before(port)]

    def visits(self, station, entry):
        """Open ports in the order in which a frame comes back to them."""
        at = ORDER.index(entry)
        return [port for port in (ORDER[(at + step) % 4] for step in (1, 2, 3)) if port in self.ports[station]]

    def roots(self, end):
        """The first SubDevices with a clock at the other end of a cable, with their ports; those without are cable. And
        whether these share what the way takes, as they do behind a fork without a clock."""
        far = self.cables.get(end)
        if far is None or far[0] in self.times:
            return [far] if far else [], False
        return self.behind(far)

    def behind(self, entry):
        """The same behind a SubDevice without a clock that is entered there."""
        onwards = self.visits(*entry)
        found = [self.roots((entry[0], onward)) for onward in onwards]
        return [root for roots, _ in found for root in roots], len(onwards) > 1 or any(shared for _, shared in found)

    def units(self):
        """Delays to processing units."""
        known, times = Units(), self.times
        first = [self.entry] if self.entry[0] in times else self.behind(self.entry)[0]
        span = lambda root: max(
            [times[root[0]][port] - times[root[0]][root[1]] for port in self.visits(*root)], default=0
        )
        waiting = [(*root, root[0], 0.0) for root in first]
        if len(first) > 1:
            known.shares.append((None, 0, [(root[0], span(root)) for root in first], 0))
        while waiting:
            station, entry, group, delay = waiting.pop()
            own = times[station]
            since = {port: own[port] - own[entry] for port in range(4)}
            unit, before = (delay, entry) if entry == 0 else (None, entry)
            for port in self.visits(station, entry):
                # Port 0 is passed on the way to this one, and where it is closed the frame is turned round there.
                if unit is None and ORDER.index(port) < ORDER.index(before) and port != 0:
                    unit = delay + since[before]
                roots, shared = self.roots((station, port))
                if len(roots) == 1 and not shared:
                    link = (since[port] - since[before] - span(roots[0])) / 2
                    known.links[frozenset([(station, port), roots[0]])] = link
                    waiting.append((*roots[0], group, delay + since[before] + link))
                elif roots:
                    inside = [(root[0], span(root)) for root in roots]
                    known.shares.append((group, delay + since[before], inside, delay + since[port]))
                    waiting += [(*root, root[0], 0.0) for root in roots]
                before = port
                if port == 0:
                    unit = delay + since[0]
            known.units[station] = (group, delay + since[before] if unit is None else unit)
        return known


class Units:
    """What was measured at once."""

    def __init__(self, within=None):
        # By station: of which group, and nanoseconds from where the frame comes in to the first of that group.
        self.units = {}
        # Forks without a clock: group and time upstream, each group downstream with its span, time downstream.
        self.shares = []
        # Time from SubDevice to SubDevice, by both ends.
        self.links = {}
        # How exact it is, where it is not as exact as all else.
        self.within = within


class Ring:
    """SubDevices with a ring behind a junction that is whole: a SubDevice in it processes the frame once. What was
    measured of its cables counts; a single unknown cable takes the rest of the time of the ring."""

    def __init__(self, stations, ports, entry, cables):
        self.ports, self.entry = ports, entry
        ends = {(station, port) for station in stations for port in ports[station]} - {entry}
        self.cables = {near: far for near, far in cables.items() if near in ends and far in ends}
        free = sorted(ends - set(self.cables))
        if len(free) == 2:
            self.cables.update(zip(free, reversed(free)))
        self.is_even = len(free) in (0, 2)

    def way(self):
        """Where the frame comes in, in order, and whether the processing unit meets it then."""
        arrivals, at = [], self.entry
        while at is not None and len(arrivals) <= 2 * len(self.cables) + 1:
            station, port = at
            place, met = ORDER.index(port), port == 0
            for step in range(1, 5):
                out = ORDER[(place + step) % 4]
                if out in self.ports[station]:
                    break
                met |= out == 0
            arrivals.append((station, port, met))
            at = self.cables.get((station, out))
        return arrivals

    def units(self, times, links):
        """Delays, or nothing where more than one cable of the ring is not known or a SubDevice has no clock."""
        known, way = Units(REMEMBERED_NS), self.way()
        if any(station not in times for station, _, _ in way):
            return None
        places = collections.defaultdict(list)
        for place, (station, _, _) in enumerate(way):
            places[station].append(place)
        time = lambda place: times[way[place][0]][way[place][1]]
        since = lambda place: time(place) - time(places[way[place][0]][0])
        entered = {way[0][0]: 0.0}
        cable = lambda place: frozenset([way[place][:2], self.cables[way[place][:2]]])
        for place, (station, _, met) in enumerate(way):
            if station not in entered:
                return None
            here = entered[station] + since(place)
            if met:
                known.units.setdefault(station, (self.entry[0], here))
            later = [other for other in places[station] if other > place]
            if not later:
                continue
            # What lies in between, one behind the other: where each begins, and how long it takes.
            inside, at = [], place + 1
            while at < later[0]:
                last = max(other for other in places[way[at][0]] if other < later[0])
                inside.append((at, time(last) - time(at)))
                at = last + 1
            hops = [cable(at) for at, _ in inside] + [cable(later[0])]
            left = time(later[0]) - time(place) - sum(span for _, span in inside)
            if len(hops) == 2 and hops[0] == hops[1]:
                known.links[hops[0]] = left / 2
            missing = {hop for hop in hops if hop not in known.links and hop not in links}
            if len(missing) > 1:
                return None
            takes = lambda hop: known.links.get(hop, links.get(hop, 0.0))
            known.links.update({hop: left - sum(takes(hop) for hop in hops) for hop in missing})
            for (at, span), hop in zip(inside, hops):
                here += takes(hop)
                entered.setdefault(way[at][0], here)
                here += span
        return known
