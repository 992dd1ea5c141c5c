# SPDX-License-Identifier: GPL-3.0-or-later
# A wave of steps runs over the arms.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "walk"
