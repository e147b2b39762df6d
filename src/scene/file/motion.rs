//! The nodes of a glTF file as a tree, the animations that move them, and where everything is at a time.

use super::track::{Property, Track};
use crate::memo::Key;
use crate::names::chosen;
use crate::{Error, Result};
use glam::{Mat4, Quat, Vec3};
use gltf::scene::Transform;
use std::collections::HashSet;
use std::path::Path;

/// Nodes are read by recursion.
const DEEPEST: usize = 512;

/// Where a node is against its parent, when no animation says otherwise.
#[derive(Clone, Copy, Debug)]
struct Local {
    transform: Mat4,
    translation: Vec3,
    rotation: Quat,
    scale: Vec3,
}

/// What hangs on a node.
#[derive(Clone, Copy, Debug, Default)]
struct Carries {
    mesh: bool,
    light: bool,
    camera: bool,
    skin: Option<usize>,
}

#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// Nodes of the scene and their parents, parents first.
    tree: Vec<(usize, Option<usize>)>,
    /// By node, as are the two after it.
    local: Vec<Local>,
    weights: Vec<Vec<f32>>,
    carries: Vec<Carries>,
    /// Joints of each skin.
    skins: Vec<Vec<usize>>,
    /// Names, and the tracks of each, or what is wrong with one of them.
    animations: Vec<(String, std::result::Result<Vec<Track>, String>)>,
}

/// The tracks that are played.
#[derive(Clone, Debug, Default)]
pub struct Playing {
    /// Animation, and track of it.
    tracks: Vec<(usize, usize)>,
    /// First and last key, seconds.
    pub span: (f32, f32),
    pub names: Vec<String>,
    /// Animations that are not played, because one before them moves the same.
    pub left_out: Vec<String>,
}

/// Where everything is at a time.
#[derive(Clone, Debug)]
pub struct Pose {
    /// By node; of those that are not in the scene the identity.
    pub world_from_node: Vec<Mat4>,
    /// By node, of the morph targets of its mesh.
    pub weights: Vec<Vec<f32>>,
}

/// Equal keys, equal places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moments {
    pub surfaces: Key,
    pub lights: Key,
    pub cameras: Key,
}

impl Motion {
    /// Errors: nodes that form no tree or too deep a one.
    pub fn read(path: &Path, document: &gltf::Document, buffers: &[gltf::buffer::Data]) -> Result<Self> {
        let local = |node: gltf::Node| {
            let transform = Mat4::from_cols_array_2d(&node.transform().matrix());
            let (translation, rotation, scale) = match node.transform() {
                decomposed @ Transform::Decomposed { .. } => decomposed.decomposed(),
                matrix => matrix.decomposed(),
            };
            let (translation, scale) = (translation.into(), scale.into());
            Local { transform, translation, rotation: Quat::from_array(rotation), scale }
        };
        let carries = |node: gltf::Node| Carries {
            mesh: node.mesh().is_some(),
            light: node.light().is_some(),
            camera: node.camera().is_some(),
            skin: node.skin().map(|skin| skin.index()),
        };
        let mut motion = Self {
            local: document.nodes().map(local).collect(),
            weights: document.nodes().map(|node| weights(&node)).collect(),
            carries: document.nodes().map(carries).collect(),
            skins: document.skins().map(|skin| skin.joints().map(|joint| joint.index()).collect()).collect(),
            ..Self::default()
        };
        let mut walk = Walk { path, visited: vec![false; document.nodes().len()], tree: Vec::new() };
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let roots: Vec<gltf::Node> = match scene {
            Some(scene) => scene.nodes().collect(),
            None => document.nodes().collect(),
        };
        roots.iter().try_for_each(|root| walk.visit(root, None, 0))?;
        motion.tree = walk.tree;
        for animation in document.animations() {
            let name = animation.name().map_or_else(|| format!("animation_{}", animation.index()), str::to_owned);
            let tracks = animation.channels().map(|channel| {
                let node = channel.target().node();
                Track::read(&channel, buffers, motion.weights[node.index()].len()).map_err(|what| {
                    let node =
                        node.name().map_or_else(|| format!("node {}", node.index()), |name| format!("\"{name}\""));
                    format!("the {:?} of {node} in animation \"{name}\" {what}", channel.target().property())
                })
            });
            let tracks = tracks.collect();
            motion.animations.push((name, tracks));
        }
        Ok(motion)
    }

    /// Nodes of the scene, parents first.
    pub fn nodes(&self) -> impl Iterator<Item = usize> {
        self.tree.iter().map(|(node, _)| *node)
    }

    pub fn animations(&self) -> impl Iterator<Item = &str> {
        self.animations.iter().map(|(name, _)| name.as_str())
    }

    /// Those whose names match a pattern, all of them without patterns, in the order of the file. Of two that move the
    /// same property of a node, the first is played.
    ///
    /// # Errors
    /// `Compute` for a pattern that matches nothing, `File` for an animation that makes no sense.
    pub fn play(&self, path: &Path, patterns: &[String]) -> Result<Playing> {
        let names: Vec<&str> = self.animations().collect();
        let wanted = chosen("animation", patterns, &names)?;
        let mut playing = Playing { span: (f32::INFINITY, f32::NEG_INFINITY), ..Playing::default() };
        let mut moved = HashSet::new();
        for (number, (name, tracks)) in self.animations.iter().enumerate().filter(|(number, _)| wanted[*number]) {
            let tracks = tracks.as_ref().map_err(|what| {
                let help = "repair it in the program it came from, or name others in `animations`";
                Error::file(path, what.clone(), help)
            })?;
            // All of it or nothing: half a walk is no walk.
            if tracks.iter().any(|track| moved.contains(&(track.node, track.property))) {
                playing.left_out.push(name.clone());
                continue;
            }
            for (index, track) in tracks.iter().enumerate() {
                moved.insert((track.node, track.property));
                let (first, last) = track.span();
                playing.span = (playing.span.0.min(first), playing.span.1.max(last));
                playing.tracks.push((number, index));
            }
            playing.names.push(name.clone());
        }
        if playing.tracks.is_empty() {
            playing.span = (0.0, 0.0);
        }
        Ok(playing)
    }

