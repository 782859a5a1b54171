"""What a job's process gives up beside files and system calls: capabilities, new privileges, the network."""

import ctypes
import os

_PR_SET_NO_NEW_PRIVS = 38
_CAPSET = {"x86_64": 126, "aarch64": 91}
_CAPABILITY_VERSION_3 = 0x20080522
_CLONE_NEWNET = 0x40000000


def give_up_new_privileges() -> None:
    """Set `no_new_privs`: no program that this process starts gets more rights than it has."""
    if _libc().prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "no_new_privs is refused")


def drop_capabilities() -> None:
    """Give up the rights of root, which only a service has that runs as root. Call after
    `give_up_new_privileges`.
    """
    number = _CAPSET.get(os.uname().machine)
    if number is None:
        return
    header = (ctypes.c_uint32 * 2)(_CAPABILITY_VERSION_3, 0)
    none = (ctypes.c_uint32 * 6)()
    if _libc().syscall(number, header, none) != 0:
        raise OSError(ctypes.get_errno(), "the capabilities cannot be dropped")


def leave_network() -> bool:
    """Enter a network namespace without any interface; False where that is not allowed.

    For the zygote: its children inherit it. A user namespace would allow it to any user, but it also gives
    code of an attacker more of the kernel to attack.
    """
    return bool(_libc().unshare(_CLONE_NEWNET) == 0)


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)
