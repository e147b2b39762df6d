//! A real window on a screen of its own, driven by the mouse and the keys of another program, from opening to saving.
//!
//! Needs Xvfb and xdotool, which `.ci/run` installs, and a driver to draw with (software will do). Where things lie is
//! asked of the same window without a screen: it is as large.

use super::desk::Desk;
use assert_cmd::cargo::cargo_bin;
use chiaro::editor::develop::{Settings, develop};
use chiaro::editor::shown::{LastMask, Parts, Shown};
use chiaro::image::exr_read;
use chiaro::value::Value;
use egui::Pos2;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The room, with a file to be written; nothing is edited yet.
const RECIPE: &str = r#"{ "chiaro": 1, "nodes": {
    "room": { "type": "scene", "params": { "file": "builtin:room" } },
    "view": { "type": "view_samples", "params": { "width": 320, "height": 240 }, "inputs": { "scene": "room" } },
    "way": {
        "type": "transfer", "params": { "gather_samples": 4096, "tolerance": 0.05 },
        "inputs": { "scene": "room", "samples": "view" }
    },
    "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "way" } },
    "exr": { "type": "write_image", "params": { "file": "out.exr", "depth": "float" }, "inputs": { "image": "lit" } }
}, "layout": { "room": [0, 0], "view": [220, 0], "way": [440, 0], "lit": [700, 60], "exr": [940, 60] } }"#;

/// A screen without a monitor, and a program on it.
struct Screen {
    server: Child,
    program: Child,
    display: String,
    folder: tempfile::TempDir,
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = (self.program.kill(), self.server.kill());
        let _ = (self.program.wait(), self.server.wait());
    }
}

fn is_there(program: &str) -> bool {
    Command::new(program).arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

impl Screen {
    fn open(file: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1440x900x24", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        let mut byte = [0];
        let out = server.stdout.as_mut().unwrap();
        while out.read(&mut byte).unwrap() == 1 && byte[0] != b'\n' {
            number.push(byte[0] as char);
        }
        let display = format!(":{number}");
        let program = Command::new(cargo_bin("chiaro"))
            .arg("edit")
            .arg(file)
            .args(["--no-cache", "--device", "cpu", "--folder"])
            .arg(folder.path().join("editor"))
            .env("DISPLAY", &display)
            .env("XDG_RUNTIME_DIR", folder.path())
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("VK_DRIVER_FILES")
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self { server, program, display, folder }
    }

    fn tool(&self, words: &[&str]) {
        let status = Command::new("xdotool").args(words).env("DISPLAY", &self.display).status().unwrap();
        assert!(status.success(), "xdotool {words:?}");
    }

    fn go(&self, at: Pos2) {
        self.tool(&["mousemove", &(at.x as i32).to_string(), &(at.y as i32).to_string()]);
        std::thread::sleep(Duration::from_millis(80));
    }

    fn click(&self, at: Pos2) {
        self.go(at);
        self.tool(&["click", "1"]);
        std::thread::sleep(Duration::from_millis(200));
    }

    fn drag(&mut self, from: Pos2, to: Pos2) {
        self.go(from);
        // What lies under the pointer is found when the window draws: a press before that would miss it.
        self.settled();
        self.tool(&["mousedown", "1"]);
        std::thread::sleep(Duration::from_millis(500));
        for step in 1..=10 {
            self.go(from + (to - from) * (step as f32 / 10.0));
        }
        self.tool(&["mouseup", "1"]);
        std::thread::sleep(Duration::from_millis(200));
    }

    fn key(&self, key: &str) {
        self.tool(&["key", key]);
        std::thread::sleep(Duration::from_millis(200));
    }

    fn write(&self, text: &str) {
        self.tool(&["type", "--delay", "30", text]);
        std::thread::sleep(Duration::from_millis(200));
    }

    /// What the screen shows: the server's memory is a file in the format of xwd.
    fn picture(&self) -> image::RgbImage {
        let bytes = std::fs::read(self.folder.path().join("Xvfb_screen0")).unwrap();
        let word = |i: usize| u32::from_be_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap()) as usize;
        let (header, width, height, stride, colours) = (word(0), word(4), word(5), word(12), word(19));
        let start = header + 12 * colours;
        image::RgbImage::from_fn(width as u32, height as u32, |x, y| {
            let at = start + y as usize * stride + 4 * x as usize;
            image::Rgb([bytes[at + 2], bytes[at + 1], bytes[at]])
        })
    }

    /// At rest, once a part of it is no longer as it was.
    fn changed(&mut self, before: &image::RgbImage, rect: egui::Rect, why: &str) -> image::RgbImage {
        let start = Instant::now();
        loop {
            let now = self.settled();
            if part(&now, rect) != part(before, rect) {
                return now;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "{why}");
        }
    }

    /// Until the screen has not changed for a second.
    fn settled(&mut self) -> image::RgbImage {
        let (start, mut since, mut last) = (Instant::now(), Instant::now(), self.picture());
        while since.elapsed() < Duration::from_millis(1200) {
            assert!(start.elapsed() < Duration::from_secs(180), "the window does not come to rest");
            if let Some(status) = self.program.try_wait().unwrap() {
                let mut said = String::new();
                self.program.stderr.take().unwrap().read_to_string(&mut said).unwrap();
                panic!("the editor has ended: {status}\n{said}");
            }
            std::thread::sleep(Duration::from_millis(100));
            let now = self.picture();
            if now != last {
                (since, last) = (Instant::now(), now);
            }
        }
        last
    }
}

