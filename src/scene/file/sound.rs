//! Whether a glTF file can be read without surprises. The importer trusts numbers that it should not: it would panic on
//! an accessor past its buffer, a type that no mesh has, or a light that is not there.

use crate::{Error, Result};
use gltf::accessor::{DataType, Dimensions};
use gltf::animation::Property;
use gltf::{Accessor, Semantic};
use serde_json::Value as Json;
use std::path::Path;

/// Vertices that an accessor without data of its own may have (all zero but for a few).
const MOST_WITHOUT_DATA: usize = 1 << 24;

const UNREADABLE: [(&str, &str); 4] = [
    ("KHR_draco_mesh_compression", "Draco"),
    ("EXT_meshopt_compression", "meshopt"),
    ("KHR_meshopt_compression", "meshopt"),
    ("KHR_texture_basisu", "Basis Universal texture"),
];

/// The JSON part of a .glb, or all of a .gltf; otherwise, what is wrong with it.
pub fn json_part(bytes: &[u8]) -> std::result::Result<Json, String> {
    let text = if bytes.starts_with(b"glTF") {
        let length = bytes
            .get(12..16)
            .map_or(usize::MAX, |word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]) as usize);
        let part = 20usize.checked_add(length).and_then(|end| bytes.get(20..end));
        part.ok_or_else(|| format!("ends after {} bytes, before its JSON does", bytes.len()))?
    } else {
        bytes
    };
    serde_json::from_slice(text).map_err(|error| format!("is not a readable glTF file: {error}"))
}

/// The bytes that a URI with `%20` and the like stands for.
pub fn percent_decoded(uri: &str) -> Vec<u8> {
    let mut out = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let hex = after.get(..2).and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        match hex.filter(|_| byte == b'%') {
            Some(decoded) => {
                out.push(decoded);
                rest = &after[2..];
            }
            None => {
                out.push(byte);
                rest = after;
            }
        }
    }
    out
}

/// What can be seen before the importer looks: compression that is not read, parts that it takes for granted.
///
/// Errors: `Error::File`.
pub fn check_json(path: &Path, json: &Json) -> Result<()> {
    let list = |pointer: &str| json.pointer(pointer).and_then(Json::as_array).into_iter().flatten();
    for name in list("/extensionsRequired").filter_map(Json::as_str) {
        if let Some((_, what)) = UNREADABLE.iter().find(|(extension, _)| *extension == name) {
            let help = "decompress it first, for example: gltf-transform copy in.glb out.glb";
            return Err(Error::file(path, format!("uses {what} compression ({name}), which is not read"), help));
        }
    }
    if let Some(version) = json.pointer("/asset/version").filter(|version| !version.to_string().starts_with("\"2")) {
        return Err(Error::file(path, format!("is glTF {version}; 2.0 is read"), "export it again as glTF 2.0"));
    }
    for uri in list("/buffers").chain(list("/images")).filter_map(|entry| entry["uri"].as_str()) {
        if String::from_utf8(percent_decoded(uri)).is_err() {
            return Err(damaged(path, format!("\"{uri}\" is no path")));
        }
    }
    for (index, image) in list("/images").enumerate() {
        if image["uri"].is_null() && (image["bufferView"].is_null() || image["mimeType"].is_null()) {
            return Err(damaged(path, format!("image {index} says neither a file nor a kind of embedded picture")));
        }
    }
    let accessors = list("/accessors").count() as u64;
    for (index, mesh) in list("/meshes").enumerate() {
        let primitives = mesh["primitives"].as_array().into_iter().flatten();
        let attributes = primitives.filter_map(|primitive| primitive["attributes"].as_object()).flatten();
        if let Some((name, accessor)) =
            attributes.into_iter().find(|(_, accessor)| accessor.as_u64() >= Some(accessors))
        {
            return Err(damaged(
                path,
                format!("mesh {index} takes its {name} from accessor {accessor} of {accessors}"),
            ));
        }
    }
    for (index, camera) in list("/cameras").enumerate() {
        if camera["type"].as_str().is_some_and(|kind| camera[kind].is_null()) {
            return Err(damaged(path, format!("camera {index} has no lens")));
        }
    }
    let nodes = list("/nodes").count() as u64;
    for (index, animation) in list("/animations").enumerate() {
        for target in animation["channels"].as_array().into_iter().flatten().map(|channel| &channel["target"]) {
            if target["node"].as_u64().is_some_and(|node| node >= nodes) {
                return Err(damaged(path, format!("animation {index} moves node {} of {nodes}", target["node"])));
            }
        }
    }
    let lights: Vec<&Json> = list("/extensions/KHR_lights_punctual/lights").collect();
    for (index, light) in lights.iter().enumerate() {
        if light["type"] == "spot" && light["spot"].is_null() {
            return Err(damaged(path, format!("light {index} is a spot without a cone")));
        }
    }
    for (index, node) in list("/nodes").enumerate() {
        let light = &node["extensions"]["KHR_lights_punctual"]["light"];
        if light.as_u64().is_some_and(|light| light >= lights.len() as u64) {
            return Err(damaged(path, format!("node {index} carries light {light} of {}", lights.len())));
        }
    }
    Ok(())
}

