# SPDX-License-Identifier: GPL-3.0-or-later
# The source's walk, standing on several arms: all that the settings start with.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "walk"
