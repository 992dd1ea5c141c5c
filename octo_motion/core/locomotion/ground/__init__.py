# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground, footholds, contact timing, stance and swing."""

from .arm_curves import drawn, raise_over_ground
from .body_height import BodyLine, body_line, leaning
from .contact_timing import ContactTiming, EvenTiming, crawling, crawling_in_place, timing_at_rest
from .crawl_planner import CrawlSettings
from .foothold_reach import easy_height, span
from .footholds import ContactOverride
from .grounded_poses import GroundedPoses, Raise
from .stance_settings import StanceSettings
from .surface import Ground, LevelGround, ground_along_path, passes_over_itself, sample_ground
from .swing_smoothing import SwingSmoothing, frames_around
from .walk import GroundedWalk

__all__ = [
    "BodyLine",
    "ContactOverride",
    "ContactTiming",
    "CrawlSettings",
    "EvenTiming",
    "Ground",
    "GroundedPoses",
    "GroundedWalk",
    "LevelGround",
    "Raise",
    "StanceSettings",
    "SwingSmoothing",
    "body_line",
    "crawling",
    "crawling_in_place",
    "drawn",
    "easy_height",
    "frames_around",
    "ground_along_path",
    "leaning",
    "passes_over_itself",
    "raise_over_ground",
    "sample_ground",
    "span",
    "timing_at_rest",
]
