"""seccomp: a list of the system calls that a job needs; the kernel refuses all others with EPERM.

libseccomp compiles the list to a program once, in the zygote; the child only installs it. The program is
patched with the pid of the child, so that it can send signals to itself and to nobody else.
"""

import ctypes
import errno
import os
import struct
import tempfile

_ALLOW, _ERRNO = 0x7FFF0000, 0x00050000
_EQUAL, _MASKED_EQUAL = 4, 7  # scmp_compare
_OPTIMIZE, _BINARY_TREE = 8, 2  # an attribute of the filter
_PR_SET_SECCOMP, _MODE_FILTER = 22, 2
_PID_PLACEHOLDER = 0x0BADC0DE  # larger than any pid (at most 2^22)
_INSTRUCTION = struct.Struct("=HBBI")  # sock_filter: code, jt, jf, k

_CLONE_VM, _CLONE_FILES, _CLONE_PTRACE, _CLONE_VFORK = 0x100, 0x400, 0x2000, 0x4000
_CLONE_PARENT, _CLONE_THREAD = 0x8000, 0x00010000
_CLONE_NAMESPACES = 0x7E020000  # CLONE_NEW*: cgroup, IPC, mount, network, PID, user, UTS
_CLOSE_RANGE_UNSHARE = 2
_IOCTLS = (0x5401, 0x5413, 0x541B, 0x5421, 0x5450, 0x5451)  # is it a terminal, its size; FIO*
#: Copies of descriptors, their flags, locks and sizes of pipes: nothing that has the kernel send signals.
_FCNTLS = (0, 1, 2, 3, 4, 5, 6, 7, 36, 37, 38, 1030, 1031, 1032)
_PRCTLS = (15, 16, 0x53564D41)  # names of threads and of memory

_FILES = """
    read readv pread64 preadv preadv2 write writev pwrite64 pwritev pwritev2 open openat openat2 creat
    close lseek stat lstat fstat newfstatat statx statfs fstatfs access faccessat faccessat2 readlink
    readlinkat getdents getdents64 getcwd chdir fchdir rename renameat renameat2 mkdir mkdirat rmdir
    unlink unlinkat link linkat symlink symlinkat mknod mknodat truncate ftruncate fallocate fsync
    fdatasync sync_file_range fadvise64 readahead copy_file_range sendfile fchmod umask dup dup2 dup3
    flock pipe pipe2 select pselect6 poll ppoll epoll_create epoll_create1 epoll_ctl epoll_wait
    epoll_pwait epoll_pwait2 eventfd eventfd2
"""
#: Landlock does not govern the modes and times of files: these calls would reach every file of this user.
#: Modes are not set, and are said to be, because a library that copies a file sets them last. Times are
#: refused.
_PRETENDED = "chmod fchmodat fchmodat2"
_MEMORY = (
    "brk mmap munmap mprotect mremap madvise msync mincore membarrier get_mempolicy pkey_alloc pkey_free"
)
_THREADS = """
    futex futex_waitv set_robust_list get_robust_list set_tid_address rseq sched_yield sched_getaffinity
    sched_getparam sched_getscheduler sched_get_priority_max sched_get_priority_min gettid exit exit_group
    restart_syscall arch_prctl getcpu
"""
_SIGNALS = """
    rt_sigaction rt_sigprocmask rt_sigreturn rt_sigpending rt_sigsuspend rt_sigtimedwait sigaltstack pause
    alarm setitimer getitimer
"""
_FACTS = """
    getpid getppid getpgrp getpgid getsid getuid geteuid getgid getegid getresuid getresgid getgroups
    getpriority getrusage getrlimit times time gettimeofday clock_gettime clock_getres clock_nanosleep
    nanosleep sysinfo uname getrandom wait4 waitid
"""
#: Of jobs that need a second process; `clone` beside them. No `setsid`: the group of the job holds them all.
_PROCESSES = "fork vfork execve"


class _Comparison(ctypes.Structure):
    _fields_ = (
        ("argument", ctypes.c_uint),
        ("operator", ctypes.c_int),
        ("a", ctypes.c_uint64),
        ("b", ctypes.c_uint64),
    )


