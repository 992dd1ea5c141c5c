# SPDX-License-Identifier: GPL-3.0-or-later
# Each arm in its own time; the front may face any way.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "crawl"
settings.cycle_time = 2.4
settings.ground.duty = 0.5
settings.ground.planted = 0.25