    fn track(&self, animation: usize, track: usize) -> &Track {
        &self.animations[animation].1.as_ref().expect("only sound ones are played")[track]
    }

    /// Where all is at a time (s); lengths are multiplied by `scale`.
    pub fn pose(&self, playing: &Playing, time: f32, scale: f32) -> Pose {
        let (mut local, mut weights) = (self.local.clone(), self.weights.clone());
        let mut moved = HashSet::new();
        for (animation, track) in &playing.tracks {
            let track = self.track(*animation, *track);
            let (value, local) = (track.at(time), &mut local[track.node]);
            match track.property {
                Property::Translation => local.translation = Vec3::from_slice(&value),
                Property::Scale => local.scale = Vec3::from_slice(&value),
                Property::Rotation => local.rotation = turn(&value),
                Property::Weights => {
                    weights[track.node] = value;
                    continue;
                }
            }
            moved.insert(track.node);
        }
        for node in moved {
            let Local { translation, rotation, scale, .. } = local[node];
            local[node].transform = Mat4::from_scale_rotation_translation(scale, rotation, translation);
        }
        let mut world_from_node = vec![Mat4::IDENTITY; local.len()];
        for (node, parent) in &self.tree {
            let world = parent.map_or_else(|| Mat4::from_scale(Vec3::splat(scale)), |parent| world_from_node[parent]);
            world_from_node[*node] = world * local[*node].transform;
        }
        Pose { world_from_node, weights }
    }

    /// Whether any surface is ever elsewhere.
    pub fn moves_surfaces(&self, playing: &Playing) -> bool {
        let (first, last) = playing.span;
        // A track may hold still: what it moves is no surface then.
        !playing.tracks.is_empty() && self.tracks_of_surfaces(playing) && first < last
    }

    fn tracks_of_surfaces(&self, playing: &Playing) -> bool {
        let mut moved = vec![false; self.local.len()];
        for (animation, track) in &playing.tracks {
            moved[self.track(*animation, *track).node] = true;
        }
        // What hangs on something that moves moves, too.
        for (node, parent) in &self.tree {
            moved[*node] |= parent.is_some_and(|parent| moved[parent]);
        }
        let bends = |skin: usize| self.skins[skin].iter().any(|joint| moved[*joint]);
        self.nodes().any(|node| {
            let Carries { mesh, skin, .. } = self.carries[node];
            mesh && (moved[node] || skin.is_some_and(bends))
        })
    }

    /// Names where all surfaces, lights and cameras are.
    pub fn moments(&self, pose: &Pose) -> Moments {
        let of = |wanted: &dyn Fn(&Carries) -> bool, deforms: bool| {
            let mut hasher = blake3::Hasher::new();
            let mut place = |node: usize| {
                hasher.update(bytemuck::cast_slice(&pose.world_from_node[node].to_cols_array()));
            };
            for node in self.nodes().filter(|node| wanted(&self.carries[*node])) {
                place(node);
                if let Some(skin) = self.carries[node].skin.filter(|_| deforms) {
                    self.skins[skin].iter().for_each(|joint| place(*joint));
                }
            }
            if deforms {
                hasher.update(bytemuck::cast_slice(&pose.weights.concat()));
            }
            Key::of(&[hasher.finalize().as_bytes()])
        };
        Moments {
            surfaces: of(&|carries| carries.mesh, true),
            lights: of(&|carries| carries.light, false),
            cameras: of(&|carries| carries.camera, false),
        }
    }

    pub fn bytes(&self) -> u64 {
        let tracks = self.animations.iter().flat_map(|(_, tracks)| tracks).flatten();
        tracks.map(Track::bytes).sum::<u64>() + 256 * self.local.len() as u64
    }
}

/// A spline may pass through no direction at all.
fn turn(value: &[f32]) -> Quat {
    let turn = Quat::from_slice(value);
    if turn.length_squared() > 1e-12 { turn.normalize() } else { Quat::IDENTITY }
}

/// Of the morph targets of a node's mesh: the node's, the mesh's, or 0.
fn weights(node: &gltf::Node) -> Vec<f32> {
    let Some(mesh) = node.mesh() else { return Vec::new() };
    let targets = mesh.primitives().map(|primitive| primitive.morph_targets().count()).max().unwrap_or(0);
    let mut weights = node.weights().or(mesh.weights()).map(<[f32]>::to_vec).unwrap_or_default();
    weights.resize(targets, 0.0);
    weights
}

struct Walk<'a> {
    path: &'a Path,
    /// Nodes that have been met: each has one parent at most.
    visited: Vec<bool>,
    tree: Vec<(usize, Option<usize>)>,
}

impl Walk<'_> {
    fn visit(&mut self, node: &gltf::Node, parent: Option<usize>, depth: usize) -> Result<()> {
        if depth > DEEPEST {
            let found = format!("nodes are nested more than {DEEPEST} deep");
            return Err(Error::file(self.path, found, "flatten the scene, and export it again"));
        }
        if std::mem::replace(&mut self.visited[node.index()], true) {
            let found = format!("node {} is reached twice: nodes must form trees", node.index());
            return Err(Error::file(self.path, found, "export it again as glTF 2.0"));
        }
        self.tree.push((node.index(), parent));
        node.children().try_for_each(|child| self.visit(&child, Some(node.index()), depth + 1))
    }
}
