# SPDX-License-Identifier: GPL-3.0-or-later
"""Kill Blender, the bridge and the process at the devices, again and again:

python -m tests.device.kill [TIMES]
"""

from __future__ import annotations

import os
import sys
import warnings

from tests.device.bridges import kill_blender, kill_bridge_and_start_again, kill_hands


def main() -> None:
    """Run the command line; fails on the first time that something is lost or left."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    warnings.simplefilter("ignore", ResourceWarning)
    blender, noticed, ended, back = [], [], [], []
    for turn in range(count):
        blender.append(kill_blender())
        first, second = kill_bridge_and_start_again()
        noticed.append(first)
        ended.append(second)
        back.append(kill_hands())
        if (turn + 1) % 10 == 0:
            print(f"{turn + 1} times", flush=True)
    rows = {
        "Blender killed: all ended after": blender,
        "bridge killed: said after": noticed,
        "bridge killed: devices let go after": ended,
        "devices' process killed: back after": back,
    }
    print(f"{count} times each, on {os.cpu_count()} processors; seconds: median, worst")
    for name, values in rows.items():
        values.sort()
        print(f"{name:<38}{values[len(values) // 2]:>8.3f}{values[-1]:>8.3f}")


if __name__ == "__main__":
    main()