fn part(image: &image::RgbImage, rect: egui::Rect) -> image::RgbImage {
    let (x, y, width, height) = (rect.min.x as u32, rect.min.y as u32, rect.width() as u32, rect.height() as u32);
    image::imageops::crop_imm(image, x, y, width, height).to_image()
}

/// What the viewer makes of a rendered file.
fn as_shown(file: &Path) -> image::RgbImage {
    let picture = exr_read::read(file).unwrap();
    let shown = Shown::new(
        Parts { picture: Some(Value::Image(Arc::new(picture))), ..Parts::default() },
        &mut LastMask::default(),
    )
    .unwrap();
    let pixels = develop(&shown, &Settings::default()).picture;
    image::RgbImage::from_fn(pixels.width as u32, pixels.height as u32, |x, y| {
        let [r, g, b, _] = pixels.data[y as usize * pixels.width + x as usize];
        image::Rgb([r, g, b])
    })
}

/// Part of the pixels that differ by more than a level or two, at the best of a few places: the window puts pictures
/// between pixels.
fn difference(screen: &image::RgbImage, at: Pos2, picture: &image::RgbImage) -> f64 {
    let share = |dx: i64, dy: i64| {
        let (mut off, mut all) = (0, 0);
        for (x, y, pixel) in picture.enumerate_pixels() {
            let (sx, sy) = (at.x as i64 + dx + i64::from(x), at.y as i64 + dy + i64::from(y));
            let Some(shown) = screen.get_pixel_checked(sx as u32, sy as u32) else { continue };
            all += 1;
            off += usize::from(pixel.0.iter().zip(shown.0).any(|(a, b)| a.abs_diff(b) > 2));
        }
        off as f64 / f64::from(all.max(1))
    };
    (-2..=2).flat_map(|dx| (-2..=2).map(move |dy| share(dx, dy))).fold(1.0, f64::min)
}

