# SPDX-License-Identifier: GPL-3.0-or-later
# Slow steps that come to rest.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "settle"
settings.cycle_time = 3.2
settings.ease_in = 0.1
settings.ease_out = 0.6
settings.ground.duty = 0.65
settings.ground.lift = 0.03
