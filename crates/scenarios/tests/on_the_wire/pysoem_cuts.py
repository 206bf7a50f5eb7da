"""The MainDevice of another project (SOEM, through pysoem) on a ring whose cables are cut, to be compared with ours.

pysoem_cuts.py MAIN,REDUNDANT SUBDEVICES SECONDS: brings everything to OP, prints a line, exchanges process data every
millisecond for so long, and prints how many cycles there were, in how many the working counter was not the expected one,
how many began late, and how many SubDevices are in OP in the end.
"""

import sys
import time

import pysoem

CYCLE = 0.001


def main():
    interfaces, count, seconds = sys.argv[1].split(","), int(sys.argv[2]), float(sys.argv[3])
    main_device = pysoem.Master()
    main_device.open(*interfaces)
    found = main_device.config_init()
    if found != count:
        sys.exit(f"expected {count} SubDevices, found {found}")
    main_device.config_map()
    if main_device.state_check(pysoem.SAFEOP_STATE, 5_000_000) != pysoem.SAFEOP_STATE:
        sys.exit("not all SubDevices are in SAFEOP")
    exchange(main_device)
    main_device.state = pysoem.OP_STATE
    main_device.write_state()
    begin = time.monotonic()
    while main_device.state_check(pysoem.OP_STATE, 2_000) != pysoem.OP_STATE:
        exchange(main_device)
        if time.monotonic() - begin > 20:
            sys.exit("not all SubDevices are in OP")
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
        wrong += exchange(main_device) != main_device.expected_wkc
    main_device.read_state()
    in_op = sum(subdevice.state == pysoem.OP_STATE for subdevice in main_device.slaves)
    print(f"cycles {cycles} wrong {wrong} late {late} op {in_op}", flush=True)
    main_device.state = pysoem.INIT_STATE
    main_device.write_state()
    main_device.close()


def exchange(main_device):
    main_device.send_processdata()
    return main_device.receive_processdata(900)


main()
