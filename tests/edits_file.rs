//! The file of sampled edits: what is written is what is read, here and in Python; whatever is damaged is refused.

#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/sampled.rs"]
mod made_up;
#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/room.rs"]
mod room;

use chiaro::device::Device;
use chiaro::transport::sampled::apply::{Plan, Slots, irradiance};
use chiaro::transport::sampled::{self, Sampled};
use chiaro::transport::{SparseRows, Transfer};
use chiaro::value::Value;
use made_up::{everything, random, untouched};
use serde_json::{Value as Json, json};
use std::f32::consts::FRAC_1_PI;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Arc, LazyLock};

struct Room {
    transfer: Arc<Transfer>,
    all: Sampled,
    none: Sampled,
    /// `all`, as it is written.
    bytes: Vec<u8>,
}

static ROOM: LazyLock<Room> = LazyLock::new(|| {
    let plan = room::recipe(json!({
        "view": { "type": "view_samples", "params": { "width": 32, "height": 24 }, "inputs": { "scene": "room" } },
        "transport": {
            "type": "transfer", "params": { "gather_samples": 512, "tolerance": 0.1 },
            "inputs": { "scene": "room", "samples": "view" },
        },
    }));
    let evaluator = room::evaluator();
    let (Value::Scene(scene), _) = room::evaluate(&evaluator, &plan, "room", 1) else { panic!("a scene") };
    let (Value::Transfer(transfer), _) = room::evaluate(&evaluator, &plan, "transport", 1) else {
        panic!("a transfer")
    };
    let [all, none] = [everything, untouched].map(|make| Sampled::new(make(&scene.geometry, &transfer)).unwrap());
    let folder = tempfile::tempdir().unwrap();
    sampled::write(&folder.path().join("all"), &all).unwrap();
    let bytes = std::fs::read(folder.path().join("all")).unwrap();
    Room { transfer, all, none, bytes }
});

fn read_bytes(folder: &Path, bytes: &[u8]) -> chiaro::Result<Sampled> {
    let path = folder.join("trial.edits");
    std::fs::write(&path, bytes).unwrap();
    sampled::read(&path)
}

fn bits(rows: &SparseRows) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    (rows.offsets().to_vec(), rows.entries().to_vec(), rows.scale().iter().map(|x| x.to_bits()).collect())
}

#[test]
fn what_is_read_is_what_was_written_bit_by_bit() {
    let folder = tempfile::tempdir().unwrap();
    for (name, sampled) in [("all", &ROOM.all), ("none", &ROOM.none)] {
        let [first, again] = ["first", "again"].map(|when| folder.path().join(format!("{name}.{when}")));
        let size = sampled::write(&first, sampled).unwrap();
        let found = sampled::read(&first).unwrap();
        // Of all parts; and, so that the digest itself is not all there is to it, of some.
        assert_eq!(found.digest(), sampled.digest());
        assert_eq!(found.origin, sampled.origin);
        assert_eq!(found.slots[..], sampled.slots[..]);
        assert_eq!(bits(&found.scales), bits(&sampled.scales));
        assert_eq!(found.offsets.as_ref().map(bits), sampled.offsets.as_ref().map(bits));
        let vector = |s: &Sampled| s.eye.offset.as_ref().map(|v| v.to_vec());
        assert_eq!(vector(&found), vector(sampled));
        sampled::write(&again, &found).unwrap();
        let bytes = std::fs::read(&first).unwrap();
        assert_eq!(bytes, std::fs::read(&again).unwrap());
        assert_eq!(bytes.len() as u64, size);
    }
    let error = sampled::write(&folder.path().join("no/such/folder"), &ROOM.none).unwrap_err();
    assert_eq!(error.exit_code(), 1);
}

/// The file with another header, checksums made to fit; `change` gets the header and the bytes of the sections.
fn forged(change: impl FnOnce(&mut Json, &mut Vec<u8>)) -> Vec<u8> {
    let bytes = &ROOM.bytes;
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut header: Json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let mut body = bytes[(20 + length).next_multiple_of(64)..].to_vec();
    change(&mut header, &mut body);
    for section in header["sections"].as_array_mut().unwrap() {
        let range = section["offset"].as_u64().unwrap() as usize..;
        if let Some(content) = body.get(range).and_then(|rest| rest.get(..section["bytes"].as_u64().unwrap() as usize))
        {
            section["crc32"] = crc32fast::hash(content).into();
        }
    }
    let header = serde_json::to_vec(&header).unwrap();
    let mut forged = [&bytes[..12], &(header.len() as u32).to_le_bytes()].concat();
    let checksum = crc32fast::hash(&[&forged[..], &header].concat());
    forged.extend(checksum.to_le_bytes());
    forged.extend(&header);
    forged.resize(forged.len().next_multiple_of(64), 0);
    forged.extend(body);
    forged
}

