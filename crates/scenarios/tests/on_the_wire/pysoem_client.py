"""The MainDevice of another project (SOEM, through pysoem) on a network interface, as a check of our simulator.

pysoem_client.py INTERFACE[,REDUNDANT] SUBDEVICES CYCLES: brings everything to OP and exchanges process data. In cycle
i byte j of the outputs of SubDevice k is i + k + j. As many cycles follow without any work but sending and receiving,
to tell how many there are in a second, and how much processor time each takes. Prints one line of figures, then keeps
exchanging the last outputs until its standard input ends.
"""

import select
import sys
import time

from pysoem_bus import end, exchange, find, to_op

PATIENCE_US = 100_000


def main():
    interfaces, count, cycles = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    begin = time.monotonic()
    main_device = find(interfaces, count)
    to_op(main_device, PATIENCE_US)
    op_ms = (time.monotonic() - begin) * 1e3
    wrong = 0
    times = []
    for cycle in range(cycles):
        for position, subdevice in enumerate(main_device.slaves):
            if subdevice.output:
                subdevice.output = bytes((cycle + position + at) & 0xFF for at in range(len(subdevice.output)))
        sent = time.monotonic()
        wrong += exchange(main_device, PATIENCE_US) != main_device.expected_wkc
        times.append(time.monotonic() - sent)
    cpu = time.process_time()
    begins = [time.monotonic()]
    for cycle in range(cycles):
        exchange(main_device, PATIENCE_US)
        begins.append(time.monotonic())
    cpu_us = (time.process_time() - cpu) * 1e6 / cycles
    per_second = cycles / (begins[-1] - begins[0])
    cycle_us = sorted(after - before for before, after in zip(begins, begins[1:]))[cycles // 2] * 1e6
    times.sort()
    inputs = ",".join(bytes(subdevice.input).hex() for subdevice in main_device.slaves)
    median = times[cycles // 2] * 1e6
    print(
        f"op_ms {op_ms:.0f} median_us {median:.1f} per_second {per_second:.0f} cycle_us {cycle_us:.2f} "
        f"cpu_us {cpu_us:.2f} wkc {main_device.expected_wkc} "
        f"wrong {wrong} inputs {inputs}",
        flush=True,
    )
    while not select.select([sys.stdin], [], [], 0.001)[0]:
        exchange(main_device, PATIENCE_US)
    end(main_device)


main()