/// Takes out what animates something else than nodes and the weights of morph targets (materials, lights, lenses:
/// KHR_animation_pointer), as readers that do not know it are meant to; how many channels that were.
pub fn take_out_other_channels(json: &mut Json) -> usize {
    let mut count = 0;
    let moves_a_node = |channel: &Json| {
        let target = &channel["target"];
        let property = target["path"].as_str().unwrap_or("");
        target["node"].is_u64() && ["translation", "rotation", "scale", "weights"].contains(&property)
    };
    for animation in json.get_mut("animations").and_then(Json::as_array_mut).into_iter().flatten() {
        let Some(channels) = animation.get_mut("channels").and_then(Json::as_array_mut) else { continue };
        let all = channels.len();
        channels.retain(moves_a_node);
        count += all - channels.len();
    }
    count
}

fn damaged(path: &Path, what: String) -> Error {
    Error::file(path, what, "the file is truncated or damaged; export it again")
}

/// Sizes and types of what meshes are made of.
///
/// Errors: `Error::File`.
pub fn check_accessors(path: &Path, document: &gltf::Document, buffers: &[gltf::buffer::Data]) -> Result<()> {
    for view in document.views() {
        let length = buffers[view.buffer().index()].len();
        if view.offset().checked_add(view.length()).is_none_or(|end| end > length) {
            return Err(damaged(
                path,
                format!("buffer view {} ends past the {length} bytes of its buffer", view.index()),
            ));
        }
    }
    for accessor in document.accessors() {
        check_sizes(&accessor).map_err(|what| damaged(path, format!("accessor {} {what}", accessor.index())))?;
    }
    for mesh in document.meshes() {
        for primitive in mesh.primitives() {
            let attributes = primitive.attributes().map(|(semantic, accessor)| (Some(semantic), accessor));
            let targets = primitive.morph_targets().flat_map(|target| {
                [(Some(Semantic::Positions), target.positions()), (Some(Semantic::Normals), target.normals())]
            });
            let targets = targets.filter_map(|(semantic, accessor)| Some((semantic, accessor?)));
            let indices = primitive.indices().map(|accessor| (None, accessor));
            for (semantic, accessor) in attributes.chain(indices).chain(targets) {
                check_type(semantic, &accessor).map_err(|what| {
                    damaged(path, format!("mesh {}, accessor {}: {what}", mesh.index(), accessor.index()))
                })?;
            }
        }
    }
    for skin in document.skins() {
        let Some(accessor) = skin.inverse_bind_matrices() else { continue };
        let fits = accessor.count() >= skin.joints().count();
        if !is(&accessor, &[DataType::F32], Dimensions::Mat4) || !fits {
            let what = format!("skin {}, accessor {}: no matrix for each joint", skin.index(), accessor.index());
            return Err(damaged(path, what));
        }
    }
    for animation in document.animations() {
        for (index, channel) in animation.channels().enumerate() {
            let (times, values) = (channel.sampler().input(), channel.sampler().output());
            let (kinds, dimensions): (&[DataType], _) = match channel.target().property() {
                Property::Translation | Property::Scale => (&[DataType::F32], Dimensions::Vec3),
                Property::Rotation => (NORMALISED, Dimensions::Vec4),
                Property::MorphTargetWeights => (NORMALISED, Dimensions::Scalar),
            };
            if !is(&times, &[DataType::F32], Dimensions::Scalar) || !is(&values, kinds, dimensions) {
                let what = format!(
                    "animation {}, channel {index}: its times or its values are of a wrong type",
                    animation.index()
                );
                return Err(damaged(path, what));
            }
        }
    }
    Ok(())
}

