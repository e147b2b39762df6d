//! A viewer: a picture of a node, how it is shown, and the tools that work on it.
//!
//! ```text
//! mod      what comes back from the worker
//! ask      what is asked of it
//! camera   what a viewer sees through
//! upload   pictures go to the graphics card
//! toolbar  layers, exposure, comparison, tools
//! picture  where pixels lie on the screen; wipe and split
//! probe    what is under the pointer
//! orbit    free cameras
//! tools    brush, light, handles, dragged shadows
//! ```

mod ask;
mod camera;
mod orbit;
mod picture;
mod probe;
mod toolbar;
mod tools;
mod upload;

use super::Engine;
use super::state::State;
use crate::Error;
use crate::editor::develop::{Developer, Settings};
use crate::editor::look::Output;
use crate::editor::shown::Shown;
use crate::editor::worker::{Event, Level, Worker};
use ask::Asked;
pub use camera::Camera;
use egui::{Context, TextureHandle, Ui};
use picture::View;
use tools::Drag;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Compare {
    /// Share of the width that is A.
    Wipe(f32),
    Split,
    /// All of it.
    Other,
}

pub struct Viewer {
    number: u64,
    camera: Camera,
    worker: Worker,
    developer: Developer,
    settings: Settings,
    /// Shows this, whatever the others show.
    held: Option<Output>,
    other: Option<Output>,
    /// A picture that was kept, to be compared with.
    frozen: Option<std::sync::Arc<crate::image::Image>>,
    compare: Compare,
    asked: Option<Asked>,
    request: u64,
    done: u64,
    /// The newest request that something is shown of.
    pictured: u64,
    /// Small pictures of nodes are to come.
    is_behind: bool,
    shown: Option<Shown>,
    textures: [Option<TextureHandle>; 2],
    /// Pixels of the picture to one of the texture.
    step: usize,
    view: View,
    /// On the screen.
    pane: egui::Rect,
    error: Option<(String, String)>,
    lost: bool,
    drag: Option<Drag>,
    /// Where the menu of the picture was opened.
    menu_at: Option<egui::Pos2>,
    /// Port of the chosen node that is painted, where it has several.
    port: Option<String>,
    offset: f32,
}

impl Viewer {
    pub fn new(ctx: &Context, engine: &Engine, number: u64, camera: Camera) -> Self {
        let most = ctx.input(|input| input.max_texture_side);
        Self {
            number,
            camera,
            worker: worker(ctx, engine),
            developer: Developer::new(waker(ctx)),
            settings: Settings { most, ..Settings::default() },
            held: None,
            other: None,
            frozen: None,
            compare: Compare::Wipe(0.5),
            asked: None,
            request: 0,
            done: 0,
            pictured: 0,
            is_behind: false,
            shown: None,
            textures: [None, None],
            step: 1,
            view: View::default(),
            pane: egui::Rect::ZERO,
            error: None,
            lost: false,
            drag: None,
            menu_at: None,
            port: None,
            offset: 0.3,
        }
    }

    pub fn is_main(&self) -> bool {
        self.number == 0
    }

    pub fn pane(&self) -> egui::Rect {
        self.pane
    }

    pub fn shows_environment(&self) -> bool {
        self.camera == Camera::Environment
    }

    /// Shows a node for good.
    pub fn hold(&mut self, output: Output) {
        self.held = Some(output);
    }

    pub fn compare_with(&mut self, other: Option<Output>) {
        self.other = if self.other == other { None } else { other };
    }

    pub fn cancel(&mut self) {
        self.worker.cancel();
        self.done = self.request;
    }

    pub fn has_lost_its_device(&self) -> bool {
        self.lost
    }

    pub fn restart(&mut self, ctx: &Context, engine: &Engine) {
        self.worker = worker(ctx, engine);
        (self.asked, self.lost, self.request, self.done, self.pictured) = (None, false, 0, 0, 0);
        self.is_behind = false;
    }

    /// All is shown that was asked for.
    pub fn is_idle(&self, state: &State) -> bool {
        self.has_asked(state) && self.request == self.done && self.developer.is_idle()
    }

    /// Small pictures of nodes are to come.
    pub fn is_behind(&self) -> bool {
        self.is_behind
    }

    /// Something is shown of what was asked for last.
    pub fn is_pictured(&self, state: &State) -> bool {
        self.has_asked(state) && self.pictured >= self.request
    }

    pub fn title(&self, state: &State) -> String {
        let node = self.at(state).map_or("nothing".to_owned(), |(node, _)| node);
        match self.camera {
            Camera::Recipe => format!("Viewer: {node}"),
            Camera::Free(_) => format!("Free viewer {}: {node}", self.number),
            Camera::Environment => format!("Environment: {node}"),
        }
    }

    pub fn ui(&mut self, state: &mut State, ui: &mut Ui) {
        self.hear(state, ui.ctx());
        if self.is_main() {
            state.is_shown = self.is_idle(state);
        }
        toolbar::ui(self, state, ui);
        self.camera.place(state, ui.available_size() * ui.pixels_per_point());
        self.ask(state);
        picture::ui(self, state, ui);
    }

    fn hear(&mut self, state: &mut State, ctx: &Context) {
        let events: Vec<Event> = self.worker.events().collect();
        for event in events {
            state.hear(&event, ctx);
            self.is_behind &= !matches!(event, Event::Thumbs { .. });
            if let Event::Finished { id, level, result, .. } = event {
                self.is_behind |= level == Level::Full && result.is_ok();
                if level == Level::Full {
                    self.done = self.done.max(id);
                }
                match result {
                    Ok(picture) => {
                        self.error = None;
                        self.pictured = self.pictured.max(id);
                        self.upload(&picture.developed, ctx);
                        if self.is_main() && picture.shown.samples.is_some() {
                            state.last = Some(picture.shown.clone());
                        }
                        self.show(picture.shown);
                    }
                    Err(Error::Cancelled) => {}
                    Err(error) => {
                        self.lost |= error.exit_code() == Error::device("", "").exit_code();
                        self.error = Some((error.to_string(), error.help().to_owned()));
                    }
                }
            }
        }
        if let Some(developed) = self.developer.developed() {
            self.upload(&developed, ctx);
        }
    }

    fn show(&mut self, mut shown: Shown) {
        let is_new_size = self.shown.as_ref().is_none_or(|before| {
            before.picture.width * shown.picture.height != shown.picture.width * before.picture.height
        });
        if is_new_size {
            self.view = View::default();
        }
        if let Some(frozen) = &self.frozen {
            shown.other = Some(frozen.clone());
        }
        let is_redeveloped = self.frozen.is_some();
        self.shown = Some(shown);
        if is_redeveloped {
            self.develop();
        }
    }

    /// Shows what is there in another way.
    fn develop(&mut self) {
        if let Some(shown) = &self.shown {
            self.developer.develop(shown, &self.settings);
        }
    }
}

fn worker(ctx: &Context, engine: &Engine) -> Worker {
    Worker::new(engine.evaluator.clone(), engine.registry, waker(ctx))
}

fn waker(ctx: &Context) -> impl Fn() + Send + Sync + 'static {
    let ctx = ctx.clone();
    move || ctx.request_repaint()
}
