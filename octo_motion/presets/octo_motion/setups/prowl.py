# SPDX-License-Identifier: GPL-3.0-or-later
# Low and slow, the arms close to the ground: it goes, stops, crouches, looks about, goes on.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "prowl"
settings.cycle_time = 4.2
settings.ground.duty = 0.65
settings.ground.lift = 0.03
settings.ground.planted = 0.3
settings.ground.smoothing = 0.25
settings.variation_min = -0.1
settings.variation_max = 0.1
settings.stalk = 1.0
