"""What the scripts with the MainDevice of another project (SOEM, through pysoem) have in common."""

import sys
import time

import pysoem

OP_LIMIT = 20.0


def find(interfaces, count):
    """A MainDevice on one or two interfaces that has found so many SubDevices."""
    main_device = pysoem.Master()
    main_device.open(*interfaces.split(","))
    found = main_device.config_init()
    if found != count:
        sys.exit(f"expected {count} SubDevices, found {found}")
    return main_device


def to_op(main_device, patience_us):
    """Brings all to OP."""
    main_device.config_map()
    if main_device.state_check(pysoem.SAFEOP_STATE, 5_000_000) != pysoem.SAFEOP_STATE:
        sys.exit("not all SubDevices are in SAFEOP")
    exchange(main_device, patience_us)
    main_device.state = pysoem.OP_STATE
    main_device.write_state()
    until = time.monotonic() + OP_LIMIT
    while main_device.state_check(pysoem.OP_STATE, 2_000) != pysoem.OP_STATE:
        exchange(main_device, patience_us)
        if time.monotonic() > until:
            sys.exit("not all SubDevices are in OP")


def exchange(main_device, patience_us):
    """One cycle; its working counter."""
    main_device.send_processdata()
    return main_device.receive_processdata(patience_us)


def end(main_device):
    """Leaves all in INIT."""
    main_device.state = pysoem.INIT_STATE
    main_device.write_state()
    main_device.close()
