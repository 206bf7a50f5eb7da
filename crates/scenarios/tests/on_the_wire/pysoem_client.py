"""The MainDevice of another project (SOEM, through pysoem) on a network interface, as a check of our simulator.

pysoem_client.py INTERFACE[,REDUNDANT] SUBDEVICES CYCLES: brings everything to OP and exchanges process data. In cycle i
byte j of the outputs of SubDevice k is i + k + j. As many cycles follow without any work but sending and receiving, to
tell how many there are in a second. Prints one line of figures, then keeps exchanging the last outputs
until its standard input ends.
"""

import select
import sys
import time

import pysoem


def main():
    interfaces, count, cycles = sys.argv[1].split(","), int(sys.argv[2]), int(sys.argv[3])
    main_device = pysoem.Master()
    main_device.open(*interfaces)
    begin = time.monotonic()
    found = main_device.config_init()
    if found != count:
        sys.exit(f"expected {count} SubDevices, found {found}")
    main_device.config_map()
    if main_device.state_check(pysoem.SAFEOP_STATE, 5_000_000) != pysoem.SAFEOP_STATE:
        sys.exit("not all SubDevices are in SAFEOP")
    exchange(main_device)
    main_device.state = pysoem.OP_STATE
    main_device.write_state()
    while main_device.state_check(pysoem.OP_STATE, 2_000) != pysoem.OP_STATE:
        exchange(main_device)
        if time.monotonic() - begin > 20:
            sys.exit("not all SubDevices are in OP")
    to_op = time.monotonic() - begin
    wrong = 0
    times = []
    for cycle in range(cycles):
        for position, subdevice in enumerate(main_device.slaves):
            if subdevice.output:
                subdevice.output = bytes((cycle + position + at) & 0xFF for at in range(len(subdevice.output)))
        sent = time.monotonic()
        wrong += exchange(main_device) != main_device.expected_wkc
        times.append(time.monotonic() - sent)
    begin = time.monotonic()
    for cycle in range(cycles):
        exchange(main_device)
    per_second = cycles / (time.monotonic() - begin)
    times.sort()
    inputs = ",".join(bytes(subdevice.input).hex() for subdevice in main_device.slaves)
    median = times[cycles // 2] * 1e6
    print(
        f"op_ms {to_op * 1e3:.0f} median_us {median:.1f} per_second {per_second:.0f} wkc {main_device.expected_wkc} "
        f"wrong {wrong} inputs {inputs}",
        flush=True,
    )
    while not select.select([sys.stdin], [], [], 0.001)[0]:
        exchange(main_device)
    main_device.state = pysoem.INIT_STATE
    main_device.write_state()
    main_device.close()


def exchange(main_device):
    main_device.send_processdata()
    return main_device.receive_processdata(100_000)


main()
