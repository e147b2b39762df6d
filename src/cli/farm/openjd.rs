//! A job template of Open Job Description, `jobtemplate-2023-09`.

use super::Job;
use serde_json::{Value as Json, json};
use yaml_rust2::yaml::Hash;
use yaml_rust2::{Yaml, YamlEmitter};

pub fn template(job: &Job) -> String {
    let mut text = String::new();
    YamlEmitter::new(&mut text).dump(&yaml(&description(job))).expect("text takes all");
    format!("{}\n", text.trim_start_matches("---\n"))
}

fn description(job: &Job) -> Json {
    let path = |name: &str, kind: &str, flow: &str, default: &str, text: &str| {
        let mut path = json!({ "name": name, "type": "PATH", "objectType": kind, "dataFlow": flow });
        // Engines refuse absolute paths as defaults: what does not lie beside the template is to be named.
        if !std::path::Path::new(default).is_absolute() {
            path["default"] = default.into();
        }
        path["description"] = text.into();
        path
    };
    let run = |more: &[&str]| {
        let fixed = ["render", "{{Param.Recipe}}", "--out", "{{Param.Out}}", "--cache", "{{Param.Cache}}"];
        let rest = ["--progress", "openjd"].into_iter().chain(more.iter().copied());
        let fixed = fixed.into_iter().chain(rest).map(str::to_owned);
        let given = job.more.iter().enumerate().map(|(number, argument)| match is_format(argument) {
            true => format!("{{{{Param.{}}}}}", argument_name(number)),
            false => argument.clone(),
        });
        let arguments: Vec<String> = fixed.chain(given).collect();
        json!({ "actions": { "onRun": { "command": "{{Param.Chiaro}}", "args": arguments } } })
    };
    let shards = job.shards;
    let precompute = json!({
        "name": "Precompute",
        "description": "What chunks of frames share, in parts that meet in the cache",
        "parameterSpace": { "taskParameterDefinitions": [{ "name": "Shard", "type": "INT", "range": format!("1-{shards}") }] },
        "script": run(&["--frames", &job.precompute_list(), "--shard", &format!("{{{{Task.Param.Shard}}}}/{shards}")]),
    });
    let skip: &[&str] = if job.skip_existing { &["--skip-existing"] } else { &[] };
    let chunks = json!({ "defaultTaskCount": job.chunk_size, "rangeConstraint": "NONCONTIGUOUS" });
    let mut frames = json!({
        "name": "Frames",
        "parameterSpace": { "taskParameterDefinitions": [
            { "name": "Frame", "type": "CHUNK[INT]", "range": "{{Param.Frames}}", "chunks": chunks }
        ]},
        "script": run(&[&["--frames", "{{Task.Param.Frame}}"], skip].concat()),
    });
    let mut steps = Vec::new();
    if !job.precompute.is_empty() {
        steps.push(precompute);
        frames["dependencies"] = json!([{ "dependsOn": "Precompute" }]);
    }
    steps.push(frames);
    let text = |name: &str, default: &str, text: &str| json!({ "name": name, "type": "STRING", "default": default, "description": text });
    let mut parameters = vec![
        path("Recipe", "FILE", "IN", &job.recipe.display().to_string(), "The recipe"),
        path("Out", "DIRECTORY", "OUT", "frames", "Where pictures go"),
        path("Cache", "DIRECTORY", "INOUT", "cache", "What is precomputed; all workers share it"),
        text("Frames", &job.frame_list(), "Frames to render"),
        text("Chiaro", "chiaro", "The program"),
    ];
    let formats = job.more.iter().enumerate().filter(|(_, argument)| is_format(argument));
    parameters.extend(formats.map(|(number, argument)| text(&argument_name(number), argument, "As it was given")));
    json!({
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": name(&job.name),
        "parameterDefinitions": parameters,
        "steps": steps,
    })
}

/// Engines would take it for an expression of theirs, and know no way to say that it is none.
fn is_format(text: &str) -> bool {
    text.contains("{{") || text.contains("}}")
}

/// The job parameter that carries such an argument: parameters' values are text as it is.
fn argument_name(number: usize) -> String {
    format!("Argument{}", number + 1)
}

/// Names have 64 characters at most, none of them a control character.
fn name(of_recipe: &str) -> String {
    let plain = of_recipe.replace("{{", "(").replace("}}", ")");
    let short: String = plain.chars().filter(|c| !c.is_control()).take(64).collect();
    if short.is_empty() { "chiaro".to_owned() } else { short }
}

fn yaml(json: &Json) -> Yaml {
    match json {
        Json::Object(map) => {
            Yaml::Hash(map.iter().map(|(name, value)| (Yaml::String(name.clone()), yaml(value))).collect::<Hash>())
        }
        Json::Array(list) => Yaml::Array(list.iter().map(yaml).collect()),
        Json::String(text) => Yaml::String(text.clone()),
        Json::Bool(is) => Yaml::Boolean(*is),
        Json::Number(number) => match number.as_i64() {
            Some(whole) => Yaml::Integer(whole),
            None => Yaml::Real(number.to_string()),
        },
        Json::Null => Yaml::Null,
    }
}
