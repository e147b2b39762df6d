"""A glTF binary as a Mitsuba scene: triangles in chiaro's order, diffuse surfaces, point, spot and directional lamps.

What would look otherwise in the two programs is refused, not guessed: textures, metals, soft spot lights, skins, emission.
"""

import json
import struct

import mitsuba as mi
import numpy as np

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Unsupported(Exception):
    """What the file has and this reader does not draw."""


class Gltf:
    def __init__(self, path):
        with open(path, "rb") as file:
            data = file.read()
        if data[:4] != b"glTF":
            raise Unsupported(f"{path}: not a binary glTF file (.glb)")
        self.path, self.chunks, at = path, [], 12
        while at < len(data):
            (length,) = struct.unpack_from("<I", data, at)
            self.chunks.append(data[at + 8 : at + 8 + length])
            at += 8 + length
        self.json = json.loads(self.chunks[0])

    def refuse(self, what):
        raise Unsupported(f"{self.path}: {what}, which this example does not draw")

    def array(self, number):
        accessor = self.json["accessors"][number]
        if "sparse" in accessor or "bufferView" not in accessor:
            self.refuse("it has a sparse accessor")
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, wide = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * wide)
        shape, strides = (accessor["count"], wide), (stride, kind.itemsize)
        return np.ndarray(shape, kind, self.chunks[1], start, strides)

    def nodes(self):
        """Nodes in the order of the tree, with world_from_node (4 by 4)."""
        scenes = self.json.get("scenes")
        roots = scenes[self.json.get("scene", 0)]["nodes"] if scenes else range(len(self.json["nodes"]))
        waiting = [(number, np.eye(4)) for number in reversed(roots)]
        while waiting:
            number, world = waiting.pop()
            node = self.json["nodes"][number]
            world = world @ local(node)
            yield node, world
            waiting.extend((child, world) for child in reversed(node.get("children", [])))


def local(node):
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])
    world = np.eye(4)
    world[:3, :3] = rotation * np.array(node.get("scale", [1, 1, 1]))
    world[:3, 3] = node.get("translation", [0, 0, 0])
    return world


class Scene:
    """What is in a file. `dict`: for `mi.load_dict`. `corners`: of all triangles, in their order, world (T by 3 by 3).
    `objects`: of each triangle, the number of its object. `first`: by the name of a Mitsuba shape, its first triangle.
    `camera`: position, world_from_camera (columns right, up, backward), vertical field of view in radians; or None."""

    def __init__(self, path):
        self.gltf = Gltf(path)
        self.dict, self.first, self.camera = {"type": "scene"}, {}, None
        corners, objects, count, object_number = [], [], 0, 0
        self.materials = [self._material(material) for material in self.gltf.json.get("materials", [])]
        lamps = self.gltf.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
        for node, world in self.gltf.nodes():
            if "skin" in node:
                self.gltf.refuse("it has a skin")
            if "mesh" in node:
                for primitive in self.gltf.json["meshes"][node["mesh"]]["primitives"]:
                    name = f"shape_{len(self.first)}"
                    triangles = self._add(name, primitive, world)
                    self.first[name] = count
                    count += len(triangles)
                    corners.append(triangles)
                    objects.append(np.full(len(triangles), object_number))
                object_number += 1
            lamp = node.get("extensions", {}).get("KHR_lights_punctual")
            if lamp is not None:
                self.dict[f"lamp_{len(self.dict)}"] = self._lamp(lamps[lamp["light"]], world)
            if "camera" in node and self.camera is None:
                lens = self.gltf.json["cameras"][node["camera"]]
                if lens["type"] == "perspective":
                    self.camera = world[:3, 3], world[:3, :3], lens["perspective"]["yfov"]
        self.corners, self.objects = np.concatenate(corners), np.concatenate(objects)

    def _material(self, material):
        name, surface = material.get("name"), material.get("pbrMetallicRoughness", {})
        if any("Texture" in key for key in [*material, *surface]):
            self.gltf.refuse(f"material {name} has a texture")
        if surface.get("metallicFactor", 1) != 0:
            self.gltf.refuse(f"material {name} is of metal")
        if any(material.get("emissiveFactor", [0])):
            self.gltf.refuse(f"material {name} shines")
        colour = surface.get("baseColorFactor", [1, 1, 1, 1])[:3]
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": colour}}}

    def _add(self, name, primitive, world):
        if primitive.get("mode", 4) != 4 or "material" not in primitive:
            self.gltf.refuse("a mesh is not of triangles, or has no material")
        attributes = primitive["attributes"]
        places = self.gltf.array(attributes["POSITION"]) @ world[:3, :3].T + world[:3, 3]
        faces = np.arange(len(places)) if "indices" not in primitive else self.gltf.array(primitive["indices"])
        faces = faces.reshape(-1, 3).astype(np.uint32)
        properties = mi.Properties()
        properties["mesh_bsdf"] = mi.load_dict(self.materials[primitive["material"]])
        has_normals = "NORMAL" in attributes
        mesh = mi.Mesh(name, len(places), len(faces), properties, has_vertex_normals=has_normals)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = places.astype(np.float32).ravel()
        parameters["faces"] = faces.ravel()
        if has_normals:
            normals = self.gltf.array(attributes["NORMAL"]) @ np.linalg.inv(world[:3, :3])
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            parameters["vertex_normals"] = normals.astype(np.float32).ravel()
        parameters.update()
        self.dict[name] = mesh
        return places[faces]

    def _lamp(self, lamp, world):
        place, towards = world[:3, 3], -world[:3, 2] / np.linalg.norm(world[:3, 2])
        power = (np.array(lamp.get("color", [1, 1, 1])) * lamp.get("intensity", 1)).tolist()
        colour = {"type": "rgb", "value": power}
        if lamp["type"] == "point":
            return {"type": "point", "position": place.tolist(), "intensity": colour}
        if lamp["type"] == "directional":
            return {"type": "directional", "direction": towards.tolist(), "irradiance": colour}
        inner, outer = lamp["spot"].get("innerConeAngle", 0), lamp["spot"].get("outerConeAngle", np.pi / 4)
        if outer - inner > 1e-3:
            self.gltf.refuse(f"the edge of spot light {lamp.get('name')} is soft, and falls off otherwise in Mitsuba")
        up = [1, 0, 0] if abs(towards[0]) < 0.9 else [0, 1, 0]
        to_world = mi.ScalarTransform4f().look_at(place.tolist(), (place + towards).tolist(), up)
        angles = {"cutoff_angle": np.degrees(outer), "beam_width": np.degrees(outer) * (1 - 1e-4)}
        return {"type": "spot", "to_world": to_world, "intensity": colour, **angles}


def sensor(camera, width, height, samples):
    """A Mitsuba sensor for a camera as in `Scene.camera`."""
    position, axes, fov_y = camera
    position, axes = np.asarray(position, float), np.asarray(axes, float)
    # Mitsuba looks along +z and has its x to the left.
    to_world = mi.ScalarTransform4f().look_at(
        position.tolist(), (position - axes[:, 2]).tolist(), axes[:, 1].tolist()
    )
    return {
        "type": "perspective",
        "fov": float(np.degrees(fov_y)),
        "fov_axis": "y",
        "to_world": to_world,
        "near_clip": 1e-3,
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "independent", "sample_count": samples},
    }