/// Numbers that may stand for [-1, 1].
const NORMALISED: &[DataType] = &[DataType::F32, DataType::I8, DataType::U8, DataType::I16, DataType::U16];

fn is(accessor: &Accessor, kinds: &[DataType], dimensions: Dimensions) -> bool {
    kinds.contains(&accessor.data_type()) && accessor.dimensions() == dimensions
}

fn check_sizes(accessor: &Accessor) -> std::result::Result<(), String> {
    let holds = |what: &str, view: &gltf::buffer::View, offset: usize, count: usize, size: usize| {
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(format!("has {what} {size} bytes long, every {stride} bytes"));
        }
        let needed = (count - 1).saturating_mul(stride).saturating_add(size).saturating_add(offset);
        match needed > view.length() {
            true => Err(format!("needs {needed} bytes for its {what}, its view has {}", view.length())),
            false => Ok(()),
        }
    };
    if accessor.count() == 0 {
        return Err("is empty".into());
    }
    match accessor.view() {
        Some(view) => holds("elements", &view, accessor.offset(), accessor.count(), accessor.size())?,
        None if accessor.count() > MOST_WITHOUT_DATA => {
            return Err(format!("has {} elements and no data", accessor.count()));
        }
        None => {}
    }
    let Some(sparse) = accessor.sparse() else { return Ok(()) };
    if sparse.count() == 0 || sparse.count() > accessor.count() {
        return Err(format!("replaces {} of its {} elements", sparse.count(), accessor.count()));
    }
    let (indices, values) = (sparse.indices(), sparse.values());
    holds("indices", &indices.view(), indices.offset(), sparse.count(), indices.index_type().size())?;
    holds("replacements", &values.view(), values.offset(), sparse.count(), accessor.size())
}

/// `None` for indices.
fn check_type(semantic: Option<Semantic>, accessor: &Accessor) -> std::result::Result<(), String> {
    use DataType::{F32, U8, U16, U32};
    let (what, kinds, dimensions): (&str, &[DataType], Dimensions) = match semantic {
        Some(Semantic::Positions) => ("positions", &[F32], Dimensions::Vec3),
        Some(Semantic::Normals) => ("normals", &[F32], Dimensions::Vec3),
        Some(Semantic::TexCoords(_)) => ("texture coordinates", &[F32, U8, U16], Dimensions::Vec2),
        Some(Semantic::Joints(_)) => ("joints", &[U8, U16], Dimensions::Vec4),
        Some(Semantic::Weights(_)) => ("weights of joints", &[F32, U8, U16], Dimensions::Vec4),
        None => ("indices", &[U8, U16, U32], Dimensions::Scalar),
        // Not read.
        Some(_) => return Ok(()),
    };
    match is(accessor, kinds, dimensions) {
        true => Ok(()),
        false => Err(format!("{what} are not {:?} of {:?}", accessor.dimensions(), accessor.data_type())),
    }
}
