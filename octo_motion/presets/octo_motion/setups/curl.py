# SPDX-License-Identifier: GPL-3.0-or-later
# On the spot: arms curl up and stretch again, one after the other.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.travel_on = "NONE"
settings.gait = "curl"
# Nobody goes anywhere: what rests on the ground stays where it is.
settings.table.stride = 0.001
settings.cycle_time = 6.0
settings.breathing = 0.06
settings.breath_time = 3.0
settings.ground.duty = 0.5
