//! The searchable list of node types: opened by Tab, by right click, or by letting go of a wire; then only what fits.

use super::canvas::Canvas;
use crate::editor::window::state::State;
use crate::node::Info;
use crate::value::Kind;
use egui::{Key, Modifiers, Pos2};

#[derive(Default)]
pub struct Palette {
    open: Option<Open>,
}

struct Open {
    /// On the screen, in points.
    at: Pos2,
    /// In the graph.
    place: [f64; 2],
    port: Option<Port>,
    search: String,
    row: usize,
    fresh: bool,
}

/// At most, in points.
const SIZE: [f32; 2] = [300.0, 440.0];

/// What a wire was dragged from.
#[derive(Clone, Debug, PartialEq)]
pub struct Port {
    pub node: String,
    /// Of an input its name, of an output as recipes write it.
    pub name: String,
    pub kind: Option<Kind>,
    pub is_output: bool,
}

/// A node that was chosen.
pub struct Wanted {
    pub kind: &'static str,
    pub at: [f64; 2],
    pub port: Option<Port>,
}

impl Palette {
    pub fn open(&mut self, at: Pos2, place: [f64; 2], port: Option<Port>) {
        self.open = Some(Open { at, place, port, search: String::new(), row: 0, fresh: true });
    }

    /// Tab over the graph; elsewhere it goes from widget to widget.
    pub fn tab_opens(&self, canvas: &Canvas, ui: &egui::Ui) -> bool {
        let is_over = ui.input(|input| input.pointer.hover_pos()).is_some_and(|at| canvas.rect().contains(at));
        is_over && self.open.is_none() && ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Tab))
    }

    pub fn ui(&mut self, state: &State, ctx: &egui::Context) -> Option<Wanted> {
        let open = self.open.as_mut()?;
        let found = found(state, open.port.as_ref(), &open.search);
        let (down, up, enter, escape) = ctx.input_mut(|input| {
            let mut key = |key| input.consume_key(Modifiers::NONE, key);
            (key(Key::ArrowDown), key(Key::ArrowUp), key(Key::Enter), key(Key::Escape))
        });
        if down {
            open.row += 1;
        }
        if up {
            open.row = open.row.saturating_sub(1);
        }
        open.row = open.row.min(found.len().saturating_sub(1));
        let mut chosen = found.get(open.row).copied().filter(|_| enter);
        // Where its longest list has room: it is not to jump while somebody types.
        let room = ctx.content_rect();
        let at = open.at.min(room.max - egui::vec2(SIZE[0] + 20.0, SIZE[1])).max(room.min);
        let area = egui::Area::new("palette".into()).order(egui::Order::Foreground).fixed_pos(at);
        let shown = area.show(ctx, |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_width(SIZE[0]);
                let title = match &open.port {
                    Some(port) => format!("Nodes that fit {}", port.kind.map_or("", Kind::name)),
                    None => "Add a node".to_owned(),
                };
                ui.strong(title);
                let label = ui.label("Search").id;
                let search = egui::TextEdit::singleline(&mut open.search).hint_text("what it does, or its name");
                let search = ui.add(search.desired_width(f32::INFINITY)).labelled_by(label);
                if open.fresh {
                    search.request_focus();
                }
                if search.changed() {
                    open.row = 0;
                }
                egui::ScrollArea::vertical().max_height(SIZE[1] - 120.0).show(ui, |ui| {
                    let mut category = "";
                    for (row, info) in found.iter().enumerate() {
                        if info.category != category && open.search.is_empty() {
                            category = info.category;
                            ui.weak(category);
                        }
                        let button = ui.selectable_label(row == open.row, info.name).on_hover_text(info.summary);
                        if row == open.row && (up || down) {
                            button.scroll_to_me(None);
                        }
                        if button.clicked() {
                            chosen = Some(info);
                        }
                    }
                    if found.is_empty() {
                        ui.weak("no node of that name");
                    }
                });
                if let Some(info) = found.get(open.row) {
                    ui.separator();
                    ui.small(info.summary);
                }
            });
        });
        let outside = !open.fresh && shown.response.clicked_elsewhere();
        open.fresh = false;
        let wanted = chosen.map(|info| Wanted { kind: info.name, at: open.place, port: open.port.clone() });
        if wanted.is_some() || escape || outside {
            self.open = None;
        }
        wanted
    }
}

/// Types that fit the port and hold all words, those with them in their names first.
fn found(state: &State, port: Option<&Port>, search: &str) -> Vec<&'static Info> {
    let words: Vec<String> = search.split_whitespace().map(str::to_lowercase).collect();
    let fits = |info: &Info| {
        let Some(Port { kind: Some(kind), is_output, .. }) = port else { return true };
        let ports = if *is_output { info.inputs } else { info.outputs };
        ports.iter().any(|port| port.kind == *kind)
    };
    let has = |info: &Info| {
        let text = format!("{} {} {}", info.name, info.category, info.summary).to_lowercase();
        words.iter().all(|word| text.contains(word.as_str()))
    };
    let all = state.session.registry().iter().map(|node_type| node_type.info);
    let mut found: Vec<&'static Info> = all.filter(|info| fits(info) && has(info)).collect();
    if let Some(first) = words.first() {
        let rank = |info: &&Info| match info.name.to_lowercase() {
            name if name.starts_with(first.as_str()) => 0,
            name if name.contains(first.as_str()) => 1,
            _ => 2,
        };
        found.sort_by_key(rank);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::Session;
    use crate::nodes;

    #[test]
    fn what_fits_and_what_is_meant_comes_first() {
        let state = State::new(Session::new(nodes::ALL));
        let names = |port: Option<&Port>, search: &str| -> Vec<&str> {
            found(&state, port, search).into_iter().map(|info| info.name).collect()
        };
        assert_eq!(names(None, "").len(), nodes::ALL.len());
        assert_eq!(names(None, "relig")[0], "relight");
        assert!(names(None, "shadow softens").contains(&"blur_shadow"));
        let port = |kind, is_output| Port { node: "a".into(), name: "a".into(), kind: Some(kind), is_output };
        let fit = names(Some(&port(Kind::Ratio, true)), "");
        assert!(fit.contains(&"ratio_blur") && fit.contains(&"synthesize_shadow") && !fit.contains(&"scene"));
        assert_eq!(names(Some(&port(Kind::Transfer, false)), ""), ["transfer"]);
        assert!(names(None, "no such thing").is_empty());
    }
}
