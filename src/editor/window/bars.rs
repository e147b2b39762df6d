//! The menus above, the status below.

use super::Window;
use super::commands::{self, Command, Menu};

impl Window {
    pub(super) fn menus(&mut self, ui: &mut egui::Ui) {
        egui::MenuBar::new().ui(ui, |ui| {
            for menu in Menu::ALL {
                ui.menu_button(menu.name(), |ui| {
                    for entry in commands::ALL.iter().filter(|entry| entry.menu == menu) {
                        let keys = entry.key.map(|key| ui.ctx().format_shortcut(&key)).unwrap_or_default();
                        let label = self.label(entry);
                        if ui.add(egui::Button::new(label).shortcut_text(keys)).clicked() {
                            self.state.ask(entry.command.clone());
                            ui.close();
                        }
                    }
                    if menu == Menu::File {
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

    pub(super) fn status(&mut self, ui: &mut egui::Ui) {
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
