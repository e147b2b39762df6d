"""Files of sampled edits, and what they say at places of another renderer's own.

The format is described in src/transport/sampled/file.rs, what its numbers mean in src/transport/sampled/mod.rs. A place takes
its rows from the three nearest view samples, a hit of a ray its scale from the nearest gather sample (Obert 2010, 5.5.3,
Algorithm 12). Lengths are in metres, colours linear Rec.709.
"""

import json
import struct
import zlib

import numpy as np
from scipy.spatial import cKDTree

NONE = 0xFFFFFFFF
# View samples that count at a place: the cosine between normals is at least this.
ALIKE = 0.8


class BadEdits(Exception):
    """What is wrong with a file, or why it is not one for this scene."""


def read(path):
    """The origin (a dict) and the sections (arrays by name) of a file; BadEdits where they are damaged."""
    with open(path, "rb") as file:
        data = file.read()
    if len(data) < 20 or data[:8] != b"\x89edits\r\n":
        raise BadEdits(f"{path}: not a file of sampled edits; write one with chiaro's write_edits")
    version, length, checksum = struct.unpack_from("<III", data, 8)
    if version != 3:
        raise BadEdits(f"{path}: version {version}, expected 3; write the edits anew")
    header = data[20 : 20 + length]
    if zlib.crc32(data[:16] + header) != checksum:
        raise BadEdits(f"{path}: the header is damaged; write the edits anew")
    header = json.loads(header)
    begin, sections = -(-(20 + length) // 64) * 64, {}
    for section in header["sections"]:
        start = begin + section["offset"]
        content = data[start : start + section["bytes"]]
        if len(content) != section["bytes"] or zlib.crc32(content) != section["crc32"]:
            raise BadEdits(f"{path}: section {section['name']} is damaged; write the edits anew")
        kind = {"f32": "<f4", "u32": "<u4"}[section["type"]]
        sections[section["name"]] = np.frombuffer(content, kind).reshape(section["shape"])
    return header["origin"], sections


class HaarRows:
    """Sparse rows of Haar coefficients, three (red, green, blue) for each edit row."""

    def __init__(self, sections, name, count):
        self.count = count
        self.levels = count.bit_length() - 1
        self.starts = sections[f"{name}.starts"]
        self.step = sections[f"{name}.step"]
        entries, bits = sections[f"{name}.entries"], 32 - self.levels
        self.nodes = entries >> bits
        value = (entries & ((1 << bits) - 1)).astype(np.int64)
        self.values = value - ((value >> (bits - 1)) << bits)

    def at(self, row, samples):
        """Values of a row at gather samples: array of len(samples) by 3."""
        leaves = samples + self.count
        # By level from the root: the ancestor of each sample, and the side on which the sample lies below it.
        shifts = np.arange(self.levels, 0, -1)[:, None]
        nodes = leaves >> shifts
        signs = 1.0 - 2.0 * ((leaves >> (shifts - 1)) & 1)
        weights = signs / np.sqrt(2.0**shifts)
        out = np.empty((len(samples), 3))
        for channel in range(3):
            out[:, channel] = self._channel(3 * row + channel, nodes, weights)
        return out

    def _channel(self, row, nodes, weights):
        known = slice(self.starts[row], self.starts[row + 1])
        indices, step = self.nodes[known], float(self.step[row])
        values = self.values[known] * step
        if not len(indices):
            return 0.0
        place = np.minimum(np.searchsorted(indices, nodes), len(indices) - 1)
        found = np.where(indices[place] == nodes, values[place], 0.0)
        mean = values[0] / np.sqrt(self.count) if indices[0] == 0 else 0.0
        return mean + (found * weights).sum(axis=0)

    def dot(self, light):
        """Of each edit row, the sum over all gather samples of its values times light (M by 3): array of rows by 3."""
        known = haar(light)
        out = np.zeros(len(self.step))
        for row in range(len(self.step)):
            there = slice(self.starts[row], self.starts[row + 1])
            out[row] = self.step[row] * (self.values[there] @ known[self.nodes[there], row % 3])
        return out.reshape(-1, 3)


def haar(light):
    """Orthonormal Haar coefficients of M by 3 values, by the number of their node."""
    out, sums, count = np.empty_like(light), light, len(light)
    span = 1
    while len(sums) > 1:
        span *= 2
        left, right = sums[0::2], sums[1::2]
        out[len(left) : 2 * len(left)] = (left - right) / np.sqrt(span)
        sums = left + right
    out[0] = sums[0] / np.sqrt(count)
    return out


def barycentric(at, normal, corners):
    """Weights of three places at another in the plane with that normal, clamped to what lies between them."""
    a, b, c = corners
    area = np.dot(np.cross(b - a, c - a), normal)
    if abs(area) < 1e-12 * max(np.dot(b - a, b - a), np.dot(c - a, c - a), 1e-30):
        return np.array([1.0, 0.0, 0.0])
    u = np.dot(np.cross(c - b, at - b), normal) / area
    v = np.dot(np.cross(a - c, at - c), normal) / area
    weights = np.clip([u, v, 1.0 - u - v], 0.0, None)
    return weights / weights.sum()


class Edits:
    """Sampled edits of a scene whose triangles are numbered as chiaro numbers them.

    corners: of all triangles, m, T by 3 by 3. objects: of each triangle, the number of its object.
    """

    def __init__(self, path, corners, objects):
        self.origin, self.sections = read(path)
        self._check(path, corners)
        self.objects = objects
        self.gather_count = self.origin["gather_samples"]
        self.scales = HaarRows(self.sections, "scale", self.gather_count)
        self.offsets = HaarRows(self.sections, "offset", self.gather_count) if "offset.starts" in self.sections else None
        low, high = np.array(self.origin["bounds"])
        self.size = np.linalg.norm(high - low)
        self.gather = self._tree("gather")
        self.view = self._tree("view")
        self.changes_source = "source.scale" in self.sections or "source.offset" in self.sections
        touched = self.sections["touched"]
        self.number_of_touched = dict(zip(touched.tolist(), range(len(touched))))
        # Of each offset row, the irradiance that it adds; `light_offsets` finds it.
        self.added = None

    def _check(self, path, corners):
        if self.origin["triangles"] != len(corners):
            found = self.origin["triangles"]
            raise BadEdits(f"{path}: edits for a scene of {found} triangles, this one has {len(corners)}")
        side, at = self.sections["gather.side"], self.sections["gather.barycentrics"].astype(float)
        triangles = corners[side // 2]
        places = triangles[:, 0] + at[:, :1] * (triangles[:, 1] - triangles[:, 0])
        places += at[:, 1:] * (triangles[:, 2] - triangles[:, 0])
        apart = np.abs(places - self.sections["gather.position"]).max()
        if apart > 1e-4 * np.abs(corners).max():
            raise BadEdits(f"{path}: edits for another scene: gather samples lie up to {apart:.3g} m beside its triangles")

    def _tree(self, name):
        """Over the samples that are somewhere; and their numbers."""
        side = self.sections[f"{name}.side"]
        there = np.flatnonzero(side != NONE)
        places, normals = (self.sections[f"{name}.{what}"][there] for what in ("position", "normal"))
        return cKDTree(self._key(self.objects[side[there] // 2], places, normals)), there

    def _key(self, objects, places, normals):
        """Near to each other are places of one object that are turned alike."""
        apart = np.asarray(objects)[..., None] * (1e3 * self.size)
        return np.concatenate([places, 0.3 * self.size * np.asarray(normals), apart], axis=-1)

    def nearest_gather(self, objects, places, normals):
        """Of each hit: the number of the nearest gather sample, -1 where its object has none."""
        tree, samples = self.gather
        apart, near = tree.query(self._key(objects, places, normals))
        return np.where(apart < 1e2 * self.size, samples[near], -1)

    def at_source(self, samples, light):
        """Light (N by 3) as it leaves the surfaces at the nearest gather samples: s_g B + o_g."""
        there = (samples >= 0)[:, None]
        scale, offset = self.sections.get("source.scale"), self.sections.get("source.offset")
        if scale is not None:
            light = np.where(there, light * scale[samples], light)
        if offset is not None:
            light = np.where(there, light + offset[samples], light)
        return light

    def nearest_view(self, number, place, normal):
        """The three nearest view samples of an object, turned alike, and their weights; none where there is none."""
        tree, samples = self.view
        apart, near = tree.query(self._key(number, place, normal), k=min(3, len(samples)))
        near = samples[np.atleast_1d(near)[np.atleast_1d(apart) < 1e2 * self.size]]
        near = near[self.sections["view.normal"][near] @ normal >= ALIKE]
        if len(near) < 3:
            return near[:1], np.ones(len(near[:1]))
        return near, barycentric(place, normal, self.sections["view.position"][near].astype(float))

    def rows(self, near, shares):
        """Rows and what each counts, of view samples that count `shares`: {row: weight}."""
        mix = {}
        for sample, share in zip(near, shares):
            touched = self.number_of_touched.get(int(sample))
            if touched is None or share == 0.0:
                continue
            for row, weight in zip(self.sections["slots"][touched], self.sections["weights"][touched]):
                if row != NONE and weight != 0.0:
                    mix[int(row)] = mix.get(int(row), 0.0) + float(share) * float(weight)
        return mix

    def scale(self, mix, samples):
        """S of a mix of rows at gather samples; 1 where a hit has none."""
        there = samples >= 0
        scale = np.ones((len(samples), 3))
        for row, weight in mix.items():
            scale[there] += weight * self.scales.at(row, samples[there])
        return scale

    def light_offsets(self, exitance):
        """Prepares `offset`: what each offset row adds, from the exitance (after `at_source`) of all gather samples."""
        self.added = self.offsets.dot(exitance)

    def offset(self, mix):
        """Irradiance that a mix of offset rows adds."""
        if self.added is None:
            return np.zeros(3)
        return sum((weight * self.added[row] for row, weight in mix.items()), np.zeros(3))

    def at_eye(self, near, shares, light):
        """Light on its way to the camera: s_v L + o_v, interpolated between view samples."""
        if not len(near):
            return light
        scale, offset = self.sections.get("eye.scale"), self.sections.get("eye.offset")
        scale = 1.0 if scale is None else shares @ scale[near]
        return light * scale + (0.0 if offset is None else shares @ offset[near])
