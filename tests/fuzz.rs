//! Spoiled files through the readers: an error or a result, never a panic. Seeds are fixed, so that a failure comes again;
//! it names the round.

#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/glb.rs"]
mod glb;

use chiaro::graph::{Document, Plan};
use chiaro::image::{Content, Image, Layer, exr_write, load, png};
use chiaro::scene::file;
use chiaro::{Error, nodes};
use glb::Glb;
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use serde_json::{Value as Json, json};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

struct Dice(TestRng);

impl Dice {
    fn new() -> Self {
        Self(TestRng::deterministic_rng(RngAlgorithm::ChaCha))
    }

    fn below(&mut self, end: usize) -> usize {
        (self.0.next_u64() % end.max(1) as u64) as usize
    }

    /// A few bytes changed, a stretch taken out or doubled, or the end cut off.
    fn spoil(&mut self, good: &[u8]) -> Vec<u8> {
        let mut bytes = good.to_vec();
        match self.below(8) {
            0 => bytes.truncate(self.below(good.len())),
            1 => {
                let from = self.below(good.len());
                bytes.drain(from..(from + 1 + self.below(16)).min(good.len()));
            }
            2 => {
                let from = self.below(good.len());
                let again = good[from..(from + 1 + self.below(16)).min(good.len())].to_vec();
                bytes.splice(from..from, again);
            }
            _ => {
                for _ in 0..1 + self.below(4) {
                    let at = self.below(good.len());
                    bytes[at] = match self.below(4) {
                        0 => bytes[at] ^ (1 << self.below(8)),
                        1 => b"0129[]{}\",:-e"[self.below(13)],
                        2 => [0x00, 0x7f, 0x80, 0xff][self.below(4)],
                        _ => self.below(256) as u8,
                    };
                }
            }
        }
        bytes
    }

    /// A value somewhere inside replaced by a strange one, or taken out.
    fn spoil_json(&mut self, json: &mut Json) {
        let mut pointers = Vec::new();
        collect(json, String::new(), &mut pointers);
        let pointer = &pointers[self.below(pointers.len())];
        let strange = [
            json!(null),
            json!(-1),
            json!(0),
            json!(1),
            json!(2),
            json!(5),
            json!(255),
            json!(65535),
            json!(4294967295u32),
            json!(1u64 << 40),
            json!(u64::MAX),
            json!(0.5),
            json!(1e39),
            json!(-1e-40),
            json!(5120),
            json!(5121),
            json!(5122),
            json!(5123),
            json!(5125),
            json!(5126),
            json!(""),
            json!("VEC2"),
            json!("VEC4"),
            json!("SCALAR"),
            json!("MAT4"),
            json!("%ff"),
            json!("data:;base64,AAAA"),
            json!("spot"),
            json!("directional"),
            json!("orthographic"),
            json!([]),
            json!({}),
            json!([0, 0]),
            json!(true),
        ];
        let (parent, last) = pointer.rsplit_once('/').unwrap();
        let value = strange[self.below(strange.len())].clone();
        match json.pointer_mut(parent).unwrap() {
            Json::Object(object) if self.below(4) == 0 => drop(object.remove(last)),
            Json::Object(object) => drop(object.insert(last.to_owned(), value)),
            Json::Array(list) => list[last.parse::<usize>().unwrap()] = value,
            _ => unreachable!("only these have parts"),
        }
    }
}

fn collect(json: &Json, pointer: String, into: &mut Vec<String>) {
    let mut add = |name: &str, value: &Json| {
        let inside = format!("{pointer}/{}", name.replace('~', "~0").replace('/', "~1"));
        into.push(inside.clone());
        collect(value, inside, into);
    };
    match json {
        Json::Object(object) => object.iter().for_each(|(name, value)| add(name, value)),
        Json::Array(list) => list.iter().enumerate().for_each(|(index, value)| add(&index.to_string(), value)),
        _ => {}
    }
}

