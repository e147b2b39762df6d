#!/usr/bin/env python3
"""What other people's programs read of our files, and write for us to read. Called by tests/interop.rs.

Packages from PyPI: OpenEXR, OpenImageIO, opencolorio, bpy (Blender 5), numpy.

    exchange.py read OpenEXR|OpenImageIO EXR OUT channels of a file as raw floats, and OUT/index.json
    exchange.py write OUT                        EXR files by OpenEXR: compressions, windows, names, types
    exchange.py multiply EXR A B OUT             two layers of a file multiplied by OpenImageIO
    exchange.py view RAW DISPLAY VIEW OUT        raw RGB of ACES2065-1 through a view of OpenColorIO's ACES 2.0
    exchange.py render OUT                       multilayer EXR files by Blender's Cycles
    exchange.py pose GLB CLIP OUT FRAME..        where Blender has what a glTF file moves, as JSON
    exchange.py key EXR OBJECT WIDTH HEIGHT OUT  an object keyed out of a file by Blender's Cryptomatte node
"""
import json, os, sys


def main(command, *arguments):
    {
        "read": read, "write": write, "multiply": multiply, "view": view, "render": render, "key": key,
        "pose": pose,
    }[command](*arguments)


def dump(folder, display, channels, attributes):
    """channels: (name, part, type, left, top, 2D array of floats or uints)"""
    import numpy as np

    os.makedirs(folder, exist_ok=True)
    listed = []
    for number, (name, part, kind, left, top, values) in enumerate(channels):
        np.ascontiguousarray(values, dtype="<f4").tofile(f"{folder}/{number}.f32")
        height, width = values.shape
        listed.append({"name": name, "part": part, "type": kind, "window": [left, top, width, height],
                       "file": f"{number}.f32"})
    with open(f"{folder}/index.json", "w") as file:
        json.dump({"display": display, "channels": listed, "attributes": attributes}, file)


def read(library, path, folder):
    {"OpenEXR": read_openexr, "OpenImageIO": read_oiio}[library](path, folder)


def read_openexr(path, folder):
    import OpenEXR

    file = OpenEXR.File(path, separate_channels=True)
    channels, attributes, display = [], {}, None
    for index, part in enumerate(file.parts):
        header = part.header
        (left, top), (right, bottom) = header["displayWindow"]
        display = [int(left), int(top), int(right - left + 1), int(bottom - top + 1)]
        (left, top), _ = header["dataWindow"]
        for name, value in header.items():
            if isinstance(value, str):
                attributes.setdefault(name, value)
        attributes.setdefault("parts", str(len(file.parts)))
        if "chromaticities" in header:
            attributes.setdefault("chromaticities", json.dumps([float(x) for x in header["chromaticities"]]))
        for name, channel in part.channels.items():
            kind = {"float16": "half", "float32": "float", "uint32": "uint"}[str(channel.pixels.dtype)]
            channels.append((name, index, kind, int(left), int(top), channel.pixels))
    dump(folder, display, channels, attributes)


def read_oiio(path, folder):
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(path)
    assert source, oiio.geterror()
    channels, attributes, display, index = [], {}, None, 0
    while source.seek_subimage(index, 0):
        spec = source.spec()
        display = [spec.full_x, spec.full_y, spec.full_width, spec.full_height]
        pixels = source.read_image(index, 0, 0, spec.nchannels, "float")
        for number, name in enumerate(spec.channelnames):
            kind = str(spec.channelformats[number] if spec.channelformats else spec.format)
            channels.append((name, index, kind, spec.x, spec.y, pixels[..., number]))
        for attribute in spec.extra_attribs:
            if isinstance(attribute.value, str):
                attributes.setdefault(attribute.name, attribute.value)
        index += 1
    attributes["parts"] = str(index)
    dump(folder, display, channels, attributes)


