//! A window without a screen: for figures of how long the hand waits. All is as in a window but the drawing of triangles.

use super::state::Tool;
use super::{Engine, Places, Window};
use crate::Result;
use egui::{Event, Modifiers, PointerButton, Pos2, RawInput, Rect};
use serde_json::Value as Json;
use std::path::PathBuf;
use std::time::{Duration, Instant};

pub struct Headless {
    ctx: egui::Context,
    window: Window,
    start: Instant,
    /// Of all frames so far, seconds.
    longest: f64,
}

/// Seconds from what the hand did to the first picture that shows it, which may be a coarse one, and to the full one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wait {
    pub first: f64,
    pub full: f64,
}

/// Points.
const SIZE: [f32; 2] = [1440.0, 900.0];

impl Headless {
    /// # Errors
    /// As `Window::new`.
    pub fn open(engine: Engine, places: Places, file: PathBuf) -> Result<Self> {
        let ctx = egui::Context::default();
        let window = Window::new(&ctx, engine, places, Some(file))?;
        let mut headless = Self { ctx, window, start: Instant::now(), longest: 0.0 };
        headless.frame(Vec::new());
        headless.settle();
        Ok(headless)
    }

    /// The longest frame since it was last asked, seconds: for so long the window did not answer.
    pub fn longest_frame(&mut self) -> f64 {
        std::mem::take(&mut self.longest)
    }

    pub fn view(&mut self, node: &str) {
        self.window.state.viewed = Some((node.to_owned(), 0));
        self.settle();
    }

    fn frame(&mut self, events: Vec<Event>) {
        let begun = Instant::now();
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, SIZE.into()));
        let time = Some(self.start.elapsed().as_secs_f64());
        let input = RawInput { screen_rect, time, events, max_texture_side: Some(8192), ..RawInput::default() };
        let window = &mut self.window;
        let output = self.ctx.run_ui(input, |ui| window.ui(ui));
        let _ = self.ctx.tessellate(output.shapes, output.pixels_per_point);
        self.longest = self.longest.max(begun.elapsed().as_secs_f64());
    }

    /// Frames until all is shown that was asked for.
    fn settle(&mut self) -> Wait {
        let (begun, mut first) = (Instant::now(), None);
        loop {
            self.frame(Vec::new());
            if first.is_none() && self.window.is_pictured() {
                first = Some(begun.elapsed().as_secs_f64());
            }
            if self.window.is_idle() {
                let full = begun.elapsed().as_secs_f64();
                return Wait { first: first.unwrap_or(full), full };
            }
            while !self.ctx.has_requested_repaint() {
                std::thread::sleep(Duration::from_micros(100));
            }
        }
    }

    /// Sets a parameter to each value in turn.
    pub fn slide(&mut self, node: &str, param: &str, values: impl Iterator<Item = Json>) -> Vec<Wait> {
        let mark = format!("{node}.{param}");
        let step = |value: Json| {
            let begun = Instant::now();
            self.window.state.change("slide", Some(&mark), |document| {
                document.set_param(node, param, Some(value));
                Ok(())
            });
            let before = begun.elapsed().as_secs_f64();
            self.settle().after(before)
        };
        values.map(step).collect()
    }

    /// Draws a stroke for a node in so many movements.
    pub fn paint(&mut self, node: &str, steps: usize) -> Vec<Wait> {
        self.window.state.choose(node);
        self.window.state.tool = Tool::Brush;
        self.settle();
        let pane = self.window.picture_pane();
        let at = |i: usize| {
            let share = i as f32 / steps.max(1) as f32;
            pane.center() + egui::vec2((share - 0.5) * 0.4 * pane.height(), 0.3 * pane.height())
        };
        let button = |at: Pos2, pressed: bool| {
            let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
            Event::PointerButton { pos: at, button, pressed, modifiers }
        };
        self.frame(vec![Event::PointerMoved(at(0))]);
        self.frame(vec![button(at(0), true)]);
        self.settle();
        let mut waits = Vec::new();
        for i in 1..=steps {
            let (begun, before) = (Instant::now(), self.window.state.session.content());
            self.frame(vec![Event::PointerMoved(at(i))]);
            let hand = begun.elapsed().as_secs_f64();
            let wait = self.settle().after(hand);
            // A movement that is too short to be painted shows nothing new.
            if self.window.state.session.content() != before {
                waits.push(wait);
            }
        }
        self.frame(vec![button(at(steps), false)]);
        self.settle();
        waits
    }
}

impl Wait {
    fn after(self, seconds: f64) -> Self {
        Self { first: self.first + seconds, full: self.full + seconds }
    }
}
