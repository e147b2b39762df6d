//! What evaluation has told of nodes.

use super::state::State;
use crate::Error;
use crate::editor::thumb::Thumb;
use crate::editor::worker::Event;
use crate::eval::{CacheUse, NodeReport};

/// What evaluation has told of a node.
#[derive(Default)]
pub struct Known {
    /// Of its last computation.
    pub seconds: Option<f64>,
    pub cache: Option<CacheUse>,
    pub bytes: u64,
    pub warnings: Vec<String>,
    pub error: Option<(String, String)>,
    pub thumb: Option<egui::TextureHandle>,
}

pub struct Progress {
    pub node: String,
    pub stage: String,
    pub done: u64,
    pub total: u64,
}

impl State {
    /// What a worker has told.
    pub fn hear(&mut self, event: &Event, ctx: &egui::Context) {
        match event {
            Event::Progress { node, stage, done, total, .. } => {
                let (node, stage) = (node.clone(), stage.clone());
                self.progress = Some(Progress { node, stage, done: *done, total: *total });
            }
            Event::Finished { result, reports, .. } => {
                self.progress = None;
                reports.iter().for_each(|report| self.note(report));
                if let Err(Error::AtNode { node, error, .. }) = result {
                    let told = (error.to_string(), error.help().to_owned());
                    self.known.entry(node.clone()).or_default().error = Some(told);
                }
            }
            Event::Thumbs { thumbs } => {
                for (node, thumb) in thumbs {
                    let texture = thumb.as_ref().map(|thumb| texture(ctx, node, thumb));
                    self.known.entry(node.clone()).or_default().thumb = texture;
                }
            }
        }
    }

    fn note(&mut self, report: &NodeReport) {
        let known = self.known.entry(report.node.clone()).or_default();
        known.cache = Some(report.cache);
        known.bytes = report.bytes;
        if report.cache == CacheUse::Computed {
            known.seconds = Some(report.seconds);
        }
        let warnings = report.notes.get("warnings").and_then(|list| list.as_array());
        let texts = warnings.into_iter().flatten().filter_map(|text| text.as_str());
        known.warnings = texts.map(str::to_owned).collect();
    }
}

fn texture(ctx: &egui::Context, node: &str, thumb: &Thumb) -> egui::TextureHandle {
    let image = egui::ColorImage::from_rgba_unmultiplied([thumb.width, thumb.height], thumb.pixels.as_flattened());
    ctx.load_texture(format!("thumb of {node}"), image, egui::TextureOptions::LINEAR)
}
