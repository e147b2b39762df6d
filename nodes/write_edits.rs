//! Writes sampled edits into a file that other programs can read.

use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::transport::sampled;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WriteEdits {
    /// `####`, `%04d` and `$F4` are the frame. Folders that are missing are made.
    pub file: String,
}

impl Node for WriteEdits {
    const INFO: Info = Info {
        name: "write_edits",
        category: "indirect light",
        summary: "Writes sampled edits as a file for other programs, or for read_edits",
        inputs: &[Port::new("edits", Kind::Edits, "What scale_offset or read_edits gave, and nothing else")],
        uses_frame: true,
        ..Info::NEW
    };

    fn output_files(&self, frame: f64) -> Vec<String> {
        vec![frame_path(&self.file, frame)]
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let edits = sampled::only(inputs.need_edits("edits")?)?;
        let path = job.output(&frame_path(&self.file, job.frame));
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            let help = "check that the folder can be made, or name another";
            std::fs::create_dir_all(folder).map_err(|error| Error::output(&path, error.to_string(), help))?;
        }
        let bytes = sampled::write(&path, edits)?;
        job.note("file", path.to_string_lossy());
        job.note("bytes", bytes);
        job.note("rows", edits.rows());
        job.note("touched_view_samples", edits.touched.len());
        Ok(Vec::new())
    }
}
