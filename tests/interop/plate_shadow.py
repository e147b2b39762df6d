#!/usr/bin/env python3
"""How well a shadow goes from another renderer's plate: graphs/plaza_plate.json against Cycles without that shadow.

    plate_shadow.py [--samples N] [--view-samples 1,4]

Renders two references with Blender (bpy, OpenEXR and numpy from PyPI; about ten minutes at 1,024 samples), kept in
target/interop: the head blocks no direct light; and it sends none of its own to others, either. Then runs the recipe and
prints relative RMSE (root of the mean squared difference over the mean of the reference) over 4 x 4-pixel blocks of one
object where the head takes more than a tenth of the direct light. Needs the project's test data, in ../shared/data or
$CHIARO_DATA.
"""
import argparse, json, os, pathlib, subprocess, sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("CHIARO_DATA", ROOT / "../shared/data")).resolve()
KEPT = ROOT / "target/interop"
PLATES = DATA / "plates/plaza-night"


def render(which, samples, out):
    """Cycles as the plates were made: the file's camera and scene, the map as it is, a box of one pixel."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(DATA / "scenes/plaza.glb"))
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 480, 100
    scene.world = bpy.data.worlds.new("night")
    scene.world.use_nodes = True
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    sky = nodes.new("ShaderNodeTexEnvironment")
    sky.image = bpy.data.images.load(str(DATA / "environments/st_peters_square_night_1k.hdr"))
    links.new(sky.outputs["Color"], nodes["Background"].inputs["Color"])
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 6, 6, 4
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = cycles.blur_glossy = 0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    head = scene.objects["head"]
    head.visible_shadow = False
    if which == "unseen":
        head.visible_diffuse = head.visible_glossy = head.visible_transmission = False
    layer = scene.view_layers[0]
    layer.name = "ViewLayer"
    layer.use_pass_diffuse_direct = layer.use_pass_diffuse_indirect = layer.use_pass_diffuse_color = True
    settings = scene.render.image_settings
    settings.media_type, settings.file_format, settings.color_depth = "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER", "16"
    scene.render.filepath = str(out)
    bpy.ops.render.render(write_still=True)


def channels(path):
    import OpenEXR

    file = OpenEXR.File(str(path), separate_channels=True)
    return {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}


def colour(found, layer):
    import numpy as np

    names = [f"{layer}.{c}" if layer else c for c in "RGB"]
    return np.stack([found[name] for name in names], axis=-1).astype(np.float64)


def blocks(values):
    height, width = values.shape[:2]
    return values.reshape(height // 4, 4, width // 4, 4, -1).mean((1, 3))


def main():
    import numpy as np

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--view-samples", default="1,4")
    arguments = parser.parse_args()
    KEPT.mkdir(parents=True, exist_ok=True)
    references = {}
    for which in ["unshadowing", "unseen"]:
        path = KEPT / f"{which}_{arguments.samples}.exr"
        if not path.exists():
            # In a process of its own: Blender does not start twice in one.
            code = f"import sys; sys.path.insert(0, {str(ROOT / 'tests/interop')!r}); import plate_shadow; " \
                   f"plate_shadow.render({which!r}, {arguments.samples}, {str(path)!r})"
            subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
        references[which] = channels(path)

    plate = channels(PLATES / "full.exr")
    shaded, lit = (colour(channels(PLATES / name), "ViewLayer.Diffuse Direct").sum(-1)
                   for name in ["direct.exr", "direct-no-head.exr"])
    ids = plate["ViewLayer.CryptoObject00.r"].view(np.uint32).reshape(120, 4, 160, 4)
    whole = (plate["ViewLayer.CryptoObject00.g"] > 0.99).reshape(120, 4, 160, 4).all((1, 3))
    one = whole & (ids == ids[:, :1, :, :1]).all((1, 3))
    region = one & (blocks(shaded[..., None]) < 0.9 * blocks(lit[..., None]))[..., 0]
    names = manifest(PLATES / "full.exr")
    of = lambda name: region & (ids[:, 0, :, 0] == names[name])
    regions = {"ground": of("ground"), "head": of("head"), "all objects": region, "rest of the picture": one & ~region}

    def error(picture, reference, where):
        a, b = blocks(picture)[where], blocks(reference)[where]
        return 100 * np.sqrt(((a - b) ** 2).mean()) / b.mean()

    before = colour(plate, "ViewLayer.Combined")
    for count in arguments.view_samples.split(","):
        out = KEPT / f"relit_{count}"
        subprocess.run([ROOT / "target/release/chiaro", "render", ROOT / "graphs/plaza_plate.json", "--device", "cpu",
                        "--no-cache", "--progress", "none", "--out", out, "--set", f"view.samples_per_pixel={count}"],
                       check=True)
        after = colour(channels(out / "plaza_plate.exr"), "")
        for which, reference in references.items():
            reference = colour(reference, "ViewLayer.Combined")
            for name, where in regions.items():
                print(f"{count} samples a pixel, head {which}, {name} ({where.sum()} blocks): "
                      f"{error(before, reference, where):.2f} % before, {error(after, reference, where):.2f} % after")


def manifest(path):
    import OpenEXR

    for part in OpenEXR.File(str(path)).parts:
        for key, value in part.header.items():
            if key.startswith("cryptomatte/") and key.endswith("/name") and value.endswith("CryptoObject"):
                listed = json.loads(part.header[key.replace("/name", "/manifest")])
                return {name: int(digits, 16) for name, digits in listed.items()}
    raise SystemExit(f"{path}: no manifest")


if __name__ == "__main__":
    main()
