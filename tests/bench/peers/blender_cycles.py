"""Time and pictures of Blender's Cycles, one bounce of indirect light, for a curve of error over time.

    python blender_cycles.py SCENE.glb OUT [--samples 1,2,4] [--bounces 1] [--threads 2] [--size 640x480] [--denoise]

Writes OUT/cycles-SAMPLES.exr (passes `Diffuse Indirect`, `Diffuse Color`, as in the plates; with --denoise, what
OpenImageDenoise makes of their product, as layer `Composite`) and prints one line of JSON a picture: samples a pixel,
seconds. Needs `bpy` (PyPI), Blender 5.

The seconds are those of a render whose scene, textures and BVH are there already (persistent data, one render before
that does not count), without writing the file.
"""

import argparse
import json
import os
import sys
import time

import bpy


def enable_cpu(scene, threads):
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = threads
    scene.render.use_persistent_data = True


def plain(scene, bounces):
    """What the comparison is about: path tracing, nothing that trades light for time."""
    cycles = scene.cycles
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.max_bounces = bounces
    cycles.diffuse_bounces = bounces
    cycles.glossy_bounces = 0
    cycles.transmission_bounces = 0
    cycles.caustics_reflective = False
    cycles.caustics_refractive = False
    cycles.sample_clamp_direct = 0.0
    cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1.0
    scene.world = bpy.data.worlds.new("dark")
    scene.world.use_nodes = True
    for node in scene.world.node_tree.nodes:
        if node.type == "BACKGROUND":
            node.inputs["Strength"].default_value = 0.0


def denoise(scene, layer):
    """Indirect light times surface colour through OpenImageDenoise, told by albedo and normals."""
    layer.cycles.denoising_store_passes = True
    tree = bpy.data.node_groups.new("denoise", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    passes = tree.nodes.new("CompositorNodeRLayers")
    product = tree.nodes.new("ShaderNodeMix")
    product.data_type, product.blend_type = "RGBA", "MULTIPLY"
    product.inputs[0].default_value = 1.0
    denoiser = tree.nodes.new("CompositorNodeDenoise")
    out = tree.nodes.new("NodeGroupOutput")
    colours = [socket for socket in product.inputs if socket.type == "RGBA"]
    result = [socket for socket in product.outputs if socket.type == "RGBA"][0]
    tree.links.new(passes.outputs["Diffuse Indirect"], colours[0])
    tree.links.new(passes.outputs["Diffuse Color"], colours[1])
    tree.links.new(result, denoiser.inputs["Image"])
    tree.links.new(passes.outputs["Denoising Albedo"], denoiser.inputs["Albedo"])
    tree.links.new(passes.outputs["Denoising Normal"], denoiser.inputs["Normal"])
    tree.links.new(denoiser.outputs["Image"], out.inputs["Image"])


def load(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # Files made for radiometric renderers: intensities in W/sr are taken as they are.
    bpy.ops.import_scene.gltf(filepath=path, export_import_convert_lighting_mode="COMPAT")
    scene = bpy.context.scene
    cameras = [thing for thing in scene.objects if thing.type == "CAMERA"]
    if not cameras:
        sys.exit(f"{path}: the scene has no camera")
    scene.camera = cameras[0]
    for material in bpy.data.materials:
        for node in material.node_tree.nodes if material.use_nodes else []:
            if node.type == "BSDF_PRINCIPLED":
                node.inputs["Specular IOR Level"].default_value = 0.0
    return scene


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scene")
    parser.add_argument("out")
    parser.add_argument("--samples", default="1,2,4,8,16,32,64,128,256")
    parser.add_argument("--bounces", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--denoise", action="store_true", help="with OpenImageDenoise, albedo and normals")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--seed", type=int, default=1, help="other than that of plates, whose noise is theirs")
    arguments = parser.parse_args()
    os.makedirs(arguments.out, exist_ok=True)
    scene = load(arguments.scene)
    enable_cpu(scene, arguments.threads)
    plain(scene, arguments.bounces)
    width, height = map(int, arguments.size.split("x"))
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    layer = scene.view_layers[0]
    layer.use_pass_diffuse_indirect = True
    layer.use_pass_diffuse_color = True
    layer.use_pass_diffuse_direct = True
    if arguments.denoise:
        denoise(scene, layer)
    scene.cycles.seed = arguments.seed
    settings = scene.render.image_settings
    settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"
    scene.cycles.samples = 1
    bpy.ops.render.render()
    for samples in map(int, arguments.samples.split(",")):
        scene.cycles.samples = samples
        # Persistent data do not see a change of settings by themselves.
        scene.update_tag()
        bpy.context.view_layer.update()
        start = time.perf_counter()
        bpy.ops.render.render()
        seconds = time.perf_counter() - start
        file = os.path.join(arguments.out, f"cycles-{samples}.exr")
        scene.render.filepath = file
        bpy.data.images["Render Result"].save_render(file, scene=scene)
        print(json.dumps({"samples": samples, "seconds": seconds, "file": file}), flush=True)


main()
