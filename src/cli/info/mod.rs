//! `chiaro info`: what a file holds.

mod picture;
mod scene;

use super::print;
use crate::image::load;
use crate::transport::sampled;
use crate::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

/// Say what is in a file: layers of a picture, objects of a scene, places of sampled edits
#[derive(clap::Args)]
pub struct Args {
    /// A picture (EXR, HDR, PNG, JPEG), a scene (.glb, .gltf), or sampled edits
    file: PathBuf,
    /// Read the pixels, too: least, mean and largest value of each layer, and how many are NaN or infinite
    #[arg(long)]
    values: bool,
    /// Print the recipe that a picture was made by, and nothing else
    #[arg(long, conflicts_with_all = ["values", "json"])]
    recipe: bool,
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    /// # Errors
    /// `File` for what cannot be read, or carries no recipe where one is asked for.
    pub fn run(self) -> Result<u8> {
        let extension = load::extension(&self.file);
        let is_picture = load::EXTENSIONS.contains(&extension.as_str());
        if !is_picture && (self.recipe || self.values) {
            let message = format!("{} is no picture", self.file.display());
            return Err(Error::usage(message, "give an EXR, HDR, PNG or JPEG file"));
        }
        if self.recipe {
            print(&(picture::recipe(&self.file)?.trim_end().to_owned() + "\n"));
            return Ok(0);
        }
        let text = match extension.as_str() {
            _ if is_picture => {
                let found = picture::describe(&self.file, self.values)?;
                if self.json { pretty(&json!(found)) } else { found.text() }
            }
            "glb" | "gltf" => {
                let found = scene::describe(&self.file)?;
                if self.json { pretty(&json!(found)) } else { found.text() }
            }
            _ => {
                let found = sampled::read(&self.file)?;
                let parts: Vec<(&str, u64)> = found.bytes_by_part().to_vec();
                let (rows, touched) = (found.rows(), found.touched.len());
                if self.json {
                    let bytes: serde_json::Map<_, _> =
                        parts.iter().map(|(name, n)| ((*name).to_owned(), json!(n))).collect();
                    pretty(&json!({ "kind": "edits", "rows": rows, "touched_view_samples": touched, "bytes": bytes }))
                } else {
                    let file = self.file.display();
                    let mut text = format!("{file}: sampled edits, {rows} rows for {touched} view samples\n");
                    parts.iter().for_each(|(name, bytes)| text += &format!("  {name:<12} {bytes} bytes\n"));
                    text
                }
            }
        };
        print(&plain(&text));
        Ok(0)
    }
}

/// Text of a file must not steer the terminal.
fn plain(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\n' { '\u{fffd}' } else { c }).collect()
}

fn pretty(json: &serde_json::Value) -> String {
    serde_json::to_string_pretty(json).expect("plain data") + "\n"
}

/// Names side by side, as many as fit on a few lines.
fn list(names: &[String]) -> String {
    const MOST: usize = 60;
    let shown = names.iter().take(MOST).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > MOST { format!("{shown} and {} more", names.len() - MOST) } else { shown }
}
