//! Opening, saving, and all that could lose a recipe: windows that are closed, files that other programs change, programs
//! that end too early.

mod dialog;
mod questions;

use super::commands::Command;
use super::state::State;
use crate::editor::keeper::Keeper;
use crate::editor::paths::written;
use crate::editor::recent::Recent;
use crate::editor::recovery::{self, Left, Recovery};
use crate::editor::{OnDisk, Session};
use crate::graph::Document;
use crate::params::NodeType;
use crate::{Error, Result};
use dialog::{Dialog, Purpose};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Where the editor keeps what is its own.
#[derive(Clone, Debug)]
pub struct Places {
    pub folder: PathBuf,
}

impl Places {
    fn recovery(&self) -> PathBuf {
        self.folder.join("recovery")
    }

    fn recent(&self) -> PathBuf {
        self.folder.join("recent")
    }
}

/// What the first start opens: finished, and without files of its own.
const EXAMPLE: &str = include_str!("../../../../graphs/room_bleed.json");

pub struct Files {
    keeper: Option<Keeper>,
    recent: Recent,
    left: Vec<Left>,
    /// Was recovered, and is there until this window has kept it aside itself.
    taken: Vec<Left>,
    dialog: Option<Dialog>,
    /// To be done once it is settled what becomes of what is not saved.
    waiting: Option<Next>,
    on_disk: OnDisk,
    looked: Instant,
    kept: u64,
    kept_at: Instant,
    is_first_start: bool,
    /// The window may close without another question.
    leave: bool,
}

#[derive(Clone, Debug, PartialEq)]
enum Next {
    New,
    Example,
    Open(PathBuf),
    PickFile,
    Quit,
}

/// How often a recipe is kept aside while the hand drags.
const KEEP: Duration = Duration::from_secs(1);

/// How often the file is looked at.
const LOOK: Duration = Duration::from_secs(2);

impl Files {
    /// The recipe to start with: `file`, also one that does not exist yet; else the example on the first start.
    ///
    /// # Errors
    /// `File` or `Graph` when it cannot be read.
    pub fn start(places: Places, file: Option<PathBuf>, registry: &'static [NodeType]) -> Result<(Self, Session)> {
        let is_first_start = !places.folder.join("started").exists();
        let mut recent = Recent::read(&places.recent());
        let session = match file {
            Some(file) if file.exists() => {
                let session = Session::open(&file, registry)?;
                let _ = recent.note(&file);
                session
            }
            Some(file) => Session::recovered(Document::empty_at(&file), Some(file), registry),
            None if is_first_start => example(registry)?,
            None => Session::new(registry),
        };
        let left = recovery::left(&places.recovery());
        let keeper = match Recovery::new(&places.recovery()) {
            Ok(recovery) => Some(Keeper::new(recovery)),
            Err(error) => {
                tracing::warn!("no autosave: {error}");
                None
            }
        };
        let _ = crate::atomic::write(&places.folder.join("started"), b"");
        let files = Self {
            keeper,
            recent,
            left,
            taken: Vec::new(),
            dialog: None,
            waiting: None,
            on_disk: OnDisk::Same,
            looked: Instant::now(),
            kept: 0,
            kept_at: Instant::now(),
            is_first_start,
            leave: false,
        };
        Ok((files, session))
    }

    pub fn is_first_start(&self) -> bool {
        self.is_first_start
    }

    /// Before anything is drawn: what the system asks for, and what has become of the file.
    pub fn watch(&mut self, state: &mut State, ctx: &egui::Context) {
        if ctx.input(|input| input.viewport().close_requested()) && !self.leave && state.session.is_unsaved() {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.waiting = Some(Next::Quit);
        }
        if let Some(keeper) = &self.keeper {
            let is_due = !state.session.history().is_open() || self.kept_at.elapsed() > KEEP;
            if self.kept != state.session.version() && is_due {
                (self.kept, self.kept_at) = (state.session.version(), Instant::now());
                match state.session.is_unsaved() {
                    true => keeper.keep(state.session.document(), state.session.file().map(Path::to_owned)),
                    false => keeper.forget(),
                }
            }
            match keeper.kept() {
                Some(Ok(())) => self.taken.drain(..).for_each(Left::discard),
                Some(Err(error)) => state.complain(&error),
                None => {}
            }
        }
        if self.looked.elapsed() > LOOK {
            self.looked = Instant::now();
            self.on_disk = state.session.on_disk();
        }
        ctx.request_repaint_after(LOOK);
        let dropped = ctx.input(|input| input.raw.dropped_files.clone());
        for file in &dropped {
            self.dropped(state, file.path());
        }
    }

