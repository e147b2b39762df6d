//! Values of parameters, as the command line and the files of charts name them.

use crate::{Error, Result};
use indexmap::IndexMap;
use serde_json::Value as Json;

/// Values by `NODE.PARAM`.
pub type Settings = IndexMap<String, Json>;

/// A setting that is of no node: what to compute on, "cpu" or "gpu".
pub const DEVICE: &str = "device";

/// `NODE.PARAM=JSON`.
///
/// # Errors
/// `Usage`.
pub fn setting(option: &str, text: &str) -> Result<(String, Json)> {
    let parsed = parts(text).and_then(|(name, value)| Some((name.to_owned(), value_of(value)?)));
    parsed.ok_or_else(|| {
        let help = format!("write {option} NODE.PARAM=JSON, as in {option} transport.tolerance=0.002");
        Error::usage(format!("{option} {text}: this is not NODE.PARAM=JSON"), help)
    })
}

/// `NODE.PARAM=V,V,...`, or a JSON list for values that have commas.
///
/// # Errors
/// `Usage`.
pub fn values(text: &str) -> Result<(String, Vec<Json>)> {
    let (name, list) = parts(text).ok_or_else(|| {
        let help = "write --sweep NODE.PARAM=V,V, as in --sweep transport.tolerance=0.08,0.04";
        Error::usage(format!("--sweep {text}: this is not NODE.PARAM=V,V"), help)
    })?;
    let values = match serde_json::from_str(list) {
        Ok(Json::Array(values)) => Some(values),
        _ => list.split(',').map(value_of).collect(),
    };
    let fault = || Error::usage(format!("--sweep {text}: {list} is not a list of values"), "part values by commas");
    Ok((name.to_owned(), values.ok_or_else(fault)?))
}

fn parts(text: &str) -> Option<(&str, &str)> {
    text.split_once('=').filter(|(name, _)| name.contains('.') || *name == DEVICE)
}

/// JSON; a bare word is a text.
fn value_of(text: &str) -> Option<Json> {
    let is_word = !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || "_-".contains(c));
    serde_json::from_str(text).ok().or_else(|| is_word.then(|| Json::from(text)))
}

/// As people read a value: texts without quotes.
pub fn shown(value: &Json) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_of_the_command_line() {
        let swept = |text: &str| values(text).unwrap().1;
        assert_eq!(swept("a.b=0.5,2"), [json!(0.5), json!(2)]);
        assert_eq!(swept("a.b=cut,haar"), [json!("cut"), json!("haar")]);
        assert_eq!(swept("device=cpu,gpu"), [json!("cpu"), json!("gpu")]);
        assert_eq!(swept("a.b=[[1,2],[3,4]]"), [json!([1, 2]), json!([3, 4])]);
        assert!(["a=1", "a.b", "a.b=", "a.b=1,,2", "a.b={"].iter().all(|text| values(text).is_err()));
        assert_eq!(setting("--set", "a.b=\"x y\"").unwrap().1, json!("x y"));
    }
}
