"""Confines the process of a job, so that code of an attacker in it reaches nothing but its own folder.

`landlock` limits files, connections and signals, `syscall_filter` the calls to the kernel, `limits` the
resources. `measures` tells which of them this machine has.
"""
