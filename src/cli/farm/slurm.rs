//! A shell script that submits a batch to Slurm: one array for what chunks share, and one for the frames after it.

use super::Job;
use crate::cli::frames::format_frames;
use std::fmt::Write;

/// Tasks of an array: Slurm's own bound of their numbers is 1000.
const ARRAY: usize = 1000;

pub fn script(job: &Job) -> String {
    let chunks: Vec<String> = job.frames.chunks(job.chunk_size as usize).map(format_frames).collect();
    let more: String = job.more.iter().map(|argument| format!(" {}", quoted(argument))).collect();
    let (name, recipe) = (quoted(&job.name), quoted(&job.recipe.display().to_string()));
    let mut text = String::new();
    let _ = writeln!(
        text,
        r#"#!/bin/bash
# Run this where sbatch is. CHIARO names the program, OUT and CACHE folders that all nodes see, SBATCH_ARGS more for sbatch.
set -euo pipefail
CHIARO="${{CHIARO:-chiaro}}"
case "$CHIARO" in */*) CHIARO="$(realpath -- "$CHIARO")" ;; esac
cd "$(dirname "${{BASH_SOURCE[0]}}")"
export RECIPE={recipe} CHIARO OUT="${{OUT:-$PWD/frames}}" CACHE="${{CACHE:-$PWD/cache}}"
submit=(sbatch --parsable --export=ALL --chdir="$PWD")
[ -z "${{SBATCH_ARGS:-}}" ] || read -ra more <<<"$SBATCH_ARGS" && submit+=(${{more[@]+"${{more[@]}}"}})"#
    );
    let render = r#""$CHIARO" render "$RECIPE" --out "$OUT" --cache "$CACHE" --progress plain"#;
    let mut after = "";
    if !job.precompute.is_empty() {
        let (shards, frames) = (job.shards, job.precompute_list());
        let _ = writeln!(
            text,
            r#"
# What chunks of frames share, in parts that meet in the cache.
precompute=$("${{submit[@]}}" --job-name={name}-precompute --array=1-{shards} <<'END'
#!/bin/bash
exec {render} --frames {frames} --shard "$SLURM_ARRAY_TASK_ID/{shards}"{more}
END
)"#
        );
        // Not `afterok`: frames compute what is missing. A cluster's name may come after the number.
        after = r#" --dependency="afterany:${precompute%%;*}""#;
    }
    let skip = if job.skip_existing { " --skip-existing" } else { "" };
    for chunks in chunks.chunks(ARRAY) {
        let (count, list) = (chunks.len(), chunks.join(" "));
        let _ = writeln!(
            text,
            r#"
"${{submit[@]}}" --job-name={name} --array=1-{count}{after} <<'END'
#!/bin/bash
chunks=({list})
exec {render}{skip} --frames "${{chunks[SLURM_ARRAY_TASK_ID - 1]}}"{more}
END"#
        );
    }
    text
}

/// As a word of the shell.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,".contains(c);
    match !text.is_empty() && text.chars().all(plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn words_stay_words() {
        let quoted = super::quoted;
        assert_eq!([quoted("a.b=1"), quoted("it's $HOME"), quoted("")], ["a.b=1", r"'it'\''s $HOME'", "''"]);
    }
}
