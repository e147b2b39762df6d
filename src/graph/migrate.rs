//! Recipes of older versions, brought up to date step by step.

use serde_json::Value as Json;

/// The version that this program writes.
pub const VERSION: u64 = 1;

/// `STEPS[n - 1]` turns a recipe of version `n` into one of version `n + 1`. Its node names and spelling of values
/// should stay, so that problems found later still point at the text.
const STEPS: [fn(&mut Json); VERSION as usize - 1] = [];

/// Brings `root` to `VERSION`.
///
/// # Errors
/// Message and help when its version is missing, not a version, or newer than this program.
pub fn migrate(root: &mut Json) -> Result<(), (String, String)> {
    let field = root.get("chiaro");
    let version = match field {
        None => {
            let help = format!("a recipe starts with \"chiaro\": {VERSION}");
            return Err(("the recipe does not say its version".into(), help));
        }
        Some(field) => field.as_u64().filter(|version| *version >= 1),
    };
    let Some(version) = version else {
        let found = field.expect("just looked at");
        return Err((format!("{found} is not a version"), format!("versions are 1 to {VERSION}")));
    };
    if version > VERSION {
        let message = format!("the recipe has version {version}, and this program reads versions up to {VERSION}");
        return Err((message, "open it with a newer chiaro".into()));
    }
    for step in &STEPS[version as usize - 1..] {
        step(root);
    }
    root["chiaro"] = VERSION.into();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn versions_are_judged() {
        let judge = |mut root: Json| migrate(&mut root).map_err(|(message, _)| message);
        assert_eq!(judge(json!({"chiaro": 1})), Ok(()));
        assert!(judge(json!({"chiaro": 7})).unwrap_err().contains("version 7"));
        for strange in [json!(0), json!(-1), json!(1.5), json!("1"), json!(null)] {
            assert!(judge(json!({"chiaro": strange})).unwrap_err().contains("not a version"));
        }
        assert!(judge(json!({})).unwrap_err().contains("does not say"));
    }
}
