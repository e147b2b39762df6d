//! What the window asks before something could be lost.

use super::{Files, Purpose};
use crate::editor::window::state::State;
use crate::editor::{OnDisk, Session};
use std::time::Instant;

impl Files {
    pub(super) fn guard_ui(&mut self, state: &mut State, ctx: &egui::Context) {
        if self.waiting.is_none() || self.dialog.is_some() {
            return;
        }
        let name = state.session.file().map_or("This recipe".into(), |file| file.display().to_string());
        let text = format!("{name} has changes that are not saved.");
        match ask(ctx, "unsaved", &text, &["Save", "Discard changes", "Go back"]) {
            Some(0) if state.session.file().is_none() => self.pick(Purpose::Save, state),
            Some(0) => {
                if self.save(state, None)
                    && let Some(next) = self.waiting.take()
                {
                    self.proceed(state, next);
                }
            }
            Some(1) => {
                if let Some(next) = self.waiting.take() {
                    self.proceed(state, next);
                }
            }
            Some(_) => self.waiting = None,
            None => {}
        }
    }

    pub(super) fn disk_ui(&mut self, state: &mut State, ctx: &egui::Context) {
        let word = match self.on_disk {
            OnDisk::Same => return,
            OnDisk::Changed => "Another program has changed",
            OnDisk::Gone => "Another program has moved or deleted",
        };
        let name = state.session.file().map(|file| file.display().to_string()).unwrap_or_default();
        let choices: &[&str] =
            if self.on_disk == OnDisk::Gone { &["Keep mine"] } else { &["Keep mine", "Read it again"] };
        match ask(ctx, "on disk", &format!("{word} {name}."), choices) {
            Some(0) => state.session.keep_mine(),
            Some(_) => {
                if let Err(error) = state.session.reload() {
                    state.complain(&error);
                    state.session.keep_mine();
                }
            }
            None => return,
        }
        self.on_disk = OnDisk::Same;
        self.looked = Instant::now();
    }

    pub(super) fn left_ui(&mut self, state: &mut State, ctx: &egui::Context) {
        let Some(left) = self.left.first() else { return };
        let name = left.file.as_ref().map_or("an unnamed recipe".into(), |file| file.display().to_string());
        let minutes = left.seconds_ago / 60;
        let text = format!("chiaro ended {minutes} minutes ago before {name} was saved.");
        let Some(choice) = ask(ctx, "left", &text, &["Recover it", "Discard it", "Later"]) else { return };
        let left = self.left.remove(0);
        match choice {
            0 => {
                let session = Session::recovered(left.document.clone(), left.file.clone(), state.session.registry());
                self.replace(state, session);
                // This window keeps it from now on.
                if let Some(keeper) = &self.keeper {
                    keeper.keep(state.session.document(), left.file.clone());
                }
                self.taken.push(left);
            }
            1 => left.discard(),
            _ => {}
        }
    }
}

/// A question that must be answered; the number of the answer.
fn ask(ctx: &egui::Context, id: &str, text: &str, answers: &[&str]) -> Option<usize> {
    let modal = egui::Modal::new(egui::Id::new(id)).show(ctx, |ui| {
        ui.set_max_width(420.0);
        ui.label(text);
        ui.add_space(8.0);
        ui.horizontal(|ui| answers.iter().position(|answer| ui.button(*answer).clicked())).inner
    });
    modal.inner
}