fn section<'a>(header: &'a mut Json, name: &str) -> &'a mut Json {
    header["sections"].as_array_mut().unwrap().iter_mut().find(|section| section["name"] == name).unwrap()
}

/// Puts a word into a section.
fn poke(header: &mut Json, body: &mut [u8], name: &str, at: usize, word: u32) {
    let first = section(header, name)["offset"].as_u64().unwrap() as usize + 4 * at;
    body[first..first + 4].copy_from_slice(&word.to_le_bytes());
}

#[test]
fn a_forged_file_is_refused_with_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let same = forged(|_, _| {});
    assert!(same == ROOM.bytes && read_bytes(folder.path(), &same).is_ok(), "the forger can write a good one");
    type Change = fn(&mut Json, &mut Vec<u8>);
    let changes: &[(&str, Change)] = &[
        ("cannot hold shape", |h, _| section(h, "touched")["shape"][0] = json!(1u64 << 62)),
        ("cannot hold shape", |h, _| section(h, "touched")["bytes"] = json!(u64::MAX - 3)),
        ("cannot hold shape", |h, _| section(h, "slots")["shape"] = json!([4294967296u64, 4294967296u64])),
        ("cannot hold shape", |h, _| section(h, "slots")["shape"] = json!([])),
        ("begins at", |h, _| section(h, "touched")["offset"] = json!(0)),
        ("begins at", |h, _| section(h, "touched")["offset"] = json!(u64::MAX)),
        ("long; its header says", |_, body| body.push(0)),
        ("section \"offset.step\" is missing", |h, body| {
            let last = h["sections"].as_array_mut().unwrap().pop().unwrap();
            let end =
                |section: &Json| (section["offset"].as_u64().unwrap() + section["bytes"].as_u64().unwrap()) as usize;
            body.truncate(end(h["sections"].as_array().unwrap().last().unwrap()));
            assert_eq!(last["name"], "offset.step");
        }),
        ("expected \"view.position\"", |h, _| section(h, "view.position")["name"] = json!("view.place")),
        ("is of u32", |h, _| section(h, "view.position")["type"] = json!("u32")),
        ("unknown variant", |h, _| section(h, "view.position")["type"] = json!("f64")),
        ("unknown field", |h, _| h["comment"] = json!("hello")),
        ("missing field `origin`", |h, _| _ = h.as_object_mut().unwrap().remove("origin")),
        ("expected a power of two", |h, _| h["origin"]["gather_samples"] = json!(1u64 << 40)),
        ("gather.side: 512 elements, expected 1024", |h, _| h["origin"]["gather_samples"] = json!(1024)),
        ("expected 1 to 2^31", |h, _| h["origin"]["width"] = json!(1u64 << 40)),
        ("view.side: 768 elements", |h, _| h["origin"]["height"] = json!(25)),
        ("view sample 3 is on side 4294967294", |h, b| poke(h, b, "view.side", 3, u32::MAX - 1)),
        ("view.barycentrics: element 1 is", |h, b| poke(h, b, "view.barycentrics", 2, f32::NAN.to_bits())),
        ("gather sample 7 is on side 4294967295", |h, b| poke(h, b, "gather.side", 7, u32::MAX)),
        ("view.normal: element 2 is", |h, b| poke(h, b, "view.normal", 6, f32::NAN.to_bits())),
        ("source.scale: element 1 is", |h, b| poke(h, b, "source.scale", 4, f32::INFINITY.to_bits())),
        ("weights: element 0 is", |h, b| poke(h, b, "weights", 3, f32::NEG_INFINITY.to_bits())),
        ("slots of view sample", |h, b| poke(h, b, "slots", 1, 12)),
        ("touched: view sample", |h, b| poke(h, b, "touched", 1, 767)),
        ("the scale of row 2 is NaN", |h, b| poke(h, b, "scale.step", 2, f32::NAN.to_bits())),
        ("offsets run from 1 to", |h, b| poke(h, b, "scale.starts", 0, 1)),
        ("ends before it starts", |h, b| poke(h, b, "offset.starts", 1, u32::MAX)),
        ("are not in order", |h, b| poke(h, b, "offset.entries", 0, u32::MAX)),
    ];
    for (number, (words, change)) in changes.iter().enumerate() {
        let error = read_bytes(folder.path(), &forged(change)).expect_err(words);
        let message = error.to_string();
        assert!(message.contains(words), "change {number}: \"{words}\" not in: {message}");
        assert!(error.exit_code() == 3 && message.contains("trial.edits") && !error.help().is_empty(), "{message}");
    }
}

