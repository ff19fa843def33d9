"""Run a command; print its seconds, peak memory [MB] and CPU seconds as the last line of stdout.

A process of its own, small and without other imports: a child's peak counts what its parent held
when it forked.
"""

import os
import sys
import time


def main() -> None:
    began = time.perf_counter()
    child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
    _, status, usage = os.wait4(child, 0)
    seconds = time.perf_counter() - began
    unit = 1.0 if sys.platform == "darwin" else 1024.0
    cpu = usage.ru_utime + usage.ru_stime
    print(f"\n{seconds} {usage.ru_maxrss * unit / 1e6} {cpu}")
    sys.exit(os.waitstatus_to_exitcode(status))


if __name__ == "__main__":
    main()
