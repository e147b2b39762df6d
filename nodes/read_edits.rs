//! Reads sampled edits that `write_edits`, or another program, wrote.

use crate::Result;
use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::transport::{Edit, sampled};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReadEdits {
    /// What `write_edits` wrote; `####`, `%04d` and `$F4` are the frame.
    pub file: String,
}

impl Node for ReadEdits {
    const INFO: Info = Info {
        name: "read_edits",
        category: "indirect light",
        summary: "Reads sampled edits from a file; they apply to the scene and view that they were sampled for",
        inputs: &[Port::new("edits", Kind::Edits, "Edits to come before").optional()],
        outputs: &[Port::new("edits", Kind::Edits, "The edits before, and those of the file")],
        uses_frame: true,
        ..Info::NEW
    };

    fn files(&self) -> Vec<String> {
        vec![self.file.clone()]
    }

    fn uses_frame(&self, _base: &Path) -> bool {
        frame_path(&self.file, 0.0) != self.file
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let sampled = sampled::read(&job.path(&frame_path(&self.file, job.frame)))?;
        for (part, bytes) in sampled.bytes_by_part() {
            job.note(&format!("bytes_of_{part}"), bytes);
        }
        job.note("rows", sampled.rows());
        job.note("touched_view_samples", sampled.touched.len());
        let before = inputs.edits("edits").cloned().unwrap_or_default();
        Ok(vec![Value::Edits(Arc::new(before.and(Edit::Sampled(Arc::new(sampled)))))])
    }
}
