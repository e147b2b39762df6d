//! The window: panes around one recipe. What can be done without egui lies one folder up.
//!
//! ```text
//! mod        one frame after the other
//! panes      how the window is divided
//! bars       the menus above, the status below
//! state      what all panes share
//! known      what evaluation has told of nodes
//! ports      of nodes, as they are drawn
//! commands   everything that menus and keys ask for, in one table
//! perform    ... and what it does
//! files      opening, saving, what is not saved, dropped files
//! graph      nodes and wires (the only folder that names egui-snarl); palette
//! viewer     pictures, probe, comparison, free cameras; tools: hands on the picture
//! inspector  the chosen node: parameters, inputs, warnings
//! timeline   frames and keys
//! headless   a window without a screen, for figures
//! help       shortcuts, tour, what a node says of itself
//! look       colours, and small widgets that several panes use
//! ```

mod bars;
mod commands;
mod files;
mod graph;
mod headless;
mod help;
mod inspector;
mod known;
mod look;
mod panes;
mod perform;
mod ports;
mod state;
mod timeline;
mod viewer;

pub use commands::Command;
pub use files::Places;
pub use headless::{Headless, Wait};
pub use state::{State, Tool};

use crate::device::Device;
use crate::eval::{Evaluator, Options};
use crate::params::NodeType;
use crate::{Error, Result};
use files::Files;
use graph::GraphPane;
use help::Help;
use inspector::Inspector;
use panes::Pane;
use std::path::PathBuf;
use std::sync::Arc;
use timeline::Timeline;
use viewer::Viewer;

/// What computes for a window.
#[derive(Clone)]
pub struct Engine {
    pub evaluator: Arc<Evaluator>,
    pub registry: &'static [NodeType],
}

pub struct Window {
    state: State,
    engine: Engine,
    panes: egui_tiles::Tree<Pane>,
    time: panes::Time,
    graph: GraphPane,
    inspector: Inspector,
    timeline: Timeline,
    files: Files,
    help: Help,
    viewers: u64,
}

impl Window {
    /// With the recipe of `file`, or the example when this is the first start.
    ///
    /// # Errors
    /// `File` or `Graph` when the recipe cannot be read.
    pub fn new(ctx: &egui::Context, engine: Engine, places: Places, file: Option<PathBuf>) -> Result<Self> {
        let (files, session) = Files::start(places, file, engine.registry)?;
        let help = Help::new(files.is_first_start());
        let main = Viewer::new(ctx, &engine, 0, viewer::Camera::Recipe);
        let (panes, time) = panes::layout(main);
        look::install(ctx);
        Ok(Self {
            state: State::new(session),
            panes,
            time,
            graph: GraphPane::default(),
            inspector: Inspector::default(),
            timeline: Timeline::default(),
            files,
            help,
            engine,
            viewers: 1,
        })
    }

    pub fn state(&self) -> &State {
        &self.state
    }

    /// Nothing is being computed, and all is shown that was asked for.
    pub fn is_idle(&self) -> bool {
        self.panes.tiles.tiles().all(|tile| match tile {
            egui_tiles::Tile::Pane(Pane::Viewer(viewer)) => viewer.is_idle(&self.state),
            _ => true,
        })
    }

    /// Idle, and nodes show what they are to show: nothing moves any more.
    pub fn is_at_rest(&self) -> bool {
        let is_behind = |tile: &egui_tiles::Tile<Pane>| match tile {
            egui_tiles::Tile::Pane(Pane::Viewer(viewer)) => viewer.is_behind(),
            _ => false,
        };
        self.is_idle() && !self.panes.tiles.tiles().any(is_behind)
    }

