# SPDX-License-Identifier: GPL-3.0-or-later
# A hard stroke and a long glide.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "jet_escape"
settings.cycle_time = 1.4
settings.burst = 0.9
settings.bank_in_turns = 0.6
settings.ease_in = 0.02
settings.ease_out = 0.3
settings.contraction = 0.6