def compiled(*, with_processes: bool) -> bytes | None:
    """The program (an array of `sock_filter`); None where there is no libseccomp.

    with_processes : the job may start other processes, in no namespace of their own
    """
    try:
        library = ctypes.CDLL("libseccomp.so.2", use_errno=True)
    except OSError:
        return None
    library.seccomp_init.restype = ctypes.c_void_p
    library.seccomp_init.argtypes = [ctypes.c_uint32]
    library.seccomp_release.argtypes = library.seccomp_reset.argtypes = [ctypes.c_void_p]
    library.seccomp_attr_set.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint32]
    library.seccomp_export_bpf.argtypes = [ctypes.c_void_p, ctypes.c_int]
    library.seccomp_rule_add_array.argtypes = [
        ctypes.c_void_p,
        ctypes.c_uint32,
        ctypes.c_int,
        ctypes.c_uint,
        ctypes.c_void_p,
    ]
    context = library.seccomp_init(_ERRNO | errno.EPERM)
    try:
        library.seccomp_attr_set(context, _OPTIMIZE, _BINARY_TREE)  # not known to old versions: no matter
        _add_rules(_Rules(library, context), with_processes)
        with tempfile.TemporaryFile() as file:
            if library.seccomp_export_bpf(context, file.fileno()) < 0:
                return None
            file.seek(0)
            return file.read()
    finally:
        library.seccomp_release(context)


class _Rules:
    def __init__(self, library: ctypes.CDLL, context: int) -> None:
        self._library, self._context = library, context

    def add(self, name: str, *comparisons: _Comparison, action: int = _ALLOW) -> None:
        number = self._library.seccomp_syscall_resolve_name(name.encode())
        if number < 0:  # not of this architecture, or newer than the library
            return
        given = (_Comparison * len(comparisons))(*comparisons)
        pointer = ctypes.cast(given, ctypes.c_void_p) if comparisons else None
        failed = self._library.seccomp_rule_add_array(
            self._context, action, number, len(comparisons), pointer
        )
        if failed:
            raise OSError(-failed, f"the system call filter has no rule for {name}")


def _add_rules(rules: _Rules, with_processes: bool) -> None:
    for names in (_FILES, _MEMORY, _THREADS, _SIGNALS, _FACTS, *([_PROCESSES] if with_processes else [])):
        for name in names.split():
            rules.add(name)
    for name in _PRETENDED.split():
        rules.add(name, action=_ERRNO | 0)
    # glibc falls back to `clone`, whose flags can be seen. A thread has the open files of its process: others
    # would not be seen.
    rules.add("clone3", action=_ERRNO | errno.ENOSYS)
    thread = _CLONE_THREAD | _CLONE_FILES
    rules.add("clone", _Comparison(0, _MASKED_EQUAL, thread | _CLONE_NAMESPACES, thread))
    rules.add("close_range", _Comparison(2, _MASKED_EQUAL, _CLOSE_RANGE_UNSHARE, 0))
    if with_processes:
        other = _CLONE_THREAD | _CLONE_NAMESPACES | _CLONE_PARENT | _CLONE_PTRACE | _CLONE_VM
        rules.add("clone", _Comparison(0, _MASKED_EQUAL, other, 0))
        vfork = _CLONE_VM | _CLONE_VFORK
        rules.add("clone", _Comparison(0, _MASKED_EQUAL, other | _CLONE_VFORK, vfork))
    for request in _IOCTLS:
        rules.add("ioctl", _Comparison(1, _EQUAL, request))
    for command in _FCNTLS:
        rules.add("fcntl", _Comparison(1, _EQUAL, command))
    for option in _PRCTLS:
        rules.add("prctl", _Comparison(0, _EQUAL, option))
    for pid in (0, _PID_PLACEHOLDER):  # 0: itself; of `kill`, its own group
        rules.add("prlimit64", _Comparison(0, _EQUAL, pid))
        rules.add("kill", _Comparison(0, _EQUAL, pid))
    rules.add("tgkill", _Comparison(0, _EQUAL, _PID_PLACEHOLDER))


def install(program: bytes) -> None:
    """Install the program in this process, which has one thread, for good. `no_new_privs` must be set."""
    pid = os.getpid()
    instructions = [
        (code, jt, jf, pid if k == _PID_PLACEHOLDER else k)
        for code, jt, jf, k in _INSTRUCTION.iter_unpack(program)
    ]
    patched = b"".join(_INSTRUCTION.pack(*each) for each in instructions)
    buffer = ctypes.create_string_buffer(patched, len(patched))

    class Program(ctypes.Structure):  # sock_fprog
        _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_void_p))

    header = Program(len(instructions), ctypes.cast(buffer, ctypes.c_void_p))
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_SECCOMP, _MODE_FILTER, ctypes.byref(header), 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "the system call filter is refused")
