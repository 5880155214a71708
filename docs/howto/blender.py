"""Show shapes of a robot in Blender, one shape a frame: blender --python blender.py -- turn.npz

Lengths are magnified a hundred times: 1 cm becomes one unit of Blender.
"""

from __future__ import annotations

import sys

import bpy
import numpy as np
from mathutils import Matrix

SCALE = 100.0
data = np.load(sys.argv[-1])
nodes, positions, axes = SCALE * data["nodes"], SCALE * data["head_position"], data["head_axes"]
length, radius, _, tail_radius = SCALE * data["sizes"]

bpy.ops.mesh.primitive_cylinder_add(radius=radius, depth=length, vertices=64)
head = bpy.context.object  # its axis is z, as that of the robot
splines = []
for tail in nodes[0]:
    curve = bpy.data.curves.new("tail", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.use_fill_caps = "3D", tail_radius, True
    spline = curve.splines.new("POLY")
    spline.points.add(len(tail) - 1)
    splines.append(spline)
    bpy.context.collection.objects.link(bpy.data.objects.new("tail", curve))


def show(scene: bpy.types.Scene, *_: object) -> None:
    """Move head and tails to the shape of the scene's frame."""
    i = min(max(scene.frame_current, 0), len(nodes) - 1)
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = axes[i], positions[i]
    head.matrix_world = Matrix(turned.tolist())
    for spline, tail in zip(splines, nodes[i], strict=True):
        spline.points.foreach_set("co", np.column_stack([tail, np.ones(len(tail))]).ravel())
        spline.id_data.update_tag()


bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, len(nodes) - 1
bpy.app.handlers.frame_change_pre.append(show)
show(bpy.context.scene)
