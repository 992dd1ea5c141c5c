# SPDX-License-Identifier: GPL-3.0-or-later
# Rests on the spot and breathes, shifts its weight and explores with its tips.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.travel_on = "NONE"
settings.gait = "idle"
# Nobody goes anywhere: what rests on the ground stays where it is.
settings.table.stride = 0.001
settings.cycle_time = 5.0
settings.ground.duty = 0.55
settings.breathing = 0.09
settings.breath_time = 2.5
