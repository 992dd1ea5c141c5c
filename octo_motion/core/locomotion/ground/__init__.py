# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground, footholds, contact timing, stance and swing."""

from .arm_curves import drawn, raise_over_ground
from .contact_timing import (
    BodyLine,
    ContactTiming,
    CrawlingBody,
    EvenTiming,
    crawling,
    crawling_in_place,
    finding_line,
    leaning,
    timing_at_rest,
)
from .crawl_planner import CrawlSettings
from .footholds import ContactOverride, easy_height, span
from .moving import Carpet, MovingMesh, turn_between
from .surface import (
    Ground,
    GroundedPoses,
    GroundMesh,
    HeightField,
    LevelGround,
    Raise,
    StanceSettings,
    ground_along_path,
    passes_over_itself,
    sample_ground,
    sampling_ground,
)
from .unrolled import Unrolled, roll_out
from .walk import GroundedWalk, SwingSmoothing, frames_around

__all__ = [
    "BodyLine",
    "Carpet",
    "ContactOverride",
    "ContactTiming",
    "CrawlSettings",
    "CrawlingBody",
    "EvenTiming",
    "Ground",
    "GroundMesh",
    "GroundedPoses",
    "GroundedWalk",
    "HeightField",
    "LevelGround",
    "MovingMesh",
    "Raise",
    "StanceSettings",
    "SwingSmoothing",
    "Unrolled",
    "crawling",
    "crawling_in_place",
    "drawn",
    "easy_height",
    "finding_line",
    "frames_around",
    "ground_along_path",
    "leaning",
    "passes_over_itself",
    "raise_over_ground",
    "roll_out",
    "sample_ground",
    "sampling_ground",
    "span",
    "timing_at_rest",
    "turn_between",
]
