//! A viewer: a picture of a node, how it is shown, and the tools that work on it.
//!
//! ```text
//! mod      what is asked of the worker, and what comes back
//! toolbar  layers, exposure, comparison, tools
//! picture  where pixels lie on the screen; wipe and split
//! probe    what is under the pointer
//! orbit    free cameras
//! tools    brush, light, handles, dragged shadows
//! ```

mod orbit;
mod picture;
mod probe;
mod toolbar;
mod tools;

use super::Engine;
use super::state::{State, Tool};
use crate::Error;
use crate::editor::develop::{Developed, Developer, Pixels, Settings};
use crate::editor::look::{Look, Output};
use crate::editor::shown::Shown;
use crate::editor::worker::{Event, Level, Request, Worker};
use crate::value::Kind;
use egui::{ColorImage, Context, TextureHandle, TextureOptions, Ui};
use orbit::Orbit;
use picture::View;
use tools::Drag;

/// What a viewer sees through.
#[derive(Clone, Debug, PartialEq)]
pub enum Camera {
    /// That of the recipe, as in production: it does not move.
    Recipe,
    Free(Box<Free>),
    /// None: it shows environments.
    Environment,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Free {
    /// Set once there is a scene to be seen.
    orbit: Option<Orbit>,
    /// With its light, which is computed anew from there; otherwise the surfaces alone.
    lit: bool,
    /// Pixels.
    size: [u32; 2],
}

impl Camera {
    pub fn free() -> Self {
        Self::Free(Box::default())
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Compare {
    /// Share of the width that is A.
    Wipe(f32),
    Split,
    /// All of it.
    Other,
}

/// What was asked of the worker last.
#[derive(PartialEq)]
struct Asked {
    content: u64,
    frame: i64,
    look: Look,
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
    }

    /// All is shown that was asked for.
    pub fn is_idle(&self, state: &State) -> bool {
        self.has_asked(state) && self.request == self.done
    }

    /// Something is shown of what was asked for last.
    pub fn is_pictured(&self, state: &State) -> bool {
        self.has_asked(state) && self.pictured >= self.request
    }

    fn has_asked(&self, state: &State) -> bool {
        match (self.look(state), &self.asked) {
            (Some(look), Some(asked)) => {
                asked.look == look && (asked.content, asked.frame) == (state.session.content(), state.frame)
            }
            (None, _) => true,
            (Some(_), None) => false,
        }
    }

    pub fn title(&self, state: &State) -> String {
        let node = self.at(state).map_or("nothing".to_owned(), |(node, _)| node);
        match self.camera {
            Camera::Recipe => format!("Viewer: {node}"),
            Camera::Free(_) => format!("Free viewer {}: {node}", self.number),
            Camera::Environment => format!("Environment: {node}"),
        }
    }

    fn at(&self, state: &State) -> Option<Output> {
        let held = self.held.clone().filter(|(node, _)| state.document().nodes.contains_key(node));
        match self.camera {
            Camera::Environment => held.or_else(|| {
                let is_map = |name: &&String| {
                    let outputs = state.outputs(name);
                    state.document().nodes[*name].kind == "environment_image"
                        || outputs.first().is_some_and(|port| port.kind == Some(Kind::Environment))
                };
                state.document().nodes.keys().rev().find(is_map).map(|name| (name.clone(), 0))
            }),
            _ => held.or_else(|| state.viewed.clone()),
        }
    }

    fn look(&self, state: &State) -> Option<Look> {
        let at = self.at(state)?;
        let mut look = Look { other: self.other.clone(), ..Look::new(&at.0, at.1) };
        look.other = look.other.filter(|(node, _)| state.document().nodes.contains_key(node));
        match &self.camera {
            Camera::Recipe => look.mask = mask(state),
            Camera::Free(free) => {
                look.eye = Some(free.orbit.as_ref()?.eye(free.size));
                look.clay = !free.lit;
                look.mask = mask(state);
            }
            Camera::Environment => {}
        }
        if self.camera != Camera::Environment {
            let is_dragged = |name: &&str| {
                let entry = state.entry(name);
                entry.is_some_and(|entry| ["translate_shadow", "rotate_shadow"].contains(&entry.kind.as_str()))
            };
            look.shadow = state.chosen().filter(is_dragged).map(str::to_owned);
        }
        Some(look)
    }

    pub fn ui(&mut self, state: &mut State, ui: &mut Ui) {
        self.hear(state, ui.ctx());
        if self.is_main() {
            state.is_shown = self.is_idle(state);
        }
        toolbar::ui(self, state, ui);
        self.place_camera(state, ui);
        self.ask(state);
        picture::ui(self, state, ui);
    }

    /// A free camera starts where the main one is, and looks at what that sees in its middle.
    fn place_camera(&mut self, state: &State, ui: &Ui) {
        let Camera::Free(free) = &mut self.camera else { return };
        let room = ui.available_size() * ui.pixels_per_point();
        // In steps, so that a dragged border does not ask for a picture a pixel.
        let fit = |length: f32, most: u32| (((length / 32.0) as u32) * 32).clamp(64, most);
        free.size = [fit(room.x, 800), fit(room.y, 600)];
        if free.orbit.is_none() {
            free.orbit = state.last.as_ref().and_then(Orbit::around);
        }
    }

    fn ask(&mut self, state: &mut State) {
        let Some(look) = self.look(state) else { return };
        let asked = Asked { content: state.session.content(), frame: state.frame, look };
        if self.asked.as_ref() == Some(&asked) {
            return;
        }
        let request = Request {
            document: state.session.document().clone(),
            look: asked.look.clone(),
            frame: asked.frame,
            settings: self.settings.clone(),
        };
        if self.is_main() {
            state.known.values_mut().for_each(|known| known.error = None);
        }
        self.request = self.worker.request(request);
        self.asked = Some(asked);
    }

    fn hear(&mut self, state: &mut State, ctx: &Context) {
        let events: Vec<Event> = self.worker.events().collect();
        for event in events {
            state.hear(&event, ctx);
            if let Event::Finished { id, level, result, .. } = event {
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
    fn develop(&self) {
        if let Some(shown) = &self.shown {
            self.developer.develop(shown, &self.settings);
        }
    }

    fn upload(&mut self, developed: &Developed, ctx: &Context) {
        self.step = developed.picture.step;
        let pictures = [Some(&developed.picture), developed.other.as_ref()];
        for (slot, (pixels, name)) in pictures.into_iter().zip(["A", "B"]).enumerate() {
            let Some(pixels) = pixels else {
                self.textures[slot] = None;
                continue;
            };
            let options = TextureOptions { magnification: egui::TextureFilter::Nearest, ..TextureOptions::LINEAR };
            let image = colours(pixels);
            match &mut self.textures[slot] {
                Some(texture) => texture.set(image, options),
                None => {
                    let name = format!("viewer {} {name}", self.number);
                    self.textures[slot] = Some(ctx.load_texture(name, image, options));
                }
            }
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

fn colours(pixels: &Pixels) -> ColorImage {
    ColorImage::from_rgba_premultiplied([pixels.width, pixels.height], pixels.data.as_flattened())
}

/// The selection that is chosen, or is being painted.
fn mask(state: &State) -> Option<Output> {
    let chosen = state.chosen()?;
    let gives = |node: &str| state.info(node).and_then(|info| info.outputs.first()).map(|port| port.kind);
    if gives(chosen) == Some(Kind::Selection) {
        return Some((chosen.to_owned(), 0));
    }
    if state.tool != Tool::Brush {
        return None;
    }
    let inputs = &state.entry(chosen)?.inputs;
    let painted = |from: &&String| {
        let node = crate::graph::split(from).0;
        state.entry(node).is_some_and(|entry| ["paint", "select"].contains(&entry.kind.as_str()))
    };
    inputs.values().find(painted).and_then(|from| state.output_number(from))
}
