//! The viewer, and hands on the picture.

use super::desk::{Desk, aside, can_draw};
use chiaro::transport::selection::{Stroke, StrokeMode};
use egui::{Key, Modifiers, PointerButton};

/// Where a pixel of the picture is on the screen: the picture fills the pane's height or width.
fn pixel(desk: &Desk, x: f32, y: f32) -> egui::Pos2 {
    let pane = desk.rect("picture");
    let picture = desk.picture();
    let size = egui::vec2(picture.width as f32, picture.height as f32);
    let zoom = (pane.width() / size.x).min(pane.height() / size.y);
    pane.center() + (egui::vec2(x, y) - size / 2.0) * zoom
}

fn close_tour(desk: &mut Desk) {
    if desk.sees("Tour, 1 of 3") {
        desk.click("Skip");
    }
}

fn room() -> Desk {
    let mut desk = Desk::room();
    close_tour(&mut desk);
    desk
}

fn strokes(desk: &Desk, paint: &str) -> Vec<Stroke> {
    serde_json::from_value(desk.node(paint).params["strokes"].clone()).unwrap()
}

#[test]
fn the_probe_tells_what_is_under_the_pointer() {
    let mut desk = room();
    desk.hover(pixel(&desk, 48.5, 60.5));
    desk.frames(2);
    for word in ["48, 60", "P ", "N ", "R "] {
        assert!(desk.sees(word), "{word}");
    }
    // The numbers are those of the pixel.
    let picture = desk.picture();
    let [colour, position] = ["", "P"].map(|layer| {
        let layer = picture.layer(layer).unwrap();
        let pixel = layer.channels.len() * (60 * picture.width + 48);
        layer.data[pixel..][..3].to_vec()
    });
    let colour = format!("R {:.4}  G {:.4}  B {:.4}", colour[0], colour[1], colour[2]);
    let position = format!("P {:.3} {:.3} {:.3} m", position[0], position[1], position[2]);
    let probe = desk.probe();
    assert!(probe.contains(&colour) && probe.contains(&position), "{probe}, expected {colour}, {position}");
    let named = ["floor", "block", "wall"].iter().any(|name| desk.sees(name));
    assert!(named, "the object is named");
}

#[test]
fn a_press_with_the_light_tool_places_a_light_and_a_drag_moves_it() {
    let mut desk = room();
    let before = desk.picture();
    desk.click("Light");
    let at = pixel(&desk, 50.0, 62.0);
    desk.click_at(at, Modifiers::NONE);
    desk.settle();
    let first: Vec<f64> = serde_json::from_value(desk.node("light").params["position"].clone()).unwrap();
    assert!((first[1] - 0.3).abs() < 0.02, "off the floor: {first:?}");
    assert_eq!(desk.node("lit").inputs["scene"], "light");
    assert_eq!(desk.node("way").inputs["scene"], "room", "no transfer is computed for a lamp");
    assert_ne!(before.layers[0].data[..], desk.picture().layers[0].data[..]);
    desk.drag(at, pixel(&desk, 30.0, 66.0));
    desk.settle();
    let moved: Vec<f64> = serde_json::from_value(desk.node("light").params["position"].clone()).unwrap();
    assert!(moved[0] < first[0] - 0.1 && desk.document().nodes.len() == 6, "{first:?} {moved:?}");
    desk.undo();
    let back: Vec<f64> = serde_json::from_value(desk.node("light").params["position"].clone()).unwrap();
    assert_eq!(back, first, "the drag is undone as one");
    desk.undo();
    assert!(!desk.document().nodes.contains_key("light"));
}

#[test]
fn strokes_are_painted_for_the_chosen_edit_and_erased() {
    let mut desk = room();
    desk.click("node edit");
    desk.click("Brush");
    let (from, to) = (pixel(&desk, 44.0, 66.0), pixel(&desk, 60.0, 66.0));
    desk.drag(from, to);
    desk.settle();
    // The first of its ports, until another is chosen.
    assert_eq!(desk.node("edit").inputs["caster"], "paint");
    let painted = strokes(&desk, "paint");
    assert!(painted.len() == 1 && painted[0].points.len() > 2, "{painted:?}");
    assert!(painted[0].points.iter().all(|point| point[1].abs() < 1e-3), "on the floor");
    assert_eq!(painted[0].normals.len(), painted[0].points.len());
    assert!((painted[0].radius - 0.25).abs() < 1e-6 && painted[0].mode == StrokeMode::Add);
    desk.undo();
    assert!(!desk.document().nodes.contains_key("paint"), "one stroke, one undo");
    desk.redo();
    desk.click("Erase");
    desk.key(Modifiers::NONE, Key::CloseBracket);
    desk.drag(from, aside(from, 30.0, 0.0));
    desk.settle();
    let painted = strokes(&desk, "paint");
    assert!(painted.len() == 2 && painted[1].mode == StrokeMode::Erase && painted[1].radius > 0.3);
    // The other port.
    desk.click("paint what");
    desk.click("receiver");
    desk.drag(from, to);
    assert_eq!(desk.node("edit").inputs["receiver"], "paint2");
}

