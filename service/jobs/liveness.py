"""How a process shows that it lives, and when the others take it for dead. All intervals follow from these
three.
"""

WORKER_HEARTBEAT_S = 1.0  # between two heartbeats of a worker process
JOB_HEARTBEAT_S = 0.5  # between two heartbeats of a running job: a dismissed job is stopped within 3 s
#: Silence after which a worker, and each job that it runs, counts as lost. Clocks of machines may differ by
#: seconds.
DEAD_AFTER_MS = 15_000
