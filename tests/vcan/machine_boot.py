"""The first process of the machine: mounts, modules, a bus, the command, and the lights out.

Runs on nothing but Python's standard library, as process 1 of a kernel that has just started.
"""

import ctypes
import json
import os
import platform
import socket
import struct
import subprocess
import sys
from pathlib import Path

MODULES = (
    "net/can/can",
    "net/can/can-raw",
    "net/can/can-bcm",
    "drivers/net/can/dev/can-dev",
    "drivers/net/can/vcan",
    "fs/overlayfs/overlay",
)
LAYERS = "/run"
LIBC = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else ctypes.pythonapi
FINIT_MODULE = {"x86_64": 313, "aarch64": 273}.get(platform.machine(), 0)
POWER_OFF = 0x4321FEDC

RTM_NEWLINK, NLM_F_REQUEST, NLM_F_ACK, NLM_F_CREATE = 16, 1, 4, 0x400
IFLA_IFNAME, IFLA_LINKINFO, IFLA_INFO_KIND, IFF_UP = 3, 18, 1, 1


def succeed(code, what):
    if code != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")


def mount(kind, where, source="none", data=""):
    Path(where).mkdir(parents=True, exist_ok=True)
    strings = [text.encode() for text in (source, where, kind)]
    succeed(LIBC.mount(*strings, 0, data.encode()), f"mount {kind} on {where}")


def load(module):
    with Path(module).open("rb") as file:
        succeed(LIBC.syscall(FINIT_MODULE, file.fileno(), b"", 0), module)


def attribute(kind, content):
    size = 4 + len(content)
    return struct.pack("=HH", size, kind) + content + bytes(-size % 4)


def ask(flags, index, up, changes, attributes=b""):
    """One RTM_NEWLINK request, and the kernel's answer to it."""
    flags |= NLM_F_REQUEST | NLM_F_ACK
    body = struct.pack("=BxHiII", 0, 0, index, IFF_UP if up else 0, IFF_UP if changes else 0)
    body += attributes
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as link:
        link.send(struct.pack("=IHHII", 16 + len(body), RTM_NEWLINK, flags, 1, 0) + body)
        (error,) = struct.unpack_from("=i", link.recv(4096), 16)
    if error:
        raise OSError(-error, os.strerror(-error))


def switch(name, up):
    """Interface up or down."""
    ask(0, socket.if_nametoindex(name), up, True)


def bus(name):
    """A CAN bus that exists within the kernel only, up."""
    kind = attribute(IFLA_LINKINFO, attribute(IFLA_INFO_KIND, b"vcan"))
    ask(NLM_F_CREATE, 0, False, False, attribute(IFLA_IFNAME, name.encode() + b"\0") + kind)
    switch(name, True)


def settle(order):
    """Files of the host below, a layer in memory above, and the usual kernel folders."""
    mount("proc", "/proc")
    mount("tmpfs", LAYERS)
    for module in MODULES:
        load(f"{order['modules']}/{module}.ko")
    top, work, root = (f"{LAYERS}/{name}" for name in ("top", "work", "root"))
    Path(top).mkdir()
    Path(work).mkdir()
    mount("overlay", root, data=f"lowerdir=/,upperdir={top},workdir={work}")
    for kind, where in (
        ("proc", "proc"),
        ("sysfs", "sys"),
        ("devtmpfs", "dev"),
        ("devpts", "dev/pts"),
        ("tmpfs", "dev/shm"),
        ("tmpfs", "run"),
    ):
        mount(kind, f"{root}/{where}")
    for folder in order["writable"]:
        mount("hostfs", root + folder, data=folder)
    os.chroot(root)
    os.chdir(order["folder"])
    switch("lo", True)
    bus("vcan0")


def main():
    order = json.loads(Path(sys.argv[1]).read_text())
    code = 125
    try:
        settle(order)
        done = subprocess.run(order["command"], env=order["environment"], stdin=subprocess.DEVNULL)
        code = done.returncode if done.returncode >= 0 else 128 - done.returncode
    except BaseException as problem:  # whatever it is: a kernel whose first process dies panics
        print(f"the machine did not come up: {problem!r}", flush=True)
    finally:
        try:
            Path(order["answer"]).write_text(str(code))
        except OSError as problem:
            print(f"no answer: {problem}", flush=True)
        sys.stdout.flush()
        os.sync()
        LIBC.reboot(POWER_OFF)


if __name__ == "__main__":
    main()
