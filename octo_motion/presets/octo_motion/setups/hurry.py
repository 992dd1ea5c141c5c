# SPDX-License-Identifier: GPL-3.0-or-later
# Long quick strides; arms leave the ground early.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "hurry"
settings.cycle_time = 1.0
settings.ground.duty = 0.45
settings.ground.lift = 0.1
settings.ground.planted = 0.3
settings.turning = 0.8
