"""Stands for a child process of a trial that crashes."""

import os
import signal

from rsibr.scene.trial import BEGUN

if __name__ == "__main__":
    print(BEGUN, flush=True)  # noqa: T201
    os.kill(os.getpid(), signal.SIGSEGV)
