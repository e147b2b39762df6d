//! How the window is divided.

use super::graph::GraphPane;
use super::help::Help;
use super::inspector::Inspector;
use super::state::State;
use super::timeline::Timeline;
use super::viewer::Viewer;

pub enum Pane {
    Graph,
    Viewer(Box<Viewer>),
    Inspector,
    Timeline,
}

/// Share of its column that the timeline takes, without and with curves.
const TIME: f32 = 0.28;
const CURVES: f32 = 0.9;

/// The column that the timeline stands in, and the timeline.
pub type Time = [egui_tiles::TileId; 2];

/// Graph below the picture, the inspector beside both, time at the foot.
pub fn layout(main: Viewer) -> (egui_tiles::Tree<Pane>, Time) {
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

/// Gives the timeline the room that curves need, or takes it back.
pub fn make_room(panes: &mut egui_tiles::Tree<Pane>, [column, time]: Time, is_curves: bool) {
    // Panes are wrapped in tabs.
    let time = panes.tiles.parent_of(time).filter(|tabs| *tabs != column).unwrap_or(time);
    if let Some(egui_tiles::Tile::Container(egui_tiles::Container::Linear(column))) = panes.tiles.get_mut(column) {
        column.shares.set_share(time, if is_curves { CURVES } else { TIME });
    }
}

pub struct Behaviour<'a> {
    pub state: &'a mut State,
    pub graph: &'a mut GraphPane,
    pub inspector: &'a mut Inspector,
    pub timeline: &'a mut Timeline,
    pub help: &'a mut Help,
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
