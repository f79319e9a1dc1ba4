"""One strip-packing run in a process of its own: JSON on stdin, JSON on stdout.

Run as a file by ``phexfab.fabrication.strip``; it imports nothing of phexfab. A process can be
stopped the moment a layout fits, which the packer's own interface does not offer, and keeps a
panic in the packer, and its message, away from the caller.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from typing import Any


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Pack until the strip is no longer than the target, or the packer gets stuck.

    The packer reports the same layouts in the same order for the same seed and one worker; what
    is counted here are its reports, never seconds, so the answer does not depend on the machine.
    """
    import spyrrow

    answer: dict[str, Any] = {"length": None, "spots": [], "reports": 0, "error": ""}
    try:
        items = [
            spyrrow.Item(str(k), [(x, y) for x, y in shape], 1, job["angles"])
            for k, shape in enumerate(job["shapes"])
        ]
        instance = spyrrow.StripPackingInstance("sheet", job["height"], items)
        config = spyrrow.StripPackingConfig(
            early_termination=True,
            total_computation_time=None,
            exploration_time=job["seconds"],
            compression_time=job["seconds"],
            num_workers=1,
            seed=job["seed"],
        )
    except (ValueError, TypeError, OverflowError) as error:
        answer["error"] = str(error)
        return answer

    queue = spyrrow.ProgressQueue()
    thread = threading.Thread(target=_solve, args=(instance, config, queue, answer), daemon=True)
    thread.start()
    while True:
        # Asked before draining, so that nothing reported before the end is missed.
        running = thread.is_alive()
        for kind, layout in queue.drain():
            answer["reports"] += 1
            if kind == spyrrow.ReportType.ExplInfeas or answer["reports"] > job["patience"]:
                return answer
            if kind != spyrrow.ReportType.ExplImproving:
                if answer["length"] is None or layout.width < answer["length"]:
                    answer["length"] = layout.width
                    answer["spots"] = [
                        (int(item.id), item.rotation, *item.translation)
                        for item in layout.placed_items
                    ]
                if layout.width <= job["target"]:
                    return answer
        if not running:
            return answer
        time.sleep(0.002)


def _solve(instance: Any, config: Any, queue: Any, answer: dict[str, Any]) -> None:
    try:
        instance.solve(config, queue)
    except BaseException as error:
        # A Rust panic is a BaseException that cannot be imported; nothing else is swallowed.
        if type(error).__name__ != "PanicException":
            raise
        answer["error"] = f"the packer panicked: {error}"


if __name__ == "__main__":
    result = run(json.load(sys.stdin))
    json.dump(result, sys.stdout)
    sys.stdout.flush()
    os._exit(0)  # the packer's thread may still be running and cannot be asked to stop