/// A drag from the wall over the figure and on: only what it paints on the figure goes with it.
#[test]
fn paint_on_what_moves_goes_with_it() {
    let recipe = super::desk::ROOM.replace("builtin:room", "builtin:walk");
    let mut desk = Desk::with(&recipe);
    desk.settle();
    close_tour(&mut desk);
    desk.key(Modifiers::NONE, Key::B);
    // At frame 1 the figure stands on the left, before the back wall.
    let chest = pixel(&desk, 14.2, 40.0);
    desk.drag(aside(chest, 120.0, 0.0), chest);
    desk.drag(aside(chest, 0.0, -120.0), aside(chest, 60.0, -120.0));
    desk.settle();
    let painted = strokes(&desk, "paint");
    let on: Vec<Option<(&str, i64)>> =
        painted.iter().map(|stroke| stroke.attached.as_ref().map(|a| (&a.object[..], a.frame))).collect();
    assert_eq!(on, [None, Some(("figure", 1)), None], "{painted:?}");
    desk.undo();
    assert_eq!(strokes(&desk, "paint").len(), 2, "one drag, one undo");
}

#[test]
fn a_brush_alone_paints_a_selection_of_its_own() {
    let mut desk = room();
    desk.key(Modifiers::NONE, Key::B);
    desk.click("Adaptive");
    let at = pixel(&desk, 50.0, 62.0);
    desk.hover(at);
    desk.click_at(at, Modifiers::NONE);
    desk.settle();
    assert_eq!(desk.state().selected, ["paint"]);
    assert!(strokes(&desk, "paint")[0].adaptive);
    assert!(desk.state().last.as_ref().unwrap().mask.as_ref().is_some_and(|mask| mask.iter().any(|w| *w > 0.5)));
}

#[test]
fn layers_exposure_and_false_colour_change_what_is_shown() {
    if !can_draw() {
        return;
    }
    let mut desk = room();
    let shot = |desk: &mut Desk| {
        desk.settle();
        let at = pixel(desk, 20.5, 40.5);
        desk.harness.remove_cursor();
        desk.frames(1);
        let image = desk.harness.render().unwrap();
        image.get_pixel(at.x as u32, at.y as u32).0
    };
    let plain = shot(&mut desk);
    desk.fill("exposure", "-3");
    let dark = shot(&mut desk);
    assert!(dark[0] < plain[0] / 2, "{plain:?} {dark:?}");
    desk.fill("exposure", "0");
    assert_eq!(shot(&mut desk), plain);
    desk.fill("gamma", "2");
    assert!(shot(&mut desk)[0] > plain[0] && plain[0] > 0);
    desk.fill("gamma", "1");
    // Brighter, where a tone curve bends.
    desk.fill("exposure", "2");
    let bright = shot(&mut desk);
    for (list, entry, back) in [
        ("view transform", "Reinhard", "sRGB"),
        ("view transform", "ACES 2.0", "sRGB"),
        ("channel", "luminance", "all"),
    ] {
        desk.click(list);
        desk.click(entry);
        let [r, g, b, _] = shot(&mut desk);
        assert!([r, g, b] != bright[..3], "{entry}: {bright:?} and {r} {g} {b}");
        assert_eq!(r == g && g == b, entry == "luminance", "{r} {g} {b}");
        desk.click(list);
        desk.click(back);
        assert_eq!(shot(&mut desk), bright);
    }
    desk.fill("exposure", "0");
    desk.click("False colour");
    assert_ne!(shot(&mut desk), plain);
    desk.click("False colour");
    desk.click("layer");
    desk.click("indirect");
    assert_ne!(shot(&mut desk), plain);
    let document = desk.document().to_text();
    assert!(!desk.state().session.is_unsaved(), "looking changes nothing: {document}");
}