#[test]
fn from_opening_to_saving_in_a_real_window() {
    if cfg!(not(target_os = "linux")) || !is_there("Xvfb") || !is_there("xdotool") {
        println!("skipped: no Xvfb or no xdotool");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file: PathBuf = folder.path().join("recipe.json");
    std::fs::write(&file, RECIPE).unwrap();
    // Where things lie.
    let mut map = Desk::with(RECIPE);
    map.settle();
    let skip = map.at("Skip");
    map.click("Skip");
    let pane = map.rect("picture");

    let mut screen = Screen::open(&file);
    let start = Instant::now();
    while screen.settled().pixels().all(|pixel| pixel.0 == [0; 3]) {
        assert!(start.elapsed() < Duration::from_secs(120), "no window opens");
    }
    screen.tool(&["search", "--sync", "--name", "chiaro", "windowfocus"]);
    screen.click(skip);
    let opened = screen.settled();

    // A node is added,
    let empty = map.within("node way", 0.5, 2.2);
    screen.go(empty);
    screen.key("Tab");
    screen.write("caster_rec");
    screen.key("Return");
    screen.settled();
    map.hover(empty);
    map.key(egui::Modifiers::NONE, egui::Key::Tab);
    map.text("caster_rec");
    map.key(egui::Modifiers::NONE, egui::Key::Enter);
    map.settle();
    // connected,
    screen.drag(map.at("output edits of caster_receiver"), map.at("input edits of lit"));
    map.drag(map.at("output edits of caster_receiver"), map.at("input edits of lit"));
    map.settle();
    assert_eq!(map.node("lit").inputs["edits"], "caster_receiver");
    screen.settled();
    // made bright,
    for _ in 0..3 {
        // A window that is held up may miss a key.
        screen.click(map.at("brightness"));
        screen.key("ctrl+a");
        screen.write("40");
        screen.key("Return");
        if part(&screen.settled(), pane.shrink(8.0)) != part(&opened, pane.shrink(8.0)) {
            break;
        }
    }
    map.fill("brightness", "40");
    map.settle();
    let view = pane.shrink(8.0);
    let bright = screen.changed(&opened, view, "the picture has not changed");
    // and painted where it is.
    screen.click(map.at("Brush"));
    map.click("Brush");
    let (from, to) = (pane.center() + egui::vec2(-20.0, 150.0), pane.center() + egui::vec2(60.0, 150.0));
    screen.drag(from, to);
    let painted = screen.changed(&bright, view, "paint has not changed it");
    screen.key("ctrl+z");
    let undone = screen.changed(&painted, view, "it is not undone");
    screen.key("ctrl+shift+z");
    screen.changed(&undone, view, "it is not done again");
    // Pixels as they are, without the tint of the selection.
    screen.click(map.at("Point"));
    map.click("Point");
    screen.click(map.at("Selection"));
    // Long enough after the last click to begin a double one.
    screen.settled();
    screen.go(pane.center());
    screen.tool(&["click", "--repeat", "2", "--delay", "80", "1"]);
    screen.go(pane.left_top() + egui::vec2(4.0, 4.0));
    screen.settled();
    screen.key("ctrl+s");
    let start = Instant::now();
    let saved = loop {
        let saved = chiaro::graph::load(&file).unwrap();
        if saved.nodes.contains_key("paint") {
            break saved;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "it is not saved");
        std::thread::sleep(Duration::from_millis(100));
    };
    assert_eq!(saved.nodes["lit"].inputs["edits"], "caster_receiver");
    assert_eq!(saved.nodes["caster_receiver"].params["brightness"], 40.0);
    assert!(saved.nodes["paint"].params["strokes"][0]["points"].as_array().unwrap().len() > 2);
    let status = Command::new(cargo_bin("chiaro"))
        .arg("render")
        .arg(&file)
        .args(["--no-cache", "--device", "cpu", "--progress", "none"])
        .status()
        .unwrap();
    assert!(status.success());
    let rendered = as_shown(&folder.path().join("out.exr"));
    let corner = pane.center() - egui::vec2(160.0, 120.0);
    // What is shown may be coarse for as long as the machine is busy.
    let shown = loop {
        let shown = screen.settled();
        let off = difference(&shown, corner, &rendered);
        if off < 0.002 {
            break shown;
        }
        let share = 100.0 * off;
        assert!(start.elapsed() < Duration::from_secs(120), "{share:.2} % of the viewer's pixels are not the file's");
    };
    // The comparison can tell: without the edit it is another picture.
    let other = folder.path().join("plain.json");
    std::fs::write(&other, RECIPE).unwrap();
    let plain =
        Command::new(cargo_bin("chiaro")).arg("render").arg(&other).args(["--no-cache", "--device", "cpu"]).status();
    assert!(plain.unwrap().success());
    let plain = as_shown(&folder.path().join("out.exr"));
    let off = difference(&shown, corner, &plain);
    assert!(off > 0.02, "{off}");
    if let Some(place) = std::env::var_os("CHIARO_SCREENSHOT") {
        painted.save(place).unwrap();
    }
}
