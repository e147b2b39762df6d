#!/usr/bin/env python3
"""Reads a file of sampled edits and applies it to one view sample; needs nothing but Python 3.

The format is described in src/transport/sampled/file.rs, what the numbers mean in src/transport/sampled/mod.rs.

    read_edits.py EDITS PIXEL.json

PIXEL.json: {"sample": v, "exitance": [[r, g, b] of each gather sample], "reflectance": [r, g, b],
             "transfer": [[weight, [[node of the gather tree, coefficient], ...]] of each slot of v]}
Prints {"irradiance": [r, g, b], "radiance": [r, g, b]}.
"""
import array, json, math, struct, sys, zlib

UNTOUCHED = 0xFFFFFFFF


def read(path):
    data = open(path, "rb").read()
    magic, version, length, crc = struct.unpack_from("<8sIII", data)
    assert magic == b"\x89edits\r\n" and version == 3, "not a file of sampled edits of version 3"
    header = data[20 : 20 + length]
    assert zlib.crc32(data[:16] + header) == crc, "the header is damaged"
    header = json.loads(header)
    begin, sections = (20 + length + 63) // 64 * 64, {}
    for section in header["sections"]:
        start = begin + section["offset"]
        content = data[start : start + section["bytes"]]
        assert len(content) == section["bytes"], section["name"] + " is cut off"
        assert zlib.crc32(content) == section["crc32"], section["name"] + " is damaged"
        values = array.array({"f32": "f", "u32": "I"}[section["type"]], content)
        assert values.itemsize == 4
        if sys.byteorder == "big":
            values.byteswap()
        wide = section["shape"][1] if len(section["shape"]) == 2 else 1
        sections[section["name"]] = values if wide == 1 else [values[i : i + wide] for i in range(0, len(values), wide)]
    return header["origin"], sections


def pyramid(leaves):
    """Means over the nodes of the tree: root at 1, children of n at 2 n and 2 n + 1."""
    count = len(leaves)
    means = [0.0] * count + list(leaves)
    for node in range(count - 1, 0, -1):
        means[node] = 0.5 * (means[2 * node] + means[2 * node + 1])
    return means


def row(sections, name, number, count):
    """A sparse row of Haar coefficients, as means over the nodes of the tree."""
    bits = count.bit_length() - 1
    starts, entries, step = (sections[f"{name}.{part}"] for part in ("starts", "entries", "step"))
    coefficients = {}
    for entry in entries[starts[number] : starts[number + 1]]:
        value = entry & ((1 << (32 - bits)) - 1)
        value -= (value >> (31 - bits)) << (32 - bits)  # two's complement
        coefficients[entry >> (32 - bits)] = value * step[number]
    means = [0.0, coefficients.get(0, 0.0) / math.sqrt(count)] + [0.0] * (2 * count - 2)
    for node in range(1, count):
        leaves = count >> (node.bit_length() - 1)
        change = coefficients.get(node, 0.0) / math.sqrt(leaves)
        means[2 * node], means[2 * node + 1] = means[node] + change, means[node] - change
    return means


def main(path, pixel):
    origin, sections = read(path)
    pixel, count = json.load(open(pixel)), origin["gather_samples"]
    v, touched = pixel["sample"], sections["touched"]
    at = touched.index(v) if v in touched else None
    slots = sections["slots"][at] if at is not None else [UNTOUCHED] * 4
    counts = sections["weights"][at] if at is not None else [0.0] * 4
    vector = lambda name, i, c, missing: sections[name][i][c] if name in sections else missing
    irradiance = []
    for c in range(3):
        light = [
            vector("source.scale", g, c, 1.0) * b[c] + vector("source.offset", g, c, 0.0)
            for g, b in enumerate(pixel["exitance"])
        ]
        means, total = pyramid(light), 0.0
        for (weight, transfer), slot, counted in zip(pixel["transfer"], slots, counts):
            total += weight * sum(t * means[node] for node, t in transfer)
            if slot != UNTOUCHED:
                scale = row(sections, "scale", 3 * slot + c, count)
                total += counted * sum(t * scale[node] * means[node] for node, t in transfer)
                if "offset.starts" in sections:
                    offset = row(sections, "offset", 3 * slot + c, count)[count:]
                    total += counted * sum(o * b for o, b in zip(offset, light))
        irradiance.append(total)
    radiance = [pixel["reflectance"][c] * irradiance[c] / math.pi for c in range(3)]
    radiance = [vector("eye.scale", v, c, 1.0) * radiance[c] + vector("eye.offset", v, c, 0.0) for c in range(3)]
    print(json.dumps({"irradiance": irradiance, "radiance": radiance}))


main(*sys.argv[1:])