#[test]
fn pictures_are_compared() {
    if !can_draw() {
        return;
    }
    let mut desk = room();
    desk.click("compare");
    desk.click("with A as it is now");
    desk.click("node edit");
    desk.fill("brightness", "8");
    desk.settle();
    let shown = desk.state().last.as_ref().unwrap();
    assert_ne!(shown.picture.layers[0].data[..], [0.0; 0][..]);
    // A left of the line, B right of it.
    let wipe = |desk: &mut Desk| {
        desk.frames(2);
        desk.harness.render().unwrap()
    };
    let both = wipe(&mut desk);
    desk.click("B");
    let other = wipe(&mut desk);
    let (left, right) = (pixel(&desk, 36.0, 50.0), pixel(&desk, 60.0, 60.0));
    let at = |image: &image::RgbaImage, at: egui::Pos2| image.get_pixel(at.x as u32, at.y as u32).0;
    assert_eq!(at(&both, right), at(&other, right), "right of the line it is B");
    assert_ne!(at(&both, left), at(&other, left), "left of it A");
    desk.click("Wipe");
    let middle = desk.rect("picture").center();
    desk.drag(middle, aside(middle, -220.0, 0.0));
    let moved = wipe(&mut desk);
    assert_eq!(at(&moved, left), at(&other, left), "the line was drawn past it");
    // Side by side, the same in the middle of each half.
    let middle = at(&other, pixel(&desk, 60.4, 50.4));
    let mut off = egui::Vec2::ZERO;
    let halves = |desk: &Desk, off: egui::Vec2| [0.25, 0.75].map(|share| desk.within("picture", share, 0.5) + off);
    desk.click("Split");
    let [a, _] = halves(&desk, off);
    // From the picture's middle to the pixel that was looked at.
    desk.hover(a);
    assert!(desk.probe().starts_with("48, 36"), "{}", desk.probe());
    let pane = desk.rect("picture");
    let zoom = (0.5 * pane.width() / 96.0).min(pane.height() / 72.0);
    off += egui::vec2(12.4, 14.4) * zoom;
    let [a, b] = halves(&desk, off);
    let split = wipe(&mut desk);
    assert_eq!(at(&split, b), middle, "B on the right");
    assert_ne!(at(&split, a), middle, "A on the left");
    for place in [a, b] {
        desk.hover(place);
        assert!(desk.probe().starts_with("60, 50"), "{}", desk.probe());
    }
}

#[test]
fn the_wheel_zooms_to_pixels_and_a_drag_pans() {
    let mut desk = room();
    let at = pixel(&desk, 30.5, 40.5);
    desk.hover(at);
    for _ in 0..6 {
        let (unit, phase) = (egui::MouseWheelUnit::Line, egui::TouchPhase::Move);
        let modifiers = Modifiers::NONE;
        desk.harness.event(egui::Event::MouseWheel { unit, delta: egui::vec2(0.0, 3.0), phase, modifiers });
        desk.frames(3);
    }
    desk.frames(20);
    desk.hover(at);
    assert!(desk.sees("30, 40"), "what is under the pointer stays there");
    desk.hover(aside(at, 3.0, 0.0));
    assert!(desk.sees("30, 40"), "pixels are large now");
    desk.drag(at, aside(at, 120.0, 0.0));
    desk.hover(at);
    assert!(!desk.sees("30, 40"));
    // A double click fits it again.
    desk.click_at(at, Modifiers::NONE);
    desk.click_at(at, Modifiers::NONE);
    desk.frames(3);
    desk.hover(at);
    assert!(desk.sees("30, 40"));
}

#[test]
fn a_free_viewer_turns_and_the_main_one_does_not() {
    let mut desk = room();
    desk.key(Modifiers::COMMAND, Key::E);
    desk.settle();
    assert!(desk.sees("Free viewer 1"));
    let camera = desk.state().last.as_ref().unwrap().samples.as_ref().unwrap().camera.clone();
    let pane = desk.rect("picture 1");
    let probed = |desk: &mut Desk| {
        desk.hover(pane.center());
        desk.frames(2);
        desk.probe()
    };
    let before = probed(&mut desk);
    desk.drag(pane.center(), aside(pane.center(), 90.0, 10.0));
    desk.settle();
    let after = probed(&mut desk);
    assert!(before.contains(" P ") && before != after, "it shows another side: {before}, {after}");
    assert_eq!(desk.state().last.as_ref().unwrap().samples.as_ref().unwrap().camera, camera);
    // Painting works in it, too: on what the main camera may not see.
    desk.click("node edit");
    desk.click("Brush");
    desk.drag(aside(pane.center(), 0.0, 60.0), aside(pane.center(), 30.0, 60.0));
    assert!(desk.document().nodes.contains_key("paint"));
    assert!(!desk.state().session.document().nodes.keys().any(|name| name.starts_with("viewer")));
}

#[test]
fn a_right_click_on_the_picture_picks_what_is_there() {
    let mut desk = room();
    let at = pixel(&desk, 50.0, 64.0);
    desk.drag_with(at, at, Modifiers::NONE, PointerButton::Secondary);
    desk.frames(3);
    desk.click("Pick object floor");
    assert_eq!(desk.node("pick").params["objects"], serde_json::json!(["floor"]));
    assert_eq!(desk.node("pick").inputs["scene"], "room");
}
