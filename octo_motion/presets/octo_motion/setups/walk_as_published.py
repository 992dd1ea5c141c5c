# SPDX-License-Identifier: GPL-3.0-or-later
# The walk to the letter of the thesis: no ground, nothing evened out.
import bpy

active = bpy.context.object
armature = active if active.type == "ARMATURE" else active.find_armature()
settings = armature.octo_motion.locomotion

settings.gait = "walk_literal"
settings.ground.use = False
settings.stand = False
settings.keep_apart = False
settings.softness = 0.0
settings.give = 0.0
settings.steady = 0.0
settings.sway = 0.0
settings.uneven = 0.0
settings.speed_mode = "NATURAL"
settings.ease_in = 0.0
settings.ease_out = 0.0
for name in ("surge", "mantle", "siphon", "eyes", "head"):
    setattr(settings.body, name, 0.0)
settings.breathing = 0.0