    /// One frame.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        self.files.watch(&mut self.state, &ctx);
        let keys = commands::pressed(&ctx);
        self.state.asked.extend(keys);
        egui::Panel::top("menus").show(ui, |ui| self.menus(ui));
        egui::Panel::bottom("status").show(ui, |ui| self.status(ui));
        self.timeline.tick(&mut self.state, &ctx);
        if let Some(is_curves) = self.timeline.turned() {
            panes::make_room(&mut self.panes, self.time, is_curves);
        }
        let frame = egui::Frame::NONE.fill(ui.visuals().panel_fill);
        egui::CentralPanel::default().frame(frame).show(ui, |ui| {
            let Self { panes, state, graph, inspector, timeline, help, .. } = self;
            let mut behaviour = panes::Behaviour { state, graph, inspector, timeline, help };
            panes.ui(&mut behaviour, ui);
        });
        self.graph.palette(&mut self.state, ui);
        if let Some((node, param)) = self.state.pick_file.take() {
            self.files.pick_param(&self.state, &node, &param);
        }
        self.files.ui(&mut self.state, &ctx);
        self.help.ui(&mut self.state, &ctx);
        self.state.toasts.show(&ctx);
        for command in std::mem::take(&mut self.state.asked) {
            self.perform(command, &ctx);
        }
        self.state.tidy();
        self.fall_back(&ctx);
    }

    /// Of a device that is lost nothing more is to be had: the work goes on without it.
    fn fall_back(&mut self, ctx: &egui::Context) {
        let is_lost = self.viewers_mut().any(|viewer| viewer.has_lost_its_device());
        if !is_lost || matches!(self.engine.evaluator.device(), Device::Cpu) {
            return;
        }
        self.engine.evaluator = Arc::new(Evaluator::new(Options::new(Device::Cpu)));
        let engine = self.engine.clone();
        self.viewers_mut().for_each(|viewer| viewer.restart(ctx, &engine));
        self.state.tell("The GPU has failed. The editor goes on with the CPU; nothing is lost.");
    }

    /// The main viewer shows what was asked for last, coarse or in full.
    fn is_pictured(&mut self) -> bool {
        let Self { panes, state, .. } = self;
        panes.tiles.tiles().any(|tile| match tile {
            egui_tiles::Tile::Pane(Pane::Viewer(viewer)) => viewer.is_main() && viewer.is_pictured(state),
            _ => false,
        })
    }

    /// Where the main picture lies on the screen.
    fn picture_pane(&mut self) -> egui::Rect {
        self.viewers_mut().find(|viewer| viewer.is_main()).map_or(egui::Rect::ZERO, |viewer| viewer.pane())
    }

    fn viewers_mut(&mut self) -> impl Iterator<Item = &mut Viewer> {
        self.panes.tiles.tiles_mut().filter_map(|tile| match tile {
            egui_tiles::Tile::Pane(Pane::Viewer(viewer)) => Some(&mut **viewer),
            _ => None,
        })
    }
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        Self::ui(self, ui);
    }
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// `Device` when there is no screen or no driver to draw with, `File` or `Graph` when the recipe cannot be read.
pub fn run(engine: Engine, places: Places, file: Option<PathBuf>) -> Result<()> {
    // What is wrong with the recipe is told before a window opens.
    if let Some(file) = file.as_ref().filter(|file| file.exists()) {
        crate::graph::load(file)?;
    }
    let viewport = egui::ViewportBuilder::default()
        .with_title("chiaro")
        .with_app_id("chiaro")
        .with_inner_size([1440.0, 900.0])
        .with_drag_and_drop(true);
    let options = eframe::NativeOptions { viewport, ..Default::default() };
    let create = move |cc: &eframe::CreationContext| {
        let window = Window::new(&cc.egui_ctx, engine, places, file)?;
        Ok(Box::new(window) as Box<dyn eframe::App>)
    };
    eframe::run_native("chiaro", options, Box::new(create)).map_err(|error| {
        let help = "an editor needs a screen, and a driver for Vulkan, Metal, DirectX 12 or OpenGL; \
                    `chiaro render` needs neither";
        Error::device(format!("no window could be opened: {error}"), help)
    })
}