#[test]
fn other_files_and_newer_versions_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let mut newer = ROOM.bytes.clone();
    newer[8] = 4;
    let mut older = ROOM.bytes.clone();
    older[8] = 2;
    let mut text_mode = ROOM.bytes.clone();
    text_mode.remove(6);
    for (bytes, words, help) in [
        (&newer[..], "version 4 of sampled edits; this program reads version 3", "newer chiaro"),
        (&older, "version 2 of sampled edits; this program reads version 3", "write the edits anew"),
        (&text_mode, "no file of sampled edits", "read_edits"),
        (b"\x89PNG\r\n\x1a\n and so on and on", "no file of sampled edits", "read_image"),
        (b"", "0 bytes are too few", "write_edits"),
    ] {
        let error = read_bytes(folder.path(), bytes).unwrap_err();
        assert!(error.to_string().contains(words) && error.help().contains(help), "{error}; {}", error.help());
        assert_eq!(error.exit_code(), 3);
    }
    for path in [folder.path().join("none"), folder.path().to_owned()] {
        assert_eq!(sampled::read(&path).unwrap_err().exit_code(), 3);
    }
}

/// Every flip is refused, but in the few bytes between sections, which mean nothing; every shorter file is refused.
#[test]
fn flipped_bits_and_cut_ends_are_refused() {
    let (folder, whole) = (tempfile::tempdir().unwrap(), &ROOM.bytes);
    let mut equal = 0;
    let places = (0..2000).step_by(2).chain((2000..whole.len()).step_by(151));
    for at in places {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        match read_bytes(folder.path(), &bytes) {
            Err(error) => assert_eq!(error.exit_code(), 3, "byte {at}: {error}"),
            Ok(sampled) => {
                assert_eq!(sampled.digest(), ROOM.all.digest(), "byte {at}");
                equal += 1;
            }
        }
    }
    assert!(equal < 100, "{equal} flips went unseen");
    for length in (0..200).chain((200..whole.len()).step_by(997)).chain([whole.len() - 1]) {
        let error = read_bytes(folder.path(), &whole[..length]).expect_err("a cut file");
        assert_eq!(error.exit_code(), 3, "{length} bytes: {error}");
    }
    // Random bytes behind a good beginning.
    for seed in 0..500u32 {
        let keep = (random(seed) * 4000.0) as usize;
        let noise = (0..1000).map(|i| (random(seed * 1000 + i) * 256.0) as u8);
        let bytes: Vec<u8> = whole[..keep].iter().copied().chain(noise).collect();
        assert_eq!(read_bytes(folder.path(), &bytes).expect_err("noise").exit_code(), 3);
    }
}

fn chiaro(folder: &Path, recipe: Json) -> Output {
    std::fs::write(folder.join("recipe.json"), recipe.to_string()).unwrap();
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("chiaro"));
    command.env_remove("CHIARO_LOG").env("NO_COLOR", "1").arg("render").arg(folder.join("recipe.json"));
    command.args(["--device", "cpu", "--no-cache", "--progress", "none"]).output().unwrap()
}

#[test]
fn nodes_read_and_write_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("a.0001.edits"), &ROOM.bytes).unwrap();
    let copy = |from: Json, write: &str| {
        json!({ "chiaro": 1, "nodes": {
            "room": { "type": "scene" },
            "change": { "type": "caster_receiver", "params": { "brightness": 2.0 } },
            "nothing": { "type": "caster_receiver" },
            "file": from,
            "out": { "type": "write_edits", "params": { "file": "made/b.####.edits" }, "inputs": { "edits": write } },
        }})
    };
    let file = |name: &str, before: Option<&str>| {
        let mut node = json!({ "type": "read_edits", "params": { "file": name } });
        before.iter().for_each(|before| node["inputs"] = json!({ "edits": before }));
        node
    };
    let good = chiaro(folder.path(), copy(file("a.####.edits", None), "file"));
    assert_eq!(good.status.code(), Some(0), "{}", String::from_utf8_lossy(&good.stderr));
    assert_eq!(std::fs::read(path("made/b.0001.edits")).unwrap(), ROOM.bytes, "the program copies it bit by bit");

    let mut damaged = ROOM.bytes.clone();
    *damaged.last_mut().unwrap() ^= 1;
    std::fs::write(path("damaged.edits"), damaged).unwrap();
    let good = || file("a.####.edits", None);
    for (recipe, code, words) in [
        (copy(file("damaged.edits", None), "file"), 3, &["damaged.edits", "checksum of section", "help:"][..]),
        (copy(file("none.edits", None), "file"), 3, &["none.edits"]),
        (copy(good(), "change"), 1, &["one sampled edit", "1 edits, 0 of them sampled", "scale_offset"]),
        (copy(good(), "nothing"), 1, &["no edit at all"]),
        (copy(file("a.####.edits", Some("change")), "file"), 1, &["2 edits, 1 of them sampled"]),
    ] {
        let output = chiaro(folder.path(), recipe);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{words:?} not in: {message}");
        assert_eq!(std::fs::read(path("made/b.0001.edits")).unwrap(), ROOM.bytes, "the old file was touched");
    }
}

