//! The dialogs in which files are chosen.

use super::{Files, Next, written};
use crate::editor::window::state::State;
use egui_file_dialog::{DialogState, FileDialog};
use std::path::{Path, PathBuf};

pub struct Dialog {
    dialog: FileDialog,
    purpose: Purpose,
}

pub enum Purpose {
    Open,
    Save,
    /// The file of a node's parameter.
    Param(String, String),
}

impl Files {
    pub(super) fn pick(&mut self, purpose: Purpose, state: &State) {
        let dialog = FileDialog::new().add_file_filter_extensions("Recipes", vec!["json"]);
        let folder = std::path::absolute(&state.document().base).unwrap_or_default();
        let mut dialog = dialog.initial_directory(folder);
        match &purpose {
            Purpose::Open => {
                dialog = dialog.default_file_filter("Recipes");
                dialog.pick_file();
            }
            Purpose::Save => {
                let name = state.session.file().and_then(Path::file_name).map(|name| name.to_string_lossy());
                dialog = dialog.default_file_name(name.as_deref().unwrap_or("untitled.json"));
                dialog.save_file();
            }
            Purpose::Param(..) => dialog.pick_file(),
        }
        self.dialog = Some(Dialog { dialog, purpose });
    }

    /// Lets the user choose the file of a parameter.
    pub fn pick_param(&mut self, state: &State, node: &str, param: &str) {
        self.pick(Purpose::Param(node.to_owned(), param.to_owned()), state);
    }

    pub(super) fn dialog_ui(&mut self, state: &mut State, ctx: &egui::Context) {
        let Some(open) = &mut self.dialog else { return };
        open.dialog.update(ctx);
        let picked = open.dialog.take_picked();
        if picked.is_none() && *open.dialog.state() == DialogState::Open {
            return;
        }
        let purpose = self.dialog.take().map(|dialog| dialog.purpose);
        match (purpose, picked) {
            (Some(Purpose::Open), Some(file)) => self.proceed(state, Next::Open(file)),
            (Some(Purpose::Save), Some(file)) => {
                let is_saved = self.save(state, Some(&with_suffix(file)));
                if let Some(next) = self.waiting.take().filter(|_| is_saved) {
                    self.proceed(state, next);
                }
            }
            (Some(Purpose::Param(node, param)), Some(file)) => {
                let path = written(&state.document().base, &file);
                state.change(&format!("{node}.{param}"), None, |document| {
                    document.set_param(&node, &param, Some(path.into()));
                    Ok(())
                });
            }
            _ => {}
        }
    }
}

fn with_suffix(file: PathBuf) -> PathBuf {
    if file.extension().is_some() { file } else { file.with_extension("json") }
}
