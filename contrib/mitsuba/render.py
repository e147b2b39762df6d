#!/usr/bin/env python3
"""Renders a glTF binary with Mitsuba 3 and chiaro's sampled edits.

    render.py SCENE.glb OUT.exr [--edits FILE.edits] [--size 160x120] [--samples 4] [--rays 64] [--seed 0]

Channels of OUT.exr: R G B (direct and one bounce of indirect light) and indirect.R, .G, .B. With edits, the camera is that
which they were sampled for. Exit codes: 0, or 1 and what is wrong.
"""

import argparse
import os
import sys

import mitsuba as mi

mi.set_variant("scalar_rgb")
# It warns of how slow Python is here; that is known.
mi.set_log_level(mi.LogLevel.Error)

import numpy as np

import chiaro_edits
import edited_gather
import gltf_scene


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("out")
    parser.add_argument("--edits")
    parser.add_argument("--size", default="160x120")
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--rays", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    scene = gltf_scene.Scene(arguments.scene)
    edits, camera = None, scene.camera
    if arguments.edits:
        edits = chiaro_edits.Edits(arguments.edits, scene.corners, scene.objects)
        view = edits.origin["camera"]
        camera = view["position"], np.reshape(view["world_from_camera"], (3, 3)).T, view["fov_y"]
    if camera is None:
        raise gltf_scene.Unsupported(f"{arguments.scene}: it has no camera with perspective")
    sensor = gltf_scene.sensor(camera, width, height, arguments.samples)
    world = mi.load_dict({**scene.dict, "sensor": sensor})
    integrator = edited_gather.EditedGather(scene, edits, arguments.rays)
    integrator.prepare_edits(world)
    mi.render(world, integrator=integrator, spp=arguments.samples, seed=arguments.seed)
    # Whole, or not at all.
    part = f"{arguments.out}.{os.getpid()}.part.exr"
    world.sensors()[0].film().write(part)
    os.replace(part, arguments.out)


try:
    main()
except (chiaro_edits.BadEdits, gltf_scene.Unsupported, OSError) as error:
    sys.exit(f"error: {error}")