#[test]
fn the_key_of_read_edits_is_the_content_of_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let key = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let node = json!({ "type": "read_edits", "params": { "file": path.to_str().unwrap() } });
        room::keyed(&room::recipe(json!({ "file": node })), "file", 1).outputs
    };
    let first = key("a", &ROOM.bytes);
    let mut other = ROOM.bytes.clone();
    other[5000] ^= 1;
    assert_ne!(first, key("a", &other));
    assert_eq!(first, key("a", &ROOM.bytes));
}

fn python(arguments: &[&Path]) -> std::io::Result<Output> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_edits.py");
    Command::new("python3").arg(script).args(arguments).output()
}

#[test]
fn another_language_gets_our_number() {
    if let Err(error) = Command::new("python3").arg("--version").output() {
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), "\nSKIPPED: reading sampled edits in Python: no python3 ({error})");
        return;
    }
    let Room { transfer, all, bytes, .. } = &*ROOM;
    let folder = tempfile::tempdir().unwrap();
    let [edits, damaged, pixel]: [PathBuf; 3] =
        ["a.edits", "damaged.edits", "pixel.json"].map(|name| folder.path().join(name));
    std::fs::write(&edits, bytes).unwrap();

    let exitance: Vec<[f32; 4]> =
        (0..512u32).map(|g| [0.5 + random(g), 1.0 + random(g + 1000), 2.0 * random(g + 2000), 1.0]).collect();
    let mut edited = exitance.clone();
    all.source.apply(&mut edited, 1);
    let plan = Plan::new(&Slots::diffuse(all, transfer), transfer).unwrap();
    let arriving = irradiance(&Device::Cpu, transfer, all, &plan, &edited, 1).unwrap();
    let reflectance = [0.5, 0.3, 0.8];
    let mut leaving: Vec<[f32; 4]> = arriving
        .iter()
        .map(|e| [0, 1, 2, 3].map(|c| if c < 3 { reflectance[c] * e[c] * FRAC_1_PI } else { 1.0 }))
        .collect();
    all.eye.apply(&mut leaving, 1);

    let is_touched = |v: u32| all.touched.binary_search(&v).is_ok();
    let seen: Vec<u32> = (0..768).filter(|v| transfer.weights[*v as usize][1] > 0.0).collect();
    let touched: Vec<u32> = seen.iter().copied().filter(|v| is_touched(*v)).step_by(5).take(6).collect();
    let other = seen.iter().copied().find(|v| !is_touched(*v)).unwrap();
    assert!(touched.len() == 6 && touched.iter().any(|v| v % 2 == 1), "soft slots are among them");
    let ask = |v: u32, brighter: f32| -> Json {
        let (rows, weights) = (transfer.indices[v as usize], transfer.weights[v as usize]);
        let row = |j: usize| transfer.rows.row(rows[j] as usize).collect::<Vec<(usize, f32)>>();
        let light: Vec<[f32; 3]> = exitance.iter().map(|b| [b[0] * brighter, b[1], b[2]]).collect();
        let content = json!({
            "sample": v, "exitance": light, "reflectance": reflectance,
            "transfer": (0..4).map(|j| json!([weights[j], row(j)])).collect::<Vec<_>>(),
        });
        std::fs::write(&pixel, content.to_string()).unwrap();
        let output = python(&[&edits, &pixel]).unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let off = |found: &Json, ours: [f32; 4]| -> f64 {
        let pair = |c: usize| (found[c].as_f64().unwrap(), f64::from(ours[c]));
        (0..3).map(pair).map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max)
    };
    for v in touched.iter().copied().chain([other]) {
        let found = ask(v, 1.0);
        let (e, l) = (arriving[v as usize], leaving[v as usize]);
        assert!(off(&found["irradiance"], e) < 1e-5, "sample {v}: Python {}, ours {e:?}", found["irradiance"]);
        assert!(off(&found["radiance"], l) < 1e-5, "sample {v}: Python {}, ours {l:?}", found["radiance"]);
    }
    // The comparison can fail, and the reader notices damage.
    assert!(off(&ask(touched[0], 1.001)["irradiance"], arriving[touched[0] as usize]) > 1e-4);
    for at in [9, 30, bytes.len() - 1] {
        let mut bytes = bytes.clone();
        bytes[at] ^= 4;
        std::fs::write(&damaged, bytes).unwrap();
        assert!(!python(&[&damaged, &pixel]).unwrap().status.success(), "byte {at}");
    }
}
