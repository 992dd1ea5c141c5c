# SPDX-License-Identifier: GPL-3.0-or-later
"""Kill Blender, the bridge and the process at the devices, again and again:

python -m tests.device.kill [TIMES]
"""

from __future__ import annotations

import os
import statistics
import sys
import warnings

from tests.device.bridges import kill_blender, kill_bridge_and_start_again, kill_hands


def measure(count: int) -> dict[str, tuple[float, float]]:
    """Seconds, median and worst, of each way; fails where something is lost or left."""
    warnings.simplefilter("ignore", ResourceWarning)
    blender, noticed, ended, back = [], [], [], []
    for _ in range(count):
        blender.append(kill_blender())
        first, second = kill_bridge_and_start_again()
        noticed.append(first)
        ended.append(second)
        back.append(kill_hands())
    rows = {
        "Blender killed: all ended after": blender,
        "bridge killed: said after": noticed,
        "bridge killed: devices let go after": ended,
        "devices' process killed: back after": back,
    }
    return {name: (statistics.median(values), max(values)) for name, values in rows.items()}


def main() -> None:
    """Run the command line."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(f"{count} times each, on {os.cpu_count()} processors; seconds: median, worst")
    for name, (median, worst) in measure(count).items():
        print(f"{name:<38}{median:>8.3f}{worst:>8.3f}")


if __name__ == "__main__":
    main()
