//! The window: panes around one recipe. What can be done without egui lies one folder up.
//!
//! ```text
//! mod        panes, menus, one frame after the other
//! state      what all panes share
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

mod commands;
mod files;
mod graph;
mod headless;
mod help;
mod inspector;
mod look;
mod perform;
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
    /// The column that the timeline stands in, and the timeline.
    time: [egui_tiles::TileId; 2],
    graph: GraphPane,
    inspector: Inspector,
    timeline: Timeline,
    files: Files,
    help: Help,
    viewers: u64,
}

enum Pane {
    Graph,
    Viewer(Box<Viewer>),
    Inspector,
    Timeline,
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
        let (panes, time) = layout(main);
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

    /// One frame.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        self.files.watch(&mut self.state, &ctx);
        let keys = commands::pressed(&ctx);
        self.state.asked.extend(keys);
        egui::Panel::top("menus").show(ui, |ui| self.menus(ui));
        egui::Panel::bottom("status").show(ui, |ui| self.status(ui));
        self.timeline.tick(&mut self.state, &ctx);
        if let Some(curves) = self.timeline.turned() {
            let [column, time] = self.time;
            // Panes are wrapped in tabs.
            let time = self.panes.tiles.parent_of(time).filter(|tabs| *tabs != column).unwrap_or(time);
            if let Some(egui_tiles::Tile::Container(egui_tiles::Container::Linear(column))) =
                self.panes.tiles.get_mut(column)
            {
                column.shares.set_share(time, if curves { CURVES } else { TIME });
            }
        }
        let frame = egui::Frame::NONE.fill(ui.visuals().panel_fill);
        egui::CentralPanel::default().frame(frame).show(ui, |ui| {
            let Self { panes, state, graph, inspector, timeline, help, .. } = self;
            let mut behaviour = Behaviour { state, graph, inspector, timeline, help };
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

    fn menus(&mut self, ui: &mut egui::Ui) {
        egui::MenuBar::new().ui(ui, |ui| {
            for menu in commands::Menu::ALL {
                ui.menu_button(menu.name(), |ui| {
                    for entry in commands::ALL.iter().filter(|entry| entry.menu == menu) {
                        let keys = entry.key.map(|key| ui.ctx().format_shortcut(&key)).unwrap_or_default();
                        let label = self.label(entry);
                        if ui.add(egui::Button::new(label).shortcut_text(keys)).clicked() {
                            self.state.ask(entry.command.clone());
                            ui.close();
                        }
                    }
                    if menu == commands::Menu::File {
                        self.files.recent_menu(&mut self.state, ui);
                    }
                });
            }
            ui.separator();
            let name =
                self.state.session.file().map_or("untitled".into(), |file| {
                    file.file_name().unwrap_or_default().to_string_lossy().into_owned()
                });
            let mark = if self.state.session.is_unsaved() { " •" } else { "" };
            ui.label(format!("{name}{mark}"));
        });
    }

    /// Undo and redo say what of.
    fn label(&self, entry: &commands::Entry) -> String {
        let history = self.state.session.history();
        let of = match entry.command {
            Command::Undo => history.undo_label(),
            Command::Redo => history.redo_label(),
            _ => None,
        };
        of.map_or_else(|| entry.label.to_owned(), |of| format!("{} {of}", entry.label))
    }

    fn status(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            if let Some(progress) = &self.state.progress {
                let share = progress.done as f32 / progress.total.max(1) as f32;
                let text = format!("{}: {}", progress.node, progress.stage);
                ui.add(egui::ProgressBar::new(share).desired_width(180.0).text(text));
                if ui.button("Cancel").clicked() {
                    self.state.ask(Command::Cancel);
                }
            } else if self.is_idle() {
                ui.weak("ready");
            } else {
                ui.weak("computing…");
            }
            let count = self.state.session.problem_count();
            if count > 0 {
                let text = if count == 1 { "1 problem in the recipe".into() } else { format!("{count} problems") };
                let words: Vec<String> = self.state.session.problems().map(|problem| problem.message.clone()).collect();
                ui.colored_label(ui.visuals().error_fg_color, text).on_hover_text(words.join("\n"));
            }
            if let Some((text, is_complaint)) = &self.state.told {
                let colour = if *is_complaint { ui.visuals().error_fg_color } else { ui.visuals().weak_text_color() };
                ui.add(egui::Label::new(egui::RichText::new(text).color(colour)).truncate());
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.weak(self.engine.evaluator.device().name());
            });
        });
    }
}

/// Share of its column that the timeline takes, without and with curves.
const TIME: f32 = 0.28;
const CURVES: f32 = 0.9;

/// Graph below the picture, the inspector beside both, time at the foot.
fn layout(main: Viewer) -> (egui_tiles::Tree<Pane>, [egui_tiles::TileId; 2]) {
    let mut tiles = egui_tiles::Tiles::default();
    let pictures = tiles.insert_pane(Pane::Viewer(Box::new(main)));
    let pictures = tiles.insert_tab_tile(vec![pictures]);
    let graph = tiles.insert_pane(Pane::Graph);
    let time = tiles.insert_pane(Pane::Timeline);
    let mut left = egui_tiles::Linear::new(egui_tiles::LinearDir::Vertical, vec![pictures, graph, time]);
    left.shares.set_share(pictures, 1.5);
    left.shares.set_share(graph, 1.0);
    left.shares.set_share(time, TIME);
    let left = tiles.insert_container(left);
    let inspector = tiles.insert_pane(Pane::Inspector);
    let mut all = egui_tiles::Linear::new(egui_tiles::LinearDir::Horizontal, vec![left, inspector]);
    all.shares.set_share(left, 1.0);
    all.shares.set_share(inspector, 0.36);
    let root = tiles.insert_container(all);
    (egui_tiles::Tree::new("panes", root, tiles), [left, time])
}

struct Behaviour<'a> {
    state: &'a mut State,
    graph: &'a mut GraphPane,
    inspector: &'a mut Inspector,
    timeline: &'a mut Timeline,
    help: &'a mut Help,
}

fn margin(ui: &mut egui::Ui, content: impl FnOnce(&mut egui::Ui)) {
    egui::Frame::NONE.inner_margin(6.0).show(ui, content);
}

impl egui_tiles::Behavior<Pane> for Behaviour<'_> {
    fn pane_ui(&mut self, ui: &mut egui::Ui, _: egui_tiles::TileId, pane: &mut Pane) -> egui_tiles::UiResponse {
        match pane {
            Pane::Graph => self.graph.ui(self.state, ui),
            Pane::Viewer(viewer) => viewer.ui(self.state, ui),
            Pane::Inspector => margin(ui, |ui| self.inspector.ui(self.state, self.help, ui)),
            Pane::Timeline => margin(ui, |ui| self.timeline.ui(self.state, ui)),
        }
        egui_tiles::UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> egui::WidgetText {
        match pane {
            Pane::Graph => "Graph".into(),
            Pane::Viewer(viewer) => viewer.title(self.state).into(),
            Pane::Inspector => "Inspector".into(),
            Pane::Timeline => "Timeline".into(),
        }
    }

    fn is_tab_closable(&self, tiles: &egui_tiles::Tiles<Pane>, tile: egui_tiles::TileId) -> bool {
        matches!(tiles.get(tile), Some(egui_tiles::Tile::Pane(Pane::Viewer(viewer))) if !viewer.is_main())
    }

    fn simplification_options(&self) -> egui_tiles::SimplificationOptions {
        egui_tiles::SimplificationOptions { all_panes_must_have_tabs: true, ..Default::default() }
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
