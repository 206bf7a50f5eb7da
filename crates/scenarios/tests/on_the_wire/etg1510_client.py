"""The ETG.1510 client of others (pyetg1510 0.1.3) reads the whole object dictionary of a MainDevice through its
gateway.

Usage: etg1510_client.py ADDRESS. Prints each object with the fields that the client knows.
"""
import asyncio, importlib.abc, importlib.util, sys
from dataclasses import fields

# Two of its headers are structures whose bit fields have types of several sizes. Where it was made (Windows) each type
# has bytes of its own; here these fields overlap, and the type of the frame is lost. With one type they are as meant.
NAME = "pyetg1510.mailbox.mailbox_gateway"
HEADERS = ("class EtherCATHeader(Structure):", "class CoEHeader(Structure):")


class Loader(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name != NAME:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        source = spec.loader.get_source(name)
        for header in HEADERS:
            before, behind = source.split(header)
            body, rest = behind.split("]\n", 1)
            source = before + header + body.replace("c_uint8", "c_uint16") + "]\n" + rest
        code = compile(source, spec.origin, "exec")
        spec.loader.get_code = lambda _: code
        return spec


sys.meta_path.insert(0, Loader())
from pyetg1510 import ETG1510Profile, EtherCATMasterConnection, LoggingLevel, MasterODSpecification, SysLog

SysLog.console_log_configuration(LoggingLevel.DISABLE)
SysLog.syslog_configuration(LoggingLevel.DISABLE)


async def show(profile):
    async for index, data in profile:
        print(f"{index:#06x}", {field.name: getattr(data, field.name).value for field in fields(data)}, flush=True)


profile = ETG1510Profile(master_od=MasterODSpecification(connection=EtherCATMasterConnection(sys.argv[1], 34980)))
asyncio.run(profile.master_od.get_object_dictionary())
asyncio.run(show(profile))
