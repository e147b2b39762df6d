//! A tiny room as a .glb, made here, whose JSON and bytes tests can spoil.

use serde_json::{Value as Json, json};
use std::f32::consts::FRAC_1_SQRT_2;

pub struct Glb {
    pub json: Json,
    pub bin: Vec<u8>,
}

impl Glb {
    /// A floor and a wall of 4 x 4 m, a lamp, a camera. Accessor 0 and 1: positions and indices; 2: texture coordinates.
    pub fn room() -> Self {
        let corners: [[f32; 3]; 4] = [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]];
        let mut bin: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        bin.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
        bin.extend([0f32, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0].iter().flat_map(|x| x.to_le_bytes()));
        let picture = bin.len();
        bin.extend(png());
        let json = json!({
            "asset": { "version": "2.0" },
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": { "KHR_lights_punctual": { "lights": [
                { "name": "lamp", "type": "spot", "intensity": 20.0, "spot": { "outerConeAngle": 1.0 } }
            ]}},
            "scene": 0,
            "scenes": [{ "nodes": [0, 1, 2, 3] }],
            "nodes": [
                { "name": "floor", "mesh": 0 },
                { "name": "wall", "mesh": 0, "translation": [0, 2, -2], "rotation": [FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2] },
                { "name": "eye", "camera": 0, "translation": [0, 1.5, 4] },
                { "name": "lamp", "translation": [0, 3.5, 1], "rotation": [-FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2],
                  "extensions": { "KHR_lights_punctual": { "light": 0 } } }
            ],
            "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
            "materials": [{ "name": "grey", "pbrMetallicRoughness": {
                "baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": 0, "baseColorTexture": { "index": 0 }
            }}],
            "textures": [{ "source": 0 }],
            "images": [{ "bufferView": 3, "mimeType": "image/png" }],
            "meshes": [{ "primitives": [
                { "attributes": { "POSITION": 0, "TEXCOORD_0": 2 }, "indices": 1, "material": 0 }
            ]}],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                  "min": [-2, 0, -2], "max": [2, 0, 2] },
                { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
                { "bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2" }
            ],
            "bufferViews": [
                { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
                { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
                { "buffer": 0, "byteOffset": 60, "byteLength": 32 },
                { "buffer": 0, "byteOffset": picture, "byteLength": bin.len() - picture }
            ],
            "buffers": [{ "byteLength": bin.len() }]
        });
        Self { json, bin }
    }

    /// Spoils the value at a JSON pointer.
    pub fn set(mut self, pointer: &str, value: Json) -> Self {
        let (parent, last) = pointer.rsplit_once('/').unwrap();
        match self.json.pointer_mut(parent).unwrap_or_else(|| panic!("no {parent}")) {
            Json::Object(object) => drop(object.insert(last.to_owned(), value)),
            Json::Array(list) => list[last.parse::<usize>().unwrap()] = value,
            other => panic!("{parent} is {other}"),
        }
        self
    }

    /// Takes the value at a JSON pointer out.
    pub fn without(mut self, pointer: &str) -> Self {
        let (parent, last) = pointer.rsplit_once('/').unwrap();
        let removed = self.json.pointer_mut(parent).and_then(Json::as_object_mut).and_then(|o| o.remove(last));
        assert!(removed.is_some(), "no {pointer}");
        self
    }

    /// Adds an accessor of floats, `width` to an element (16: a matrix); its number.
    pub fn floats(&mut self, width: usize, numbers: &[f32]) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4", "MAT4"][width.min(5) - 1];
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(5126, kind, numbers.len() / width, &bytes)
    }

    /// Adds an accessor of bytes, four to an element; its number.
    pub fn joints(&mut self, numbers: &[[u8; 4]]) -> usize {
        self.accessor(5121, "VEC4", numbers.len(), numbers.as_flattened())
    }

    fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        self.bin.extend(bytes);
        self.json["buffers"][0]["byteLength"] = self.bin.len().into();
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(view);
        let accessor =
            json!({ "bufferView": views.len() - 1, "componentType": component, "count": count, "type": kind });
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(accessor);
        accessors.len() - 1
    }

    /// Adds an animation of one property of a node: keys at `times` (s), `width` numbers each.
    pub fn animate(mut self, name: &str, node: usize, path: &str, width: usize, times: &[f32], values: &[f32]) -> Self {
        let (input, output) = (self.floats(1, times), self.floats(if path == "weights" { 1 } else { width }, values));
        let animation = json!({
            "name": name,
            "channels": [{ "sampler": 0, "target": { "node": node, "path": path } }],
            "samplers": [{ "input": input, "output": output }]
        });
        match self.json["animations"].as_array_mut() {
            Some(list) => list.push(animation),
            None => self.json["animations"] = json!([animation]),
        }
        self
    }

    /// Overwrites a float of the positions.
    pub fn float(mut self, index: usize, value: f32) -> Self {
        self.bin[4 * index..4 * index + 4].copy_from_slice(&value.to_le_bytes());
        self
    }

    /// Overwrites an index.
    pub fn index(mut self, index: usize, value: u16) -> Self {
        self.bin[48 + 2 * index..50 + 2 * index].copy_from_slice(&value.to_le_bytes());
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        let padded = |mut part: Vec<u8>, with: u8| {
            part.resize(part.len().next_multiple_of(4), with);
            part
        };
        let (text, bin) = (padded(self.json.to_string().into_bytes(), b' '), padded(self.bin.clone(), 0));
        let word = |value: usize| (value as u32).to_le_bytes();
        let total = 12 + 8 + text.len() + 8 + bin.len();
        [b"glTF", &word(2)[..], &word(total), &word(text.len()), b"JSON", &text, &word(bin.len()), b"BIN\0", &bin]
            .concat()
    }
}

/// One pixel.
fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(1, 1, image::Rgb([200, 180, 160]))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}