def write(folder):
    import numpy as np, OpenEXR

    os.makedirs(folder, exist_ok=True)
    random = np.random.default_rng(7)

    def picture(width, height, kind):
        values = random.standard_normal((height, width)).astype(np.float32) * 4
        if kind is np.uint32:
            return random.integers(0, 1 << 24, (height, width), dtype=np.uint32)
        values.flat[:6] = [0.0, -0.0, 65504.0, 6e-8, np.inf, -np.inf]
        return values.astype(kind)

    def save(name, channels, **header):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
        OpenEXR.File(header, channels).write(f"{folder}/{name}.exr")

    for name in ["NO", "RLE", "ZIPS", "ZIP", "PIZ"]:
        compression = getattr(OpenEXR, f"{name}_COMPRESSION")
        for kind in [np.float16, np.float32]:
            channels = {layer: picture(70, 45, kind) for layer in ["R", "G", "B", "A", "spec.R", "spec.G", "spec.B"]}
            save(f"{name.lower()}_{kind.__name__}", channels, compression=compression)
    save("tiles", {layer: picture(70, 45, np.float32) for layer in "RGB"}, type=OpenEXR.tiledimage,
         tiles=OpenEXR.TileDescription())
    save("uint", {"id": picture(33, 9, np.uint32), "Z": picture(33, 9, np.float32)})
    window = lambda left, top, width, height: (np.array([left, top], np.int32),
                                               np.array([left + width - 1, top + height - 1], np.int32))
    for name, data, display in [
        ("overscan", (-8, -5, 60, 40), (0, 0, 44, 30)), ("crop", (12, 7, 20, 11), (0, 0, 44, 30)),
        ("shifted", (100, 50, 44, 30), (100, 50, 44, 30)), ("beside", (40, 28, 20, 10), (0, 0, 44, 30)),
    ]:
        save(name, {layer: picture(data[2], data[3], np.float16) for layer in "RGB"},
             dataWindow=window(*data), displayWindow=window(*display), comments="cut out")
    for name, layers in [
        ("arnold", ["R", "G", "B", "A", "RGBA_key.R", "RGBA_key.G", "RGBA_key.B", "diffuse_direct.R", "N.X"]),
        ("karma", ["C.r", "C.g", "C.b", "C_key.r", "C_key.g", "C_key.b"]),
        ("nuke", ["red", "green", "blue", "alpha", "depth.Z", "indirect.red", "indirect.green", "indirect.blue"]),
    ]:
        save(name, {layer: picture(21, 13, np.float32) for layer in layers})
    parts = [OpenEXR.Part({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels, name)
             for name, channels in [("rgba", {c: picture(31, 17, np.float16) for c in "RGBA"}),
                                    ("depth", {"Z": picture(31, 17, np.float32)}),
                                    ("indirect", {c: picture(31, 17, np.float16) for c in "RGB"})]]
    OpenEXR.File(parts).write(f"{folder}/parts.exr")


def multiply(path, a, b, folder):
    import OpenImageIO as oiio

    def layer(name):
        source = oiio.ImageBuf(path)
        names = source.spec().channelnames
        wanted = tuple(names.index(f"{name}.{c}" if name else c) for c in "RGB")
        return oiio.ImageBufAlgo.channels(source, wanted, ("R", "G", "B"))

    product = oiio.ImageBufAlgo.mul(layer(a), layer(b))
    pixels = product.get_pixels(oiio.FLOAT)
    spec = product.spec()
    dump(folder, [0, 0, spec.width, spec.height],
         [(c, 0, "float", 0, 0, pixels[..., i]) for i, c in enumerate("RGB")], {})


def view(raw, display, name, out):
    import numpy as np, PyOpenColorIO as ocio

    pixels = np.fromfile(raw, "<f4").reshape(-1, 3)
    config = ocio.Config.CreateFromFile("ocio://cg-config-v4.0.0_aces-v2.0_ocio-v2.5")
    processor = config.getProcessor("ACES2065-1", display, name, ocio.TRANSFORM_DIR_FORWARD)
    processor.getDefaultCPUProcessor().applyRGB(pixels)
    pixels.astype("<f4").tofile(out)


def blender(width, height):
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("cam", bpy.data.cameras.new("cam"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", 8, False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    return bpy, scene, camera


def render(folder):
    bpy, scene, camera = blender(64, 48)
    camera.location, camera.rotation_euler = (4.0, -5.0, 3.0), (1.1, 0.0, 0.66)
    bpy.ops.mesh.primitive_plane_add(size=8)
    bpy.context.object.name = "ground"
    for name, add in [("cube", bpy.ops.mesh.primitive_cube_add), ("ball", bpy.ops.mesh.primitive_uv_sphere_add)]:
        add(location=(0.0 if name == "cube" else 2.2, 0.0, 1.0))
        bpy.context.object.name = name
        material = bpy.data.materials.new(f"{name} stuff")
        bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.0))
    layer = scene.view_layers[0]
    for name in ["z", "position", "normal", "diffuse_direct", "diffuse_indirect", "diffuse_color", "object_index",
                 "cryptomatte_object", "cryptomatte_material"]:
        setattr(layer, f"use_pass_{name}", True)
    settings = scene.render.image_settings
    for name, kind, depth in [("half", "MULTI_LAYER_IMAGE", "16"), ("float", "MULTI_LAYER_IMAGE", "32"),
                              ("plain", "IMAGE", "16")]:
        settings.media_type = kind
        settings.file_format = "OPEN_EXR_MULTILAYER" if kind == "MULTI_LAYER_IMAGE" else "OPEN_EXR"
        settings.color_depth = depth
        scene.render.filepath = f"{folder}/{name}.exr"
        bpy.ops.render.render(write_still=True)


def key(path, name, width, height, out):
    bpy, scene, _ = blender(int(width), int(height))
    tree = bpy.data.node_groups.new("keying", "CompositorNodeTree")
    scene.compositing_node_group = tree
    node = tree.nodes.new("CompositorNodeCryptomatteV2")
    node.source, node.image = "IMAGE", bpy.data.images.load(path)
    node.layer_name, node.matte_id = "CryptoObject", name
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    tree.links.new(node.outputs["Matte"], tree.nodes.new("NodeGroupOutput").inputs[0])
    scene.render.use_compositing = True
    scene.cycles.samples = 1
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = out
    bpy.ops.render.render(write_still=True)


def pose(path, clip, out, *frames):
    """Where Blender has what a glTF file animates, in glTF axes: vertices of objects, places of lights and cameras."""
    bpy, scene, camera = blender(8, 8)
    bpy.data.objects.remove(camera)
    scene.render.fps = 24
    bpy.ops.import_scene.gltf(filepath=path)
    for thing in bpy.data.objects:
        data = thing.animation_data
        strips = [strip for track in data.nla_tracks for strip in track.strips] if data else []
        strips = [strip for strip in strips if strip.action.name.startswith(clip)]
        if strips:
            action, slot = strips[0].action, strips[0].action_slot
            for track in list(data.nla_tracks):
                data.nla_tracks.remove(track)
            data.action, data.action_slot = action, slot
    found = {}
    for frame in frames:
        scene.frame_set(int(frame))
        graph = bpy.context.evaluated_depsgraph_get()
        now = found[frame] = {}
        for thing in scene.objects:
            place = thing.evaluated_get(graph)
            if thing.type == "MESH":
                points = [place.matrix_world @ vertex.co for vertex in place.to_mesh().vertices]
            elif thing.type in ("LIGHT", "CAMERA"):
                points = [place.matrix_world.translation]
            else:
                continue
            now[thing.name] = [[p.x, p.z, -p.y] for p in points]
    with open(out, "w") as file:
        json.dump(found, file)


if __name__ == "__main__":
    main(*sys.argv[1:])
