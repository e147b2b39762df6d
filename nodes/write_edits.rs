//! Writes sampled edits into a file that other programs can read.

use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::transport::{Edit, Edits, Sampled, sampled};
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
        let sampled = only(inputs.need_edits("edits")?)?;
        let path = job.output(&frame_path(&self.file, job.frame));
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            let help = "check that the folder can be made, or name another";
            std::fs::create_dir_all(folder).map_err(|error| Error::output(&path, error.to_string(), help))?;
        }
        let bytes = sampled::write(&path, sampled)?;
        job.note("file", path.to_string_lossy());
        job.note("bytes", bytes);
        job.note("rows", sampled.rows());
        job.note("touched_view_samples", sampled.touched.len());
        Ok(Vec::new())
    }
}

/// The one sampled edit of a list that holds nothing else.
fn only(edits: &Edits) -> Result<&Sampled> {
    let found = match &edits.0[..] {
        [Edit::Sampled(sampled)] => return Ok(sampled),
        [] => "no edit at all".to_owned(),
        list => {
            let sampled = edits.sampled().count();
            format!("{} edits, {sampled} of them sampled", list.len())
        }
    };
    let help = "put scale_offset before write_edits: it makes one sampled edit of any list that changes something";
    Err(Error::compute(format!("the file takes one sampled edit, the list holds {found}"), help))
}
