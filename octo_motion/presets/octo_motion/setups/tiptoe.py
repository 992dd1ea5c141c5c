# SPDX-License-Identifier: GPL-3.0-or-later
# Backs away on the two rear arms, the others curled up.
import math

import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "tiptoe"
settings.cycle_time = 1.8
settings.ground.duty = 0.6
settings.ground.planted = 0.3
settings.ground.lift = 0.05
settings.ground.lean = 0.2
# Backs away from what it looks at.
settings.heading_angle = math.pi
settings.variation_min = -0.06
settings.variation_max = 0.06