/// Counts what was taken and what was refused; both must happen, or nothing was tried.
#[derive(Debug, Default)]
struct Tally {
    taken: usize,
    refused: usize,
}

impl Tally {
    fn note<T>(&mut self, what: &str, round: usize, codes: &[u8], act: impl FnOnce() -> Result<T, Error>) {
        let result = catch_unwind(AssertUnwindSafe(act)).unwrap_or_else(|_| panic!("{what}: panic in round {round}"));
        match result {
            Ok(_) => self.taken += 1,
            Err(error) => {
                assert!(codes.contains(&error.exit_code()), "{what}, round {round}: {error}");
                self.refused += 1;
            }
        }
    }

    fn done(self) {
        assert!(self.taken > 10 && self.refused > 10, "{self:?}");
    }
}

#[test]
fn spoiled_bytes_of_a_scene() {
    let (mut dice, mut tally) = (Dice::new(), Tally::default());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.glb");
    let good = Glb::room().bytes();
    for round in 0..4000 {
        std::fs::write(&path, dice.spoil(&good)).unwrap();
        tally.note("bytes of a scene", round, &[3], || file::read(&path, 1.0));
        file::dependencies(&path);
    }
    tally.done();
}

#[test]
fn strange_values_in_a_scene() {
    let (mut dice, mut tally) = (Dice::new(), Tally::default());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.glb");
    let sparse =
        json!({ "count": 1, "indices": { "bufferView": 1, "componentType": 5123 }, "values": { "bufferView": 0 } });
    for round in 0..6000 {
        let mut glb = Glb::room();
        if round % 2 == 0 {
            glb = glb.set("/accessors/0/sparse", sparse.clone());
        }
        for _ in 0..1 + dice.below(2) {
            dice.spoil_json(&mut glb.json);
        }
        std::fs::write(&path, glb.bytes()).unwrap();
        tally.note("values in a scene", round, &[3], || file::read(&path, 1.0));
        file::dependencies(&path);
    }
    tally.done();
}

#[test]
fn spoiled_recipes() {
    let (mut dice, mut tally) = (Dice::new(), Tally::default());
    let good = include_str!("../graphs/room_bleed.json");
    let path = Path::new("room_bleed.json");
    for round in 0..4000 {
        let text = String::from_utf8_lossy(&dice.spoil(good.as_bytes())).into_owned();
        tally.note("bytes of a recipe", round, &[2], || Plan::new(&Document::parse(path, &text)?, nodes::ALL));
        let mut json: Json = serde_json::from_str(good).unwrap();
        dice.spoil_json(&mut json);
        let text = json.to_string();
        tally.note("values in a recipe", round, &[2], || Plan::new(&Document::parse(path, &text)?, nodes::ALL));
    }
    tally.done();
}

#[test]
fn spoiled_pictures() {
    let (mut dice, mut tally) = (Dice::new(), Tally::default());
    let folder = tempfile::tempdir().unwrap();
    let layer = Layer::new("", &["R", "G", "B"], Content::Colour, (0..36).map(|x| x as f32 / 36.0).collect());
    let image = Image { width: 4, height: 3, layers: vec![layer.clone()], ..Image::default() };
    for name in ["a.exr", "a.png", "a.hdr", "a.jpg"] {
        let path = folder.path().join(name);
        match name {
            "a.exr" => drop(exr_write::write(&path, &image, exr_write::Depth::Half, &[]).unwrap()),
            "a.png" => drop(png::write(&path, &layer, 4).unwrap()),
            "a.hdr" => image::Rgb32FImage::from_pixel(4, 3, image::Rgb([0.5, 2.0, 0.25])).save(&path).unwrap(),
            _ => image::RgbImage::from_pixel(4, 3, image::Rgb([9, 99, 199])).save(&path).unwrap(),
        }
        let good = std::fs::read(&path).unwrap();
        for round in 0..1500 {
            std::fs::write(&path, dice.spoil(&good)).unwrap();
            tally.note(name, round, &[3], || load::load(&path, None));
        }
    }
    tally.done();
}