    /// A recipe is opened; a scene or a picture becomes a node.
    fn dropped(&mut self, state: &mut State, file: &Path) {
        let suffix = file.extension().map(|suffix| suffix.to_string_lossy().to_lowercase()).unwrap_or_default();
        let kind = match suffix.as_str() {
            "json" => return self.go(state, Next::Open(file.to_owned())),
            "glb" | "gltf" => "scene",
            "hdr" => "environment",
            "exr" | "png" | "jpg" | "jpeg" => "read_image",
            _ => {
                let message = format!("{}: this is no recipe, scene or picture", file.display());
                let help = "drop .json, .glb, .gltf, .exr, .hdr, .png or .jpg files";
                return state.complain(&Error::usage(message, help));
            }
        };
        let path = written(&state.document().base, file);
        let at = super::graph::free_place(state);
        let added = state.change(&format!("add {kind}"), None, |document| {
            let name = document.add_node(kind, at);
            document.set_param(&name, "file", Some(path.into()));
            Ok(name)
        });
        if let Some(name) = added {
            state.choose(&name);
        }
    }

    /// Does what a command asks for; `false` when it is none of its own.
    pub fn perform(&mut self, command: &Command, state: &mut State) -> bool {
        match command {
            Command::New => self.go(state, Next::New),
            Command::Example => self.go(state, Next::Example),
            Command::Open => self.go(state, Next::PickFile),
            Command::OpenFile(file) => self.go(state, Next::Open(file.clone())),
            Command::Quit => self.go(state, Next::Quit),
            Command::Save if state.session.file().is_some() => drop(self.save(state, None)),
            Command::Save | Command::SaveAs => self.pick(Purpose::Save, state),
            _ => return false,
        }
        true
    }

    /// Asks first when there is something to be lost.
    fn go(&mut self, state: &mut State, next: Next) {
        match state.session.is_unsaved() {
            true => self.waiting = Some(next),
            false => self.proceed(state, next),
        }
    }

    fn proceed(&mut self, state: &mut State, next: Next) {
        let registry = state.session.registry();
        let session = match next {
            Next::Quit => return self.leave = true,
            Next::PickFile => return self.pick(Purpose::Open, state),
            Next::New => Ok(Session::new(registry)),
            Next::Example => example(registry),
            Next::Open(file) => {
                let session = Session::open(&file, registry);
                let _ = if session.is_ok() { self.recent.note(&file) } else { self.recent.forget(&file) };
                session
            }
        };
        match session {
            Ok(session) => self.replace(state, session),
            Err(error) => state.complain(&error),
        }
    }

    fn replace(&mut self, state: &mut State, session: Session) {
        self.forget();
        self.kept = session.version();
        self.on_disk = OnDisk::Same;
        *state = State::new(session);
    }

    /// What is kept aside is saved, or given up.
    fn forget(&mut self) {
        self.taken.drain(..).for_each(Left::discard);
        if let Some(keeper) = &self.keeper {
            keeper.forget();
        }
    }

    /// Whether it was written.
    fn save(&mut self, state: &mut State, file: Option<&Path>) -> bool {
        let result = match file {
            Some(file) => state.session.save_as(file),
            None => state.session.save(),
        };
        match result {
            Ok(()) => {
                if let Some(file) = state.session.file() {
                    let _ = self.recent.note(file);
                }
                self.forget();
                self.on_disk = OnDisk::Same;
                state.tell("saved");
                true
            }
            Err(error) => {
                state.complain(&error);
                false
            }
        }
    }

    pub fn recent_menu(&self, state: &mut State, ui: &mut egui::Ui) {
        ui.separator();
        ui.menu_button("Recent", |ui| {
            if self.recent.files().is_empty() {
                ui.weak("none yet");
            }
            for file in self.recent.files() {
                if ui.button(file.display().to_string()).clicked() {
                    state.ask(Command::OpenFile(file.clone()));
                    ui.close();
                }
            }
        });
    }

    pub fn ui(&mut self, state: &mut State, ctx: &egui::Context) {
        self.dialog_ui(state, ctx);
        self.guard_ui(state, ctx);
        self.disk_ui(state, ctx);
        self.left_ui(state, ctx);
        if self.leave {
            self.forget();
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }
}

fn example(registry: &'static [NodeType]) -> Result<Session> {
    let document = Document::parse(Path::new("untitled.json"), EXAMPLE)?;
    Ok(Session::new_of(document, registry))
}
