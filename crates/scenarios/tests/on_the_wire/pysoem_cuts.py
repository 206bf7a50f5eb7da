"""The MainDevice of another project (SOEM, through pysoem) on a ring whose cables are cut, to be compared with ours.

pysoem_cuts.py MAIN,REDUNDANT SUBDEVICES SECONDS: brings everything to OP, prints a line, exchanges process data every
millisecond for so long, and prints how many cycles there were, in how many the working counter was not the expected
one, how many began late, and how many SubDevices are in OP in the end.
"""

import sys
import time

import pysoem

from pysoem_bus import end, exchange, find, to_op

CYCLE = 0.001
PATIENCE_US = 900


def main():
    interfaces, count, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    main_device = find(interfaces, count)
    to_op(main_device, PATIENCE_US)
    print("in OP", flush=True)
    cycles, wrong, late = 0, 0, 0
    begin = time.monotonic()
    due = begin
    while due < begin + seconds:
        due += CYCLE
        rest = due - time.monotonic()
        if rest > 0:
            time.sleep(rest)
        late += rest < -CYCLE
        cycles += 1
        wrong += exchange(main_device, PATIENCE_US) != main_device.expected_wkc
    main_device.read_state()
    in_op = sum(subdevice.state == pysoem.OP_STATE for subdevice in main_device.slaves)
    print(f"cycles {cycles} wrong {wrong} late {late} op {in_op}", flush=True)
    end(main_device)


main()
